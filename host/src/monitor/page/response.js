// Frequency response: X/Z (cycle maxima) over frequency, a curve per set-up and experiment, the prediction behind it, the running value.

import { around } from "./axis.js";
import { Plot, outline } from "./plot.js";
import { put, significant, fixed } from "./text.js";

const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

export class Response {
  every = 200;

  constructor(model) {
    this.model = model;
    this.ranges = { x: [0, 1], y: [0.5, 2] };
    this.drawn = -1;
    this.plot = new Plot($("plot-response"), {
      xLabel: "Frequency (Hz)", yLabel: "X/Z (cycle maxima)", isLog: true,
      x: () => this.ranges.x, y: () => this.ranges.y,
      behind: (pen) => this.#predictions(pen), before: (pen) => this.#curves(pen),
      onHover: (x, y) => this.#hover(x, y),
    });
  }

  draw() {
    if (this.drawn !== this.model.changes.points) {
      this.drawn = this.model.changes.points;
      this.#legend();
      this.sorted = this.model.curves.map((curve) =>
        [...curve.points.values()].filter((p) => p.x_over_z > 0).sort((a, b) => a.frequency_hz - b.frequency_hz));
    }
    const running = this.#running();
    const pairs = this.model.curves.flatMap((curve, i) =>
      [...this.sorted[i].map((p) => [p.frequency_hz, p.x_over_z]), ...curve.predicted]);
    if (running !== null) pairs.push(running);
    this.ranges = { x: around(pairs.map((p) => p[0])), y: around(pairs.map((p) => p[1]), true) };
    this.plot.draw();
    if (this.hovered !== true) this.#note();
  }

  // Present frequency and running X/Z (lock-in) while the base moves.
  #running() {
    const [hz, ratio] = ["frequency_hz", "x_over_z_lock_in"].map((name) => this.model.state?.number(name) ?? null);
    return hz > 0 && ratio > 0 ? [hz, ratio] : null;
  }

  #predictions(pen) {
    for (const curve of this.model.curves) {
      pen.path(curve.predicted, `curve-${curve.index % 12}`, { width: 1.2, alpha: 0.8, dash: [2, 3] });
    }
  }

  #curves(pen) {
    this.model.curves.forEach((curve, i) => {
      const name = `curve-${curve.index % 12}`;
      const dash = curve.nth > 0 ? [6, 2 + 2 * curve.nth] : [];
      const points = this.sorted[i];
      pen.path(points.map((p) => [p.frequency_hz, p.x_over_z]), name, { width: 2, dash });
      for (const p of points) pen.marker(p.frequency_hz, p.x_over_z, curve.index, name, p.steadiness !== "not steady");
    });
    const running = this.#running();
    if (running !== null) {
      pen.upright(running[0], "grey", { dash: [5, 4], alpha: 0.7 });
      pen.ring(running[0], running[1], 8, "curve-5", { width: 2.5 });
    }
  }

  #note() {
    const running = this.#running();
    put($("response-note"), running === null ? "" : `now ${fixed(running[0], 3)} Hz: X/Z (lock-in) ${fixed(running[1], 2)}`);
  }

  // Reads out the measured point nearest in frequency.
  #hover(x) {
    this.hovered = x !== null;
    if (x === null) return this.#note();
    let nearest = null;
    this.model.curves.forEach((curve, i) => {
      for (const p of this.sorted?.[i] ?? []) {
        const distance = Math.abs(p.frequency_hz - x);
        if (nearest === null || distance < nearest.distance) nearest = { distance, p };
      }
    });
    if (nearest === null) return this.#note();
    const { p } = nearest;
    put($("response-note"), `${p.set_up}: ${significant(p.frequency_hz, 5)} Hz, X/Z ${fixed(p.x_over_z, 2)} (cycle maxima), ${fixed(p.x_over_z_lock_in, 2)} (lock-in), ${p.steadiness}`);
  }

  #legend() {
    const items = this.model.curves.map((curve) => {
      const item = document.createElement("li");
      const name = document.createElement("span");
      const several = this.model.curves.some((c) => c.experiment !== curve.experiment);
      name.textContent = several ? `${curve.set_up} · ${curve.experiment}` : curve.set_up || "points";
      const number = document.createElement("small");
      const total = curve.points.size;
      number.textContent = total > 0 ? `${total} points` : curve.predicted.length > 0 ? "predicted" : "no point yet";
      item.append(swatch(curve), name, number);
      return item;
    });
    const keys = [
      ["predicted", svg("line", { x1: 1, y1: 7, x2: 29, y2: 7, "stroke-dasharray": "2 3", "stroke-width": 1.2 }), "grey"],
      ["not steady", svg("circle", { cx: 15, cy: 7, r: 4, fill: "none", "stroke-width": 2 }), "grey"],
      ["running (lock-in)", svg("circle", { cx: 15, cy: 7, r: 5.5, fill: "none", "stroke-width": 2.5 }), "curve-5"],
    ];
    for (const [word, shape, tone] of keys) {
      const item = document.createElement("li");
      item.className = "key";
      const picture = svg("svg", { width: 30, height: 14, "aria-hidden": "true", class: `tint ${tone}` });
      picture.append(shape);
      item.append(picture, word);
      items.push(item);
    }
    $("response-legend").replaceChildren(...items);
  }
}

function svg(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries({ stroke: "currentColor", ...attributes })) element.setAttribute(key, value);
  return element;
}

function swatch(curve) {
  const picture = svg("svg", { width: 30, height: 14, "aria-hidden": "true", class: `tint curve-${curve.index % 12}` });
  const dash = curve.nth > 0 ? `6 ${2 + 2 * curve.nth}` : "none";
  const points = outline(curve.index).map(([x, y]) => `${15 + x * 0.85},${7 + y * 0.85}`).join(" ");
  picture.append(
    svg("line", { x1: 1, y1: 7, x2: 29, y2: 7, "stroke-width": 2, "stroke-dasharray": dash }),
    svg("polygon", { points, fill: "currentColor" }),
  );
  return picture;
}
