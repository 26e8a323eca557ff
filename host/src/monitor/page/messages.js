// Checks the parts of the server's messages. What has the wrong type becomes null, "" or an empty list; nothing is trusted.

import { shown } from "./text.js";

export const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
export const number = (value) => (typeof value === "number" && Number.isFinite(value) ? value : null);
export const text = (value, most) => (typeof value === "string" ? shown(value, most) : "");
const list = (value) => (Array.isArray(value) ? value : []);
const part = (value) => (isObject(value) ? value : {});

// Parses a message; null if it is not an object with a kind.
export function parse(data) {
  if (typeof data !== "string") return null;
  try {
    const message = JSON.parse(data);
    return isObject(message) && typeof message.kind === "string" ? message : null;
  } catch {
    return null;
  }
}

// A list of checked entries; `check` returns null for an invalid one, which `onInvalid` counts. Only the last `most` are kept.
export function entries(value, most, check, onInvalid) {
  if (value === undefined || value === null) return [];
  if (!Array.isArray(value)) {
    onInvalid();
    return [];
  }
  const checked = [];
  for (const entry of value.slice(-most)) {
    const result = check(entry);
    if (result === null) onInvalid();
    else checked.push(result);
  }
  return checked;
}

export function pointOf(raw) {
  if (!isObject(raw) || number(raw.frequency_hz) === null) return null;
  return {
    set_up: text(raw.set_up, 120),
    experiment: text(raw.experiment, 120),
    // Its place in the experiment: a point that is measured again replaces the earlier one.
    key: number(raw.index) ?? raw.frequency_hz,
    frequency_hz: raw.frequency_hz,
    x_m: number(raw.x_amplitude_m),
    z_m: number(raw.z_amplitude_m),
    phase_rad: number(raw.phase_rad),
    x_over_z: number(raw.x_over_z),
    x_over_z_lock_in: number(raw.x_over_z_lock_in),
    steadiness: text(raw.steadiness, 20),
  };
}

const DRAWS = ["response", "sheet", "backbone"];

export function curveOf(raw) {
  if (!isObject(raw)) return null;
  const isPair = (pair) => Array.isArray(pair) && number(pair[0]) !== null && number(pair[1]) !== null;
  const predicted = list(raw.predicted).slice(0, 4000).filter(isPair);
  const draws = DRAWS.includes(raw.draws) ? raw.draws : DRAWS[0];
  return {
    set_up: text(raw.set_up, 120), about: text(raw.about, 200), experiment: text(raw.experiment, 120),
    draws, is_in_order: raw.is_in_order === true, predicted,
  };
}

export function impactOf(raw) {
  if (!isObject(raw) || number(raw.t_s) === null || (raw.side !== 1 && raw.side !== -1)) return null;
  return { t_s: raw.t_s, side: raw.side, peak_n: number(raw.peak_n) };
}

export function sectionOf(raw) {
  // x, velocity, drive frequency.
  return Array.isArray(raw) && number(raw[0]) !== null && number(raw[1]) !== null ? [raw[0], raw[1], number(raw[2])] : null;
}

// A spectrum with its amplitudes in mm.
export function spectrumOf(raw) {
  if (!isObject(raw) || number(raw.t_s) === null || !(number(raw.step_hz) > 0)) return null;
  const lines = list(raw.amplitude_m).slice(0, 1024);
  return lines.length > 1 && lines.every((m) => number(m) !== null) ? { t_s: raw.t_s, step_hz: raw.step_hz, mm: lines.map((m) => m * 1e3) } : null;
}

export function logOf(raw) {
  if (!isObject(raw) || typeof raw.text !== "string") return null;
  const level = ["info", "warning", "fault", "action"].includes(raw.level) ? raw.level : "info";
  return { at: text(raw.at, 20), level, text: text(raw.text, 600) };
}

export function transientOf(raw) {
  if (!isObject(raw) || typeof raw.text !== "string") return null;
  return { set_up: text(raw.set_up, 120), experiment: text(raw.experiment, 120), text: text(raw.text, 600) };
}

export function signalOf(raw) {
  return isObject(raw) && typeof raw.name === "string" ? raw.name : null;
}

const ACTIVITIES = ["running", "held", "paused", "waiting", "stopping", "idle", "faulted", "lost", "over", "replay"];
const COUNTERS = ["rows", "lost_rows", "dropped_rows", "bad_frames", "interruptions", "viewers", "skipped_frames"];

const MAX_NUMBERS = 200;

const pick = (names, raw) => Object.fromEntries(names.map((name) => [name, number(raw[name])]));

// The controller's numbers by name, whatever they are: null for one that is not known.
function numbersOf(raw) {
  const known = new Map(Object.entries(raw).slice(0, MAX_NUMBERS).filter(([, value]) => number(value) !== null));
  return (name) => known.get(name) ?? null;
}

// The state with every key present.
export function stateOf(raw) {
  if (!isObject(raw)) return null;
  const numbers = part(raw.numbers);
  const limits = part(raw.limits);
  const link = part(raw.link);
  const replay = isObject(raw.replay) ? raw.replay : null;
  return {
    activity: ACTIVITIES.includes(raw.activity) ? raw.activity : "unknown",
    headline: text(raw.headline),
    set_up: text(raw.set_up, 120),
    experiment: text(raw.experiment, 120),
    points_taken: number(raw.points_taken),
    points_planned: number(raw.points_planned),
    rig_s: number(raw.rig_s),
    age_s: number(raw.age_s),
    left: isObject(raw.left) ? text(raw.left.text, 60) : "",
    speed: number(raw.speed),
    replay: replay && {
      t_s: number(replay.t_s) ?? 0,
      end_s: number(replay.end_s) ?? 0,
      speed: number(replay.speed) ?? 1,
      paused: replay.paused === true,
    },
    number: numbersOf(numbers),
    twin_alarm: numbers.twin_alarm === true,
    spring_stage: text(numbers.spring_stage, 80),
    stage: text(numbers.stage, 80),
    limits: pick(["x_m", "z_m", "wall_force_n", "clearance_m"], limits),
    link: { ...pick(COUNTERS, link), name: text(link.name, 200), state: text(link.state, 80) },
    fault: isObject(raw.fault) ? { what: text(raw.fault.what) || "Fault.", advice: text(raw.fault.advice) } : null,
    alarms: list(raw.alarms).slice(0, 20).filter((a) => typeof a === "string").map((a) => shown(a)),
    injected: list(raw.injected).slice(0, 20).filter((a) => typeof a === "string").map((a) => shown(a, 120)),
  };
}
