// Phase plane: v over x for the newest samples, with the Poincaré points.

import { calmRange } from "./axis.js";
import { Plot } from "./plot.js";
import { put } from "./text.js";

const $ = (id) => document.getElementById(id);
// Rows of the orbit that are drawn, at most, and the time that they cover, in s.
const MAX_ROWS = 3000;
const ORBIT_S = 2.5;
// The mean of x_velocity covers 8 ms; differences of x use about the same.
const DIFFERENCE_S = 0.008;
// Poincaré points that are drawn: older ones belong to other frequencies.
const NEWEST_POINTS = 120;
// Those that stand out and always are inside the axes.
const BRIGHT_POINTS = 20;

export class PhasePlane {
  every = 100;

  constructor(model) {
    this.model = model;
    this.orbit = [];
    this.section = [];
    this.ranges = { x: [-1, 1], y: [-1, 1] };
    this.calm = { x: calmRange(1e-3), y: calmRange(1e-5) };
    this.plot = new Plot($("plot-phase"), {
      xLabel: "x (mm)", yLabel: "v (m/s)", x: () => this.ranges.x, y: () => this.ranges.y, before: (pen) => this.#paint(pen),
    });
  }

  draw() {
    const { rows } = this.model;
    // Points of another drive frequency belong to another motion.
    const newest_hz = this.model.section.at(-1)?.[2];
    this.section = this.model.section.slice(-NEWEST_POINTS).filter(([, , hz]) => hz === newest_hz);
    const { from, step } = newest(rows);
    const isMeasured = from < rows.length && !Number.isNaN(rows.columns.x_velocity[rows.length - 1]);
    const half = Math.max(1, Math.round(DIFFERENCE_S / 2 / (step || 1)));
    this.orbit = isMeasured ? measured(rows, from) : differences(rows, from, half);
    let [x, v] = [0, 0];
    for (const point of [...this.orbit, ...this.section.slice(-BRIGHT_POINTS).map(([a, b]) => [a * 1e3, b])]) {
      if (point === null) continue;
      x = Math.max(x, Math.abs(point[0]));
      v = Math.max(v, Math.abs(point[1]));
    }
    this.ranges = { x: this.calm.x(-x, x), y: this.calm.y(-v, v) };
    this.plot.draw();
    put($("phase-note"), this.#note(isMeasured, half * 2 * step));
  }

  #note(isMeasured, span_s) {
    if (this.orbit.length === 0) return "";
    const how = isMeasured ? "v measured" : `v from differences of x over ${Math.round(span_s * 1e3)} ms`;
    const points = this.section.length;
    return points > 0 ? `${how} · ${points} Poincaré points, one a cycle of the drive` : how;
  }

  #paint(pen) {
    const old = Math.floor(this.orbit.length * 0.6);
    pen.path(this.orbit.slice(0, old + 1), "grey", { alpha: 0.45, width: 1 });
    pen.path(this.orbit.slice(old), "curve-0", { width: 1.4 });
    // Poincaré points: the newest ones stand out.
    const { section } = this;
    section.forEach(([x, v], i) => {
      const isNew = i >= section.length - BRIGHT_POINTS;
      pen.dot(x * 1e3, v, isNew ? 3.5 : 2, "curve-5", { alpha: isNew ? 1 : 0.45 });
    });
    const now = this.orbit.at(-1);
    if (now) pen.ring(now[0], now[1], 5, "curve-3", { width: 2.5 });
  }
}

// The newest rows of even spacing: the first of them and the spacing. Extremes of a faster stream are spaced wider and are not
// part of the orbit.
function newest(rows) {
  const last = rows.length - 1;
  if (last < 2) return { from: rows.length, step: 0 };
  const step = Math.max(1e-6, (rows.t[last] - rows.t[Math.max(0, last - 20)]) / Math.min(20, last));
  let from = last;
  while (from > 0 && last - from < MAX_ROWS && rows.t[last] - rows.t[from] < ORBIT_S) {
    const gap = rows.t[from] - rows.t[from - 1];
    if (gap > 4 * step || gap < 0.25 * step) break;
    from -= 1;
  }
  return { from, step };
}

function measured(rows, from) {
  const { x, x_velocity } = rows.columns;
  const points = [];
  for (let i = from; i < rows.length; i += 1) {
    points.push(Number.isNaN(x[i]) || Number.isNaN(x_velocity[i]) ? null : [x[i] * 1e3, x_velocity[i]]);
  }
  return points;
}

// Central differences over `half` rows to both sides.
function differences(rows, from, half) {
  const { x } = rows.columns;
  const points = [];
  for (let i = from + half; i < rows.length - half; i += 1) {
    const v = (x[i + half] - x[i - half]) / (rows.t[i + half] - rows.t[i - half]);
    points.push(Number.isFinite(v) && !Number.isNaN(x[i]) ? [x[i] * 1e3, v] : null);
  }
  return points;
}
