// What the page knows of the rig: filled by messages, read by the panels. Everything has a bound.

import * as check from "./messages.js";
import { Ring, append } from "./ring.js";

const ROWS = 1 << 16;
const SLOW = 1 << 12;
const MAX = { points: 20000, transients: 200, impacts: 4000, section: 2000, spectra: 60, log: 1000, curves: 256, perCurve: 5000 };

export class Model {
  constructor() {
    this.ignored = 0;
    this.source = null;
    this.state = null;
    this.rows = new Ring(ROWS, ["x", "z", "x_velocity", "wall_low", "wall_high"]);
    this.slow = new Ring(SLOW, ["twin_residual_m", "spring_force_n", "spring_target_n", "wall_low_n", "wall_high_n"]);
    this.forget();
    this.curves = [];
    this.log = [];
    this.transients = [];
    // Counts changes, so that a panel can tell whether it has to draw again.
    this.changes = { points: 0, log: 0, transients: 0 };
  }

  forget() {
    this.rows.clear();
    this.slow.clear();
    this.impacts = [];
    this.section = [];
    this.spectra = [];
  }

  ignore = () => {
    this.ignored += 1;
  };

  // Takes in a snapshot or a frame. Returns whether it was understood.
  take(message) {
    if (message.kind === "snapshot") this.#snapshot(message);
    else if (message.kind !== "frame") return false;
    else if (message.restart === true) this.forget();
    this.#add(message);
    return true;
  }

  #snapshot(message) {
    const source = check.isObject(message.source) ? message.source : {};
    this.forget();
    this.source = {
      version: check.text(message.version, 120),
      kind: check.text(source.kind, 20),
      name: check.text(source.name, 200),
      rig: check.text(source.rig, 200),
      board: check.text(source.board, 120),
      folder: check.text(source.folder, 300),
      can_control: message.can_control === true,
      can_inject: message.can_inject === true,
      is_replay: message.is_replay === true,
      where_to_stop: check.text(message.where_to_stop),
      signals: new Set(check.entries(message.signals, 200, check.signalOf, this.ignore)),
    };
    this.curves = [];
    for (const curve of check.entries(message.curves, MAX.curves, check.curveOf, this.ignore)) {
      this.#curve(curve.set_up, curve.experiment, curve);
    }
    this.log = [];
    this.transients = [];
    this.changes.points += 1;
    this.changes.log += 1;
    this.changes.transients += 1;
  }

  #add(message) {
    const read = (name, one) => check.entries(message[name], MAX[name], one, this.ignore);
    for (const name of ["rows", "slow"]) {
      const part = message[name];
      if (part !== undefined && part !== null && !append(this[name], part)) this.ignore();
    }
    const points = read("points", check.pointOf);
    for (const point of points) {
      const curve = this.#curve(point.set_up, point.experiment);
      if (curve !== undefined && curve.points.size < MAX.perCurve) curve.points.set(point.key, point);
    }
    this.changes.points += points.length;
    for (const [name, one] of [["impacts", check.impactOf], ["section", check.sectionOf], ["spectra", check.spectrumOf]]) {
      this[name].push(...read(name, one));
      this[name].splice(0, this[name].length - MAX[name]);
    }
    for (const [name, one] of [["log", check.logOf], ["transients", check.transientOf]]) {
      const fresh = read(name, one);
      this[name].push(...fresh);
      // What was wrong is kept longest.
      while (this[name].length > MAX[name]) this[name].splice(Math.max(0, this[name].findIndex((e) => e.level === "info")), 1);
      this.changes[name] += fresh.length;
    }
    const state = check.stateOf(message.state);
    if (state !== null) this.state = state;
    else this.ignore();
  }

  // The curve of a set-up and an experiment, made when it is new. Set-ups keep their order, which gives their colour.
  #curve(setUp, experiment, { about, draws, is_in_order, predicted } = { about: "", draws: "response", is_in_order: false, predicted: [] }) {
    let curve = this.curves.find((c) => c.set_up === setUp && c.experiment === experiment);
    if (curve === undefined) {
      if (this.curves.length >= MAX.curves) return undefined;
      const known = [...new Set(this.curves.map((c) => c.set_up))];
      const index = known.includes(setUp) ? known.indexOf(setUp) : known.length;
      const nth = this.curves.filter((c) => c.set_up === setUp && c.draws === draws).length;
      curve = { set_up: setUp, about, experiment, draws, is_in_order, index, nth, points: new Map(), predicted };
      this.curves.push(curve);
    }
    return curve;
  }
}
