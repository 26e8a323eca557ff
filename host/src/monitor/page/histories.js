// Time histories of x and z with impact marks: window, pause, zoom by drag and by keys.

import { around, calmRange } from "./axis.js";
import { extremes, spread } from "./decimate.js";
import { Plot } from "./plot.js";
import { put, significant } from "./text.js";

const SHORTEST_S = 0.02;
const $ = (id) => document.getElementById(id);

export class Histories {
  constructor(model, onChange) {
    this.model = model;
    this.onChange = onChange;
    this.span = 5;
    this.zoom = null;
    // A copy of the samples while the plots are paused, and the state then.
    this.held = null;
    this.view = [0, this.span];
    this.ranges = { x: [-1, 1], z: [-1, 1] };
    // Largest |x| and |z| shown, in mm.
    this.largest = { x: NaN, z: NaN };
    this.calm = { x: calmRange(1e-3), z: calmRange(1e-3) };
    const onSelect = (from, to) => this.#zoomTo(from, to);
    const common = { x: () => this.view, onSelect };
    this.plots = {
      x: new Plot($("plot-x"), {
        ...common, xLabel: "", yLabel: "x (mm)", y: () => this.ranges.x, hasXLabels: false,
        series: [{ colour: "curve-0" }], before: (pen) => this.#overlay(pen, "x"),
      }),
      z: new Plot($("plot-z"), {
        ...common, xLabel: "Time (s)", yLabel: "z (mm)", y: () => this.ranges.z,
        series: [{ colour: "curve-6" }], before: (pen) => this.#overlay(pen, "z"),
      }),
    };
    this.#listen();
  }

  get isPaused() {
    return this.held !== null;
  }

  // Milliseconds between drawings: a long window moves slowly.
  get every() {
    return this.span > 5 ? 100 : 50;
  }

  draw() {
    const rows = this.held?.rows ?? this.model.rows;
    const end = rows.length > 0 ? rows.last : this.span;
    this.view = this.zoom ?? [end - this.span, end];
    const { t, series, perColumn } = extremes(rows, ["x", "z"], this.view[0], this.view[1], this.plots.x.columns);
    ["x", "z"].forEach((name, i) => {
      const values = series[i];
      for (let n = 0; n < values.length; n += 1) if (values[n] !== null) values[n] *= 1e3;
      const [low, high] = spread([values]);
      this.largest[name] = low <= high ? Math.max(-low, high) : NaN;
      if (this.zoom !== null) this.ranges[name] = around([low, high]);
      else this.ranges[name] = low <= high ? this.calm[name](low, high) : this.ranges[name];
      this.plots[name].draw([t, values]);
    });
    put($("histories-note"), this.#note(perColumn));
  }

  #note(perColumn) {
    const parts = [];
    if (this.isPaused) parts.push(this.zoom ? "Zoomed, plots paused" : "Plots paused");
    const { speed } = this.model.state ?? {};
    if (speed !== null && speed > 1 && this.model.rows.length > 0) {
      parts.push(`${significant(speed, 3)}× real time: extremes of the samples, the newest 0.2 s complete`);
    } else if (perColumn > 1) {
      parts.push(`Extremes of ${perColumn} samples per column`);
    } else {
      parts.push("Every sample");
    }
    const impacts = this.#impacts().length;
    if (impacts > 0) parts.push(`▲▼ ${impacts} impacts, at the wall's side`);
    return parts.join(" · ");
  }

  #impacts() {
    const impacts = this.held?.impacts ?? this.model.impacts;
    return impacts.filter((impact) => impact.t_s >= this.view[0] && impact.t_s <= this.view[1]);
  }

  #marks(pen) {
    const impacts = this.#impacts();
    // More marks than this would be a solid band.
    const step = Math.ceil(impacts.length / 400);
    for (let i = 0; i < impacts.length; i += step) pen.edge(impacts[i].t_s, impacts[i].side, "curve-5");
  }

  #overlay(pen, name) {
    if (name === "x") this.#marks(pen);
    const limit = this.model.state?.limits[`${name}_m`] ?? null;
    if (limit !== null) pen.limits(limit * 1e3, this.largest[name], "mm", name === "x" ? 1 : 2);
  }

  pause(isPaused) {
    if (isPaused === this.isPaused) return;
    this.held = isPaused ? { rows: this.model.rows.copy(), impacts: [...this.model.impacts], state: this.model.state } : null;
    if (!isPaused) this.zoom = null;
    this.#changed();
  }

  choose(span) {
    this.span = span;
    this.zoom = null;
    this.#changed();
  }

  // Another rig time begins.
  restart() {
    if (this.isPaused && this.model.source?.is_replay) this.pause(false);
  }

  #zoomTo(from, to) {
    if (!(to - from >= SHORTEST_S)) {
      const middle = (from + to) / 2;
      [from, to] = [middle - SHORTEST_S / 2, middle + SHORTEST_S / 2];
    }
    if (to - from > 120) return;
    this.pause(true);
    this.zoom = [from, to];
    this.#changed();
  }

  #scale(factor) {
    const [from, to] = this.view;
    const middle = this.zoom === null ? to - ((to - from) * factor) / 2 : (from + to) / 2;
    const half = ((to - from) * factor) / 2;
    this.#zoomTo(middle - half, middle + half);
  }

  #move(share) {
    const [from, to] = this.view;
    const by = share * (to - from);
    this.#zoomTo(from + by, to + by);
  }

  #changed() {
    $("pause").setAttribute("aria-pressed", String(this.isPaused));
    put($("pause"), this.isPaused ? "Go on" : "Pause plots");
    for (const button of $("windows").children) {
      button.setAttribute("aria-pressed", String(this.zoom === null && Number(button.dataset.span) === this.span));
    }
    this.onChange();
  }

  #listen() {
    $("pause").addEventListener("click", () => this.pause(!this.isPaused));
    $("zoom-in").addEventListener("click", () => this.#scale(0.5));
    $("zoom-out").addEventListener("click", () => this.#scale(2));
    $("zoom-reset").addEventListener("click", () => this.pause(false));
    for (const button of $("windows").children) {
      button.addEventListener("click", () => this.choose(Number(button.dataset.span)));
    }
    const keys = {
      "+": () => this.#scale(0.5), "=": () => this.#scale(0.5), "-": () => this.#scale(2),
      ArrowLeft: () => this.#move(-0.2), ArrowRight: () => this.#move(0.2),
      0: () => this.pause(false), Home: () => this.pause(false), Escape: () => this.pause(false),
    };
    $("histories").addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || !Object.hasOwn(keys, event.key)) return;
      event.preventDefault();
      keys[event.key]();
    });
  }
}
