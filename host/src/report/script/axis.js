// Ranges and round ticks of axes: the rule of the report's figures (plot/axis.rs).

// The smallest of 1, 2, 5 times a power of ten that is at least `atLeast`.
export function roundStep(atLeast) {
  const power = 10 ** Math.floor(Math.log10(atLeast));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => step >= atLeast * (1 - 1e-9)) ?? 10 * power;
}

// Range that covers `values` with a margin; 0.5 to 2 without values. A logarithmic axis leaves out values of 0 and below.
export function around(values, isLog = false) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value === null || !Number.isFinite(value) || (isLog && value <= 0)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [0.5, 2];
  if (isLog) return [low / 1.3, high * 1.3];
  const margin = high > low ? 0.04 * (high - low) : 0.5 * Math.max(Math.abs(high), 1);
  return [low - margin, high + margin];
}

const MIN_LABELS = 3;

// Ticks at round steps: at most `divisions` steps over the axis, or as few more as give three labels. The figures have 7; a small plot
// has room for fewer.
export function linearTicks(from, to, divisions = 7) {
  if (!(to > from) || !Number.isFinite(to - from)) return [];
  let ticks = [];
  for (const parts of [divisions, 7, 10, 14].filter((parts) => parts >= divisions)) {
    const step = roundStep((to - from) / parts);
    ticks = [];
    for (let i = Math.ceil(from / step); i <= Math.floor(to / step) && ticks.length < 50; i += 1) ticks.push(i * step);
    if (ticks.length >= MIN_LABELS) break;
  }
  return ticks;
}

// Major ticks at 1, 2, 5 in every decade (at 1 only above 3.5 decades), and the minor ones between; even ticks where those are too few.
export function logTicks(from, to) {
  const major = [];
  const minor = [];
  if (!(from > 0) || !(to > from)) return { major, minor };
  const labelled = Math.log10(to / from) <= 3.5 ? [1, 2, 5] : [1];
  for (let decade = Math.floor(Math.log10(from)); decade <= Math.ceil(Math.log10(to)); decade += 1) {
    for (let m = 1; m < 10; m += 1) {
      const value = Number((m * 10 ** decade).toPrecision(12));
      if (value >= from * (1 - 1e-9) && value <= to * (1 + 1e-9)) (labelled.includes(m) ? major : minor).push(value);
    }
  }
  return major.length < MIN_LABELS ? { major: linearTicks(from, to), minor: [] } : { major, minor };
}

const decimalsOf = (step) => Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
const withMinus = (text) => (Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−"));

// uPlot gives null for a tick that its filter leaves out; it has no label.
const kept = (ticks) => ticks.filter((value) => value !== null);

// Labels with the decimals that the spacing needs.
export function linearLabels(ticks) {
  const [first, second] = kept(ticks);
  const step = second === undefined ? Math.abs(first) || 1 : second - first;
  return ticks.map((value) => (value === null ? "" : withMinus(value.toFixed(decimalsOf(step)))));
}

export function logLabels(ticks) {
  const [first, second, third] = kept(ticks);
  const isEven = Math.abs(third - 2 * second + first) < 1e-6 * (second - first);
  return isEven ? linearLabels(ticks) : ticks.map((value) => (value === null ? "" : value.toFixed(decimalsOf(value))));
}

// Ticks of a figure's axis with their labels.
export function figureTicks(from, to, isLog) {
  const { major, minor } = isLog ? logTicks(from, to) : { major: linearTicks(from, to), minor: [] };
  return { major, minor, labels: isLog ? logLabels(major) : linearLabels(major) };
}

// A range for live data that grows at once and shrinks only when the data need less than half of it, so that it is calm. The
// returned function maps lowest and highest value to the range; `least` is the smallest half range.
export function calmRange(least) {
  let half = 0;
  return (low, high) => {
    const need = Math.max(least, Math.abs(low) * 1.08, Math.abs(high) * 1.08);
    if (Number.isFinite(need) && (need > half || need < 0.4 * half)) {
      const power = 10 ** Math.floor(Math.log10(need));
      half = power * [1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((m) => m * power >= need * (1 - 1e-9));
    }
    return half > 0 ? [-half, half] : [-1, 1];
  };
}
