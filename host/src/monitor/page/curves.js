// Measured points over the predicted ones, a curve per set-up and experiment, with the running value: X/Z and the phase over frequency, Z
// over frequency of kept responses (sheets), frequency over the amplitude of x of tracked resonances (backbone).

import { around } from "./axis.js";
import { Plot, outline } from "./plot.js";
import { degrees, fixed, put, significant } from "./text.js";

const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
const mm = (metres) => (metres === null ? null : metres * 1e3);

// How each kind of curve is drawn: `of` gives abscissa and ordinate of a point or of the running numbers, `read` says a point in words.
export const KINDS = {
  response: {
    id: "response", xLabel: "Frequency (Hz)", yLabel: "X/Z (cycle maxima)", isLog: true, scale: [1, 1], hasPhase: true,
    of: (p) => [p.frequency_hz, p.x_over_z],
    running: (n) => [n("frequency_hz"), n("x_over_z_lock_in")],
    read: (p) => `${significant(p.frequency_hz, 5)} Hz, X/Z ${fixed(p.x_over_z, 2)} (cycle maxima), ${fixed(p.x_over_z_lock_in, 2)} (lock-in), `
      + `phase ${fixed(degrees(p.phase_rad), 1)}°`,
    now: ([hz, ratio]) => `now ${fixed(hz, 3)} Hz: X/Z (lock-in) ${fixed(ratio, 2)}`,
  },
  sheet: {
    id: "sheets", xLabel: "Frequency (Hz)", yLabel: "Z (mm)", isLog: true, scale: [1, 1e3],
    of: (p) => [p.frequency_hz, mm(p.z_m)],
    running: (n) => [n("frequency_hz"), mm(n("z_amplitude_m"))],
    read: (p) => `${significant(p.frequency_hz, 5)} Hz, Z ${fixed(mm(p.z_m), 4)} mm, X ${fixed(mm(p.x_m), 3)} mm`,
    now: ([hz, z]) => `now ${fixed(hz, 3)} Hz: Z ${fixed(z, 4)} mm`,
  },
  backbone: {
    id: "backbone", xLabel: "X (mm)", yLabel: "Frequency (Hz)", isLog: false, scale: [1e3, 1],
    of: (p) => [mm(p.x_m), p.frequency_hz],
    running: (n) => [mm(n("x_amplitude_m")), n("frequency_hz")],
    read: (p) => `${significant(p.frequency_hz, 6)} Hz at X ${fixed(mm(p.x_m), 3)} mm, phase ${fixed(degrees(p.phase_rad), 1)}°`,
    now: ([x, hz]) => `now ${fixed(hz, 4)} Hz at X ${fixed(x, 3)} mm`,
  },
};

const PHASES = [-270, -180, -90, 0, 90];

export class Curves {
  every = 200;

  constructor(model, draws) {
    this.model = model;
    this.draws = draws;
    this.kind = KINDS[draws];
    this.ranges = { x: [0, 1], y: [0.5, 2], phase: [-180, 0] };
    this.drawn = -1;
    const { id, xLabel, yLabel, isLog, hasPhase } = this.kind;
    const common = { x: () => this.ranges.x };
    this.plot = new Plot($(`plot-${id}`), {
      ...common, xLabel, yLabel, isLog, hasXLabels: !hasPhase, y: () => this.ranges.y,
      behind: (pen) => this.#predictions(pen), before: (pen) => this.#curves(pen), onHover: (x, y) => this.#hover(x, y),
    });
    this.phase = !hasPhase ? null : new Plot($(`plot-${id}-phase`), {
      ...common, xLabel, yLabel: "Phase (°)", y: () => this.ranges.phase, yTicks: PHASES, before: (pen) => this.#phases(pen),
      onHover: (x) => this.#hover(x, null),
    });
  }

  // Panels of kinds that a source does not have are folded; without any curve the response is shown.
  static hasData = (draws) => ({ curves }) => curves.some((c) => c.draws === draws) || (draws === "response" && curves.length === 0);

  draw() {
    if (this.drawn !== this.model.changes.points) {
      this.drawn = this.model.changes.points;
      this.#sort();
      this.#legend();
    }
    const running = this.#running();
    const pairs = this.curves.flatMap(({ places, predicted }) => [...places, ...predicted]);
    if (running !== null) pairs.push(running);
    this.ranges.x = around(pairs.map((p) => p[0]));
    this.ranges.y = around(pairs.map((p) => p[1]), this.kind.isLog);
    if (this.phase !== null) {
      const phases = [-180, 0, ...this.curves.flatMap((c) => c.points.map((p) => degrees(p.phase_rad)))].filter((p) => p !== null);
      this.ranges.phase = [Math.min(...phases) - 25, Math.max(...phases) + 25];
      this.phase.draw();
    }
    this.plot.draw();
    if (this.hovered !== true) this.#note();
  }

  #sort() {
    const [byX, byY] = this.kind.scale;
    this.curves = this.model.curves.filter((curve) => curve.draws === this.draws).map((curve, i) => {
      const isPlaced = (p) => this.kind.of(p).every((value) => value !== null && value > 0);
      const points = [...curve.points.values()].filter(isPlaced);
      points.sort((a, b) => (curve.is_in_order ? a.key - b.key : this.kind.of(a)[0] - this.kind.of(b)[0]));
      const predicted = curve.predicted.map(([x, y]) => [byX * x, byY * y]);
      // A colour for each set-up; sheets of a set-up differ in colour too.
      const tone = `curve-${(this.draws === "sheet" ? i : curve.index) % 12}`;
      const dash = curve.nth > 0 && this.draws !== "sheet" ? [6, 2 + 2 * curve.nth] : [];
      return { curve, points, places: points.map(this.kind.of), predicted, tone, dash };
    });
  }

  // The running value while the base moves in an experiment of this kind.
  #running() {
    const { number, set_up, experiment } = this.model.state ?? {};
    if (number === undefined || !(number("frequency_hz") > 0)) return null;
    const own = this.model.curves.find((c) => c.set_up === set_up && c.experiment === experiment);
    if ((own?.draws ?? "response") !== this.draws) return null;
    const place = this.kind.running(number);
    return place.every((value) => value > 0) ? place : null;
  }

  #predictions(pen) {
    for (const { predicted, tone } of this.curves) pen.path(predicted, tone, { width: 1.2, alpha: 0.8, dash: [2, 3] });
  }

  #curves(pen) {
    for (const one of this.curves) this.#curve(pen, one, one.points, one.places);
    const running = this.#running();
    if (running !== null) {
      pen.upright(running[0], "grey", { dash: [5, 4], alpha: 0.7 });
      pen.ring(running[0], running[1], 8, "curve-5", { width: 2.5 });
    }
  }

  #phases(pen) {
    for (const degree of PHASES) pen.level(degree, "grid", {});
    for (const one of this.curves) {
      const known = one.points.filter((p) => p.phase_rad !== null);
      this.#curve(pen, one, known, known.map((p) => [p.frequency_hz, degrees(p.phase_rad)]));
    }
    const [hz, phase] = [this.#running()?.[0], degrees(this.model.state?.number("x_phase_rad") ?? null)];
    if (hz === undefined) return;
    pen.upright(hz, "grey", { dash: [5, 4], alpha: 0.7 });
    if (phase !== null) pen.ring(hz, phase, 8, "curve-5", { width: 2.5 });
  }

  #curve(pen, { curve, tone, dash }, points, places) {
    pen.path(places, tone, { width: 2, dash });
    places.forEach(([x, y], i) => pen.marker(x, y, curve.index, tone, points[i].steadiness !== "not steady"));
  }

  #note() {
    const running = this.#running();
    put($(`${this.kind.id}-note`), running === null ? "" : this.kind.now(running));
  }

  // Reads out the measured point nearest to the pointer; `y` is null where only the abscissa counts.
  #hover(x, y) {
    this.hovered = x !== null;
    if (x === null) return this.#note();
    const share = (value, [from, to], isLog) => (isLog ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from));
    const at = (px, py) => [share(px, this.ranges.x, false), y === null ? 0 : share(py, this.ranges.y, this.kind.isLog)];
    const [left, top] = at(x, y);
    let nearest = null;
    for (const { curve, points, places } of this.curves ?? []) {
      places.forEach(([px, py], i) => {
        const [own, height] = at(px, py);
        const distance = Math.hypot(own - left, height - top);
        if (nearest === null || distance < nearest.distance) nearest = { distance, curve, point: points[i] };
      });
    }
    if (nearest === null) return this.#note();
    const { curve, point } = nearest;
    put($(`${this.kind.id}-note`), `${this.#name(curve)}: ${this.kind.read(point)}, ${point.steadiness}`);
  }

  #name(curve) {
    const several = this.curves.some((one) => one.curve.experiment !== this.curves[0].curve.experiment);
    return several ? `${curve.set_up} · ${curve.experiment}` : curve.set_up || "points";
  }

  #legend() {
    const items = this.curves.map(({ curve, tone, dash }) => {
      const item = document.createElement("li");
      item.title = curve.about;
      const name = document.createElement("span");
      name.textContent = this.#name(curve);
      const number = document.createElement("small");
      const total = curve.points.size;
      number.textContent = total > 0 ? `${total} point${total > 1 ? "s" : ""}` : curve.predicted.length > 0 ? "predicted" : "no point yet";
      item.append(swatch(curve, tone, dash), name, number);
      return item;
    });
    const keys = [
      ["dotted: predicted", svg("line", { x1: 1, y1: 7, x2: 29, y2: 7, "stroke-dasharray": "2 3", "stroke-width": 1.2 }), "grey"],
      ["hollow: not steady", svg("circle", { cx: 15, cy: 7, r: 4, fill: "none", "stroke-width": 2 }), "grey"],
      ["now (lock-in)", svg("circle", { cx: 15, cy: 7, r: 5.5, fill: "none", "stroke-width": 2.5 }), "curve-5"],
    ];
    for (const [word, shape, tone] of keys) {
      const item = document.createElement("li");
      item.className = "key";
      const picture = svg("svg", { width: 30, height: 14, "aria-hidden": "true", class: `tint ${tone}` });
      picture.append(shape);
      item.append(picture, word);
      items.push(item);
    }
    $(`${this.kind.id}-legend`).replaceChildren(...items);
  }
}

function svg(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries({ stroke: "currentColor", ...attributes })) element.setAttribute(key, value);
  return element;
}

function swatch(curve, tone, dash) {
  const picture = svg("svg", { width: 30, height: 14, "aria-hidden": "true", class: `tint ${tone}` });
  const points = outline(curve.index).map(([x, y]) => `${15 + x * 0.85},${7 + y * 0.85}`).join(" ");
  picture.append(
    svg("line", { x1: 1, y1: 7, x2: 29, y2: 7, "stroke-width": 2, "stroke-dasharray": dash.join(" ") || "none" }),
    svg("polygon", { points, fill: "currentColor" }),
  );
  return picture;
}
