// Reduces rows to the lowest and highest value per column of a plot. No extreme is lost.

// The rows from `from` to `to` of a ring for a plot of `columns` columns: `t` and one list per name, with null at gaps.
// `perColumn` is the number of rows that share a column; 1 means that every row is drawn.
export function extremes(ring, names, from, to, columns) {
  const first = Math.max(0, ring.search(from) - 1);
  const end = Math.min(ring.length, ring.search(to) + 1);
  const sources = names.map((name) => ring.columns[name]);
  if (end - first <= 2 * columns) return every(ring, sources, first, end);
  // Columns at multiples of their width, so that the picture does not flicker while it moves.
  const width = (to - from) / columns;
  const t = [];
  const series = sources.map(() => []);
  let start = first;
  while (start < end) {
    const column = Math.floor(ring.t[start] / width);
    let next = start + 1;
    while (next < end && Math.floor(ring.t[next] / width) === column) next += 1;
    const hasGap = sources.some((source) => gapIn(source, start, next));
    t.push(column * width, (column + 0.5) * width);
    if (hasGap) t.push((column + 0.75) * width);
    sources.forEach((source, i) => {
      const [early, late] = pair(source, start, next);
      series[i].push(early, late);
      if (hasGap) series[i].push(null);
    });
    start = next;
  }
  return { t, series, perColumn: Math.round((end - first) / columns) };
}

function every(ring, sources, first, end) {
  const t = Array.from(ring.t.subarray(first, end));
  const series = sources.map((source) =>
    Array.from(source.subarray(first, end), (value) => (Number.isNaN(value) ? null : value)),
  );
  return { t, series, perColumn: 1 };
}

// A gap is a row without any value of a column that has values beside it.
function gapIn(source, start, end) {
  let known = 0;
  for (let i = start; i < end; i += 1) if (!Number.isNaN(source[i])) known += 1;
  return known > 0 && known < end - start;
}

// Lowest and highest value in the order in which they came; null without values.
function pair(source, start, end) {
  let low = NaN;
  let high = NaN;
  let lowAt = start;
  let highAt = start;
  for (let i = start; i < end; i += 1) {
    const value = source[i];
    if (!(value >= low)) {
      if (!Number.isNaN(value)) {
        low = value;
        lowAt = i;
      }
    }
    if (!(value <= high)) {
      if (!Number.isNaN(value)) {
        high = value;
        highAt = i;
      }
    }
  }
  if (Number.isNaN(low)) return [null, null];
  return lowAt <= highAt ? [low, high] : [high, low];
}

// Lowest and highest of lists with nulls: [Infinity, −Infinity] without values.
export function spread(lists) {
  let low = Infinity;
  let high = -Infinity;
  for (const list of lists) {
    for (const value of list) {
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}
