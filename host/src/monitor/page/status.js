// Header, state strip, big numbers, link counters, alarms and log.

import { count, degrees, duration, fixed, millimetres, put, significant } from "./text.js";

const $ = (id) => document.getElementById(id);

const WORDS = {
  running: ["Running", "good"], held: ["Held", "warn"], paused: ["Paused", "warn"], waiting: ["Waiting", "warn"],
  stopping: ["Stopping", "warn"], idle: ["Idle", "quiet"], faulted: ["Fault", "bad"], lost: ["Link lost", "bad"],
  over: ["Ended", "quiet"], replay: ["Replay", "quiet"], unknown: ["Unknown", "quiet"],
};
const SOURCES = { run: "run", rig: "rig", folder: "following a run folder", replay: "replay of a run" };
// damprig sends at least one message a second.
const STALE_MS = 3000;
// From this age on a sample is not shown as one of now; a folder is read up to a second behind, as it is written.
const OLD_S = 1;
const OLD_IN_FOLDER_S = 4;

export function source({ source: s }) {
  put($("name"), s.name || "damprig");
  const rig = s.rig && s.rig !== s.name ? `rig ${s.rig}` : "";
  const parts = [SOURCES[s.kind] ?? s.kind, rig, s.board && s.board !== s.rig ? `board ${s.board}` : "", s.folder];
  put($("where"), parts.filter((part) => part !== "").join(" · "));
  put($("version"), s.version);
  document.title = `${s.name || "damprig"} – damprig monitor`;
}

// The strip under the header. `connection` is {isOpen, retryAt, heardAt}; times of performance.now().
export function strip(model, connection, now) {
  const isStale = connection.isOpen && now - connection.heardAt > STALE_MS;
  const state = model.state;
  lamp(connection, isStale, now, state);
  const age = oldAge(model, connection, now);
  document.body.classList.toggle("stale", model.source !== null && (!connection.isOpen || age !== null));
  $("age").hidden = age === null;
  put($("age"), age === null ? "" : state.replay ? `Nothing recorded for ${duration(age)}` : `Newest sample ${duration(age)} old`);
  // Also what came just before the connection closed.
  if (state !== null) progress(state);
  if (!connection.isOpen) {
    const retry = connection.retryAt === null ? 0 : Math.max(0, Math.ceil((connection.retryAt - now) / 1000));
    const again = retry > 0 ? `Trying again in ${retry} s.` : "Trying again now.";
    const isFirst = model.source === null;
    if (state !== null && state.fault !== null) {
      // The last fault stays in sight, and how the run goes on.
      const about = connection.hasEnded ? `damprig has ended. ${state.fault.advice}`
        : `The connection to damprig was lost after this fault. ${again}`;
      set("bad", connection.hasEnded ? "Ended" : "Offline", state.fault.what, about);
      announce(`Fault. ${state.fault.what} ${about}`);
      return;
    }
    if (connection.hasEnded && state !== null) {
      set("quiet", "Ended", state.headline, "damprig has ended. The page shows what it told last.");
      announce(`${state.headline} damprig has ended.`);
      return;
    }
    set("bad", "Offline", isFirst ? "damprig cannot be reached." : "The connection to damprig was lost.",
      isFirst ? again : `${again} The numbers below are the last ones received.`);
    announce(isFirst ? "" : "The connection to damprig was lost.");
    return;
  }
  if (state === null) return;
  if (isStale) {
    const silent = Math.floor((now - connection.heardAt) / 1000);
    set("bad", "No data", `Nothing was received for ${silent} s.`, "The numbers below are the last ones received.");
    return;
  }
  const [word, tone] = WORDS[state.activity];
  if (state.fault !== null) {
    set("bad", state.activity === "lost" ? "Link lost" : "Fault", state.fault.what, state.fault.advice);
    announce(`Fault. ${state.fault.what} ${state.fault.advice}`);
  } else if (state.alarms.length > 0) {
    const more = state.alarms.length > 1 ? ` (${state.alarms.length - 1} more below)` : "";
    set(tone === "bad" ? "bad" : "warn", word, state.headline, `Alarm: ${state.alarms[0]}${more}`);
    announce(`Alarm. ${state.alarms[0]}`);
  } else {
    const known = model.curves.find((curve) => curve.set_up === state.set_up);
    const about = known?.about || (state.experiment === "" ? "" : `Experiment ${state.experiment}`);
    set(tone, word, state.headline, state.injected.length > 0 ? `Practice: ${state.injected.join(", ")}.` : about);
    announce("");
  }
}

// Age of the newest sample in s, rounded down, when it is too old to be one of now.
function oldAge({ source, state }, connection, now) {
  if (source === null || state === null || state.age_s === null) return null;
  const age = state.age_s + (state.replay ? 0 : (now - connection.heardAt) / 1000);
  return age > (source.kind === "folder" ? OLD_IN_FOLDER_S : OLD_S) ? Math.floor(age) : null;
}

function set(tone, word, headline, advice) {
  $("strip").dataset.tone = tone;
  put($("badge"), word);
  // The badge has the word already.
  const rest = headline.startsWith(`${word}: `) ? headline.slice(word.length + 2) : headline;
  put($("headline"), rest.charAt(0).toUpperCase() + rest.slice(1));
  put($("advice"), advice);
}

const announce = (text) => put($("announce"), text);

function lamp(connection, isStale, now, state) {
  const link = state?.link ?? null;
  let [tone, text] = ["good", link?.state || "connected"];
  if (!connection.isOpen) [tone, text] = ["bad", connection.heardAt === 0 ? "connecting" : "page disconnected"];
  else if (isStale) [tone, text] = ["bad", "no data"];
  else if (state !== null && state.activity === "lost") tone = "bad";
  $("lamp").dataset.tone = tone;
  put($("lamp-text"), text);
}

function progress(state) {
  const { points_taken: taken, points_planned: planned, left, rig_s, speed } = state;
  const hasPoints = planned > 0;
  $("progress").hidden = !hasPoints && rig_s === null;
  $("bar").hidden = !hasPoints;
  const parts = hasPoints ? [`${count(taken)} of ${count(planned)} points`] : [];
  if (left !== "") parts.push(left);
  put($("points"), parts.join(" · "));
  if (hasPoints) {
    $("bar").setAttribute("aria-valuemax", String(planned));
    $("bar").setAttribute("aria-valuenow", String(Math.min(taken ?? 0, planned)));
    $("bar-fill").style.width = `${Math.min(100, (100 * (taken ?? 0)) / planned)}%`;
  }
  const pace = speed === null ? "" : ` · ${significant(speed, 2)}×`;
  put($("rig-time"), rig_s === null ? "" : `rig time ${duration(rig_s)}${pace}`);
}

export function numbers({ state }) {
  const n = state.number;
  const [hz, ratio] = [n("frequency_hz"), n("x_over_z_lock_in")];
  put($("n-frequency"), hz > 0 ? fixed(hz, 3) : "–");
  put($("n-ratio"), fixed(ratio, ratio >= 100 ? 1 : 2));
  // Without a drive a sensor is aligned with the means; they have more decimals.
  const isStill = n("x_mean_m") !== null || n("z_mean_m") !== null || ["idle", "paused"].includes(state.activity);
  for (const [name, amplitude, mean, decimals] of [["x", n("x_amplitude_m"), n("x_mean_m"), 2], ["z", n("z_amplitude_m"), n("z_mean_m"), 3]]) {
    put($(`l-${name}`), isStill ? `${name}, mean of 1 s (mm)` : `${name.toUpperCase()} (mm)`);
    put($(`n-${name}`), isStill ? millimetres(mean, 3) : millimetres(amplitude, decimals));
    $(`n-${name}`).classList.toggle("mean", isStill);
  }
  put($("n-phase"), fixed(degrees(n("x_phase_rad")), 1));
  put($("n-impacts"), fixed(n("impacts_in_cycle"), 0));
  put($("n-residual"), millimetres(n("twin_residual_m"), 3));
  const [limit, largest] = [state.limits.x_m, n("max_abs_x_m")];
  const margin = limit === null || largest === null ? null : limit - largest;
  put($("n-margin"), millimetres(margin, 1));
  $("n-margin").dataset.tone = margin === null || margin > 0.1 * limit ? "quiet" : "bad";
  point(state, n);
}

// The stage of the present point with what is left of it, and how much X/Z moves.
function point({ activity, stage }, n) {
  const dwells = n("dwells");
  const words = activity === "held" ? "held" : stage === "measuring" && dwells > 1 ? `dwell ${dwells}` : stage || "point";
  put($("l-left"), `${words.charAt(0).toUpperCase()}${words.slice(1)} (s left)`);
  put($("n-left"), n("stage_left_s") > 0 ? fixed(n("stage_left_s"), 1) : "–");
  const spread = n("x_over_z_spread");
  put($("n-spread"), spread === null ? "–" : fixed(100 * spread, spread < 0.1 ? 2 : 0));
}

let linkRows = null;

export function link(model) {
  const { link: l } = model.state;
  const values = [
    ["Link", [l.name, l.state].filter((part) => part !== "").join(", ") || "–"],
    ["Rows received", count(l.rows)],
    ["Rows lost on the way", count(l.lost_rows)],
    ["Rows dropped by the device", count(l.dropped_rows)],
    ["Damaged messages of the link", count(l.bad_frames)],
    ["Interruptions", count(l.interruptions)],
    ["Viewers", count(l.viewers)],
    ["Messages that viewers skipped", count(l.skipped_frames)],
    ["Messages this page ignored", count(model.ignored)],
  ];
  if (linkRows === null) {
    linkRows = values.map(([name]) => {
      const [term, value] = [document.createElement("dt"), document.createElement("dd")];
      term.textContent = name;
      $("link").append(term, value);
      return value;
    });
    linkRows.at(-1).id = "ignored";
  }
  const isOdd = [false, false, l.lost_rows > 0, l.dropped_rows > 0, l.bad_frames > 0, l.interruptions > 0, false, l.skipped_frames > 0,
    model.ignored > 0];
  values.forEach(([, text], i) => {
    put(linkRows[i], text);
    linkRows[i].classList.toggle("odd", isOdd[i]);
  });
}

// Saving the log saves all of it.
const SHOWN_ENTRIES = 300;
const drawn = { log: -1, transients: -1, alarms: null };

export function log(model) {
  const { alarms, fault } = model.state;
  const words = [...(fault === null ? [] : [fault.what]), ...alarms];
  if (drawn.alarms !== words.join("\n")) {
    drawn.alarms = words.join("\n");
    const level = (i) => (i === 0 && fault !== null ? "fault" : "warning");
    const items = words.map((one, i) => item([["span", one]], level(i)));
    $("alarms").replaceChildren(...(items.length > 0 ? items : [item([["span", "No alarm."]], "info")]));
    put($("log-note"), words.length === 0 ? "" : words.length === 1 ? "1 alarm" : `${words.length} alarms`);
  }
  const only = $("log-only").value;
  if (drawn.log !== model.changes.log || drawn.only !== only) {
    [drawn.log, drawn.only] = [model.changes.log, only];
    const isShown = ({ level }) => only === "" || level === only || (only === "trouble" && (level === "warning" || level === "fault"));
    const entries = model.log.filter(isShown).slice(-SHOWN_ENTRIES).reverse();
    $("log").replaceChildren(...entries.map((e) => item([["time", e.at], ["span", e.text]], e.level)));
  }
  if (drawn.transients !== model.changes.transients) {
    drawn.transients = model.changes.transients;
    const entries = [...model.transients].reverse();
    $("transients").replaceChildren(
      ...entries.map((e) => item([["b", `${e.set_up} · ${e.experiment}`], ["span", e.text]], "info")),
    );
  }
}

const LEVELS = { warning: "Warning: ", fault: "Fault: ", action: "Action: " };

function item(parts, level) {
  const element = document.createElement("li");
  element.dataset.level = level;
  for (const [name, text] of parts) {
    const child = document.createElement(name);
    child.textContent = name === "span" && parts.length > 1 ? (LEVELS[level] ?? "") + text : text;
    element.append(child);
  }
  return element;
}
