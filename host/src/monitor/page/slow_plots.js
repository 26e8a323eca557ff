// Panels of the controller's numbers over the last minute: walls with impacts, twin, friction spring.

import { extremes, spread } from "./decimate.js";
import { roundStep } from "./axis.js";
import { Plot } from "./plot.js";
import { count, fixed, millimetres, put } from "./text.js";

const $ = (id) => document.getElementById(id);
const SPAN_S = 60;

// The last minute of rig time, longer when the rig runs faster than real time.
function lastMinute(model) {
  const span = SPAN_S * Math.max(1, model.state?.speed ?? 1);
  const end = Math.max(model.slow.last, model.rows.last);
  return Number.isFinite(end) ? [end - span, end] : [0, span];
}

// A range from 0 with a round end; it shrinks only below half.
function risingRange(least) {
  let top = 0;
  return (high) => {
    const need = Math.max(least, high * 1.1);
    if (need > top || need < 0.4 * top) top = Math.ceil(need / roundStep(need / 5) - 1e-9) * roundStep(need / 5);
    return [0, top];
  };
}

const scaled = (values, factor) => values.map((value) => (value === null ? null : value * factor));

export class Impacts {
  every = 200;

  constructor(model) {
    this.model = model;
    this.view = [0, SPAN_S];
    this.range = [-1, 1];
    this.top = risingRange(1);
    this.plot = new Plot($("plot-impacts"), {
      xLabel: "Time (s)", yLabel: "Wall force (N)", x: () => this.view, y: () => this.range,
      series: [{ colour: "grey", width: 1 }, { colour: "grey", width: 1 }],
      behind: (pen) => pen.level(0, "ink", { alpha: 0.7 }), before: (pen) => this.#stems(pen),
    });
  }

  static hasData({ source, state, impacts }) {
    const { number, limits } = state;
    return impacts.length > 0 || number("impacts") > 0 || limits.clearance_m !== null || number("wall_low_n") !== null
      || number("wall_high_n") !== null || source.signals.has("wall_low") || source.signals.has("wall_high");
  }

  draw() {
    const { model } = this;
    // The last 10 s, at the times of the samples: impacts come several a second.
    const to = model.rows.length > 0 ? model.rows.last : lastMinute(model)[1];
    this.view = [to - (SPAN_S / 6) * Math.max(1, model.state.speed ?? 1), to];
    const isFast = !Number.isNaN(model.rows.columns.wall_high[model.rows.length - 1] ?? NaN);
    const ring = isFast || model.rows.length > 0 ? model.rows : model.slow;
    const names = ring === model.rows ? ["wall_low", "wall_high"] : ["wall_low_n", "wall_high_n"];
    const { t, series } = extremes(ring, names, ...this.view, this.plot.columns);
    series[0] = scaled(series[0], -1);
    const peaks = this.#shown().map((impact) => impact.peak_n ?? 0);
    const [low, high] = spread(series);
    const limit = model.state?.limits.wall_force_n ?? null;
    this.largest = Math.max(0, ...peaks, high, -low);
    // The limit is at its place once the forces come near it.
    const top = this.top(limit !== null && this.largest > 0.25 * limit ? Math.max(this.largest, limit) : this.largest)[1];
    this.range = [-top, top];
    this.plot.draw([t, ...series]);
    put($("impacts-note"), this.#last());
    const total = model.state.number("impacts");
    put($("impacts-count"), total === null ? "" : `${count(total)} impacts in this experiment.`);
  }

  #shown() {
    return this.model.impacts.filter((impact) => impact.t_s >= this.view[0] && impact.t_s <= this.view[1]).slice(-800);
  }

  #last() {
    const last = this.model.impacts.at(-1);
    if (last === undefined) return "";
    return `last: ${last.side > 0 ? "+d" : "−d"}, ${fixed(last.peak_n, 0)} N`;
  }

  #stems(pen) {
    for (const { t_s, side, peak_n } of this.#shown()) {
      if (peak_n === null) pen.edge(t_s, side, "curve-5");
      else {
        pen.path([[t_s, 0], [t_s, side * peak_n]], "curve-5", { width: 1.2 });
        pen.dot(t_s, side * peak_n, 2.6, "curve-5");
      }
    }
    const limit = this.model.state?.limits.wall_force_n ?? null;
    if (limit !== null) pen.limits(limit, this.largest, "N", 0, 2);
    const { left, top, height } = pen.u.bbox;
    pen.text("wall at +d", left + 6 * pen.scale, top + 18 * pen.scale, "grey");
    pen.text("wall at −d", left + 6 * pen.scale, top + height - 5 * pen.scale, "grey");
  }
}

export class Twin {
  every = 250;

  constructor(model) {
    this.model = model;
    this.view = [0, SPAN_S];
    this.range = [0, 1];
    this.top = risingRange(1e-3);
    this.plot = new Plot($("plot-twin"), {
      xLabel: "Time (s)", yLabel: "Residual of x, RMS (mm)", x: () => this.view, y: () => this.range,
      series: [{ colour: "curve-3", width: 1.6 }],
    });
  }

  static hasData({ state, slow }) {
    return state.number("twin_residual_m") !== null || slow.newest("twin_residual_m") !== null;
  }

  draw() {
    const { model } = this;
    this.view = lastMinute(model);
    const { t, series } = extremes(model.slow, ["twin_residual_m"], ...this.view, this.plot.columns);
    series[0] = scaled(series[0], 1e3);
    this.range = this.top(Math.max(0, spread(series)[1]));
    this.plot.draw([t, ...series]);
    const { state } = model;
    const { number } = state;
    put($("twin-note"), `now ${millimetres(number("twin_residual_m"), 3)} mm`);
    const counts = `Impacts: ${count(number("twin_predicted"))} predicted, ${count(number("twin_detected"))} measured, `
      + `${count(number("twin_missing"))} missing`;
    put($("twin-alarm"), state.twin_alarm ? `Alarm: impacts are missing. ${counts}.` : `${counts}.`);
    $("twin-alarm").dataset.tone = state.twin_alarm ? "bad" : "quiet";
  }
}

export class Spring {
  every = 250;

  constructor(model) {
    this.model = model;
    this.view = [0, SPAN_S];
    this.range = [0, 1];
    this.top = risingRange(0.5);
    this.plot = new Plot($("plot-spring"), {
      xLabel: "Time (s)", yLabel: "Spring force (N)", x: () => this.view, y: () => this.range,
      series: [{ colour: "curve-3", width: 1.8 }, { colour: "grey", width: 1.4, dash: [6, 4], isStepped: true }],
    });
  }

  static hasData({ state, slow }) {
    return state.number("spring_force_n") !== null || state.spring_stage !== "" || slow.newest("spring_force_n") !== null;
  }

  draw() {
    const { model } = this;
    this.view = lastMinute(model);
    const { t, series } = extremes(model.slow, ["spring_force_n", "spring_target_n"], ...this.view, this.plot.columns);
    const [low, high] = spread(series);
    const [, top] = this.top(Math.max(0, high));
    this.range = [low < -0.02 * top ? -0.2 * top : 0, top];
    this.plot.draw([t, ...series]);
    const { state } = model;
    const { number } = state;
    const target = number("spring_target_n") > 0 ? ` of ${fixed(number("spring_target_n"), 2)} N` : "";
    const stage = state.spring_stage === "" ? "" : ` · ${state.spring_stage}`;
    const position = number("spring_position_m") === null ? "" : ` · ${millimetres(number("spring_position_m"), 2)} mm`;
    put($("spring-note"), `${fixed(number("spring_force_n"), 2)} N${target}${stage}${position}`);
  }
}
