// The monitor page: connects, fills the model, draws the panels at most 20 times a second and never while the tab is hidden.

import { Connection, takeToken } from "./connection.js";
import { Controls } from "./controls.js";
import { Curves, KINDS } from "./curves.js";
import { Histories } from "./histories.js";
import { Large } from "./large.js";
import { Model } from "./model.js";
import { PhasePlane } from "./phase.js";
import * as save from "./save.js";
import { Impacts, Spring, Twin } from "./slow_plots.js";
import { SpectrumPanel } from "./spectrum.js";
import * as status from "./status.js";
import * as theme from "./theme.js";

const FASTEST_MS = 50;
const TEXT_MS = 200;
const CALM_MS = 500;

const $ = (id) => document.getElementById(id);
const model = new Model();
const link = { isOpen: false, retryAt: null, heardAt: 0 };
const wantsCalm = matchMedia("(prefers-reduced-motion: reduce)");
theme.start($("theme"));

const histories = new Histories(model, () => drawAll());
const panels = [
  { id: "panel-histories", view: histories },
  ...Object.entries(KINDS).map(([draws, { id }]) => ({ id: `panel-${id}`, view: new Curves(model, draws), hasData: Curves.hasData(draws) })),
  { id: "panel-phase", view: new PhasePlane(model) },
  { id: "panel-spectrum", view: new SpectrumPanel(model), hasData: SpectrumPanel.hasData },
  { id: "panel-impacts", view: new Impacts(model), hasData: Impacts.hasData },
  { id: "panel-twin", view: new Twin(model), hasData: Twin.hasData },
  { id: "panel-spring", view: new Spring(model), hasData: Spring.hasData },
].map((panel) => ({ ...panel, element: $(panel.id), due: 0, isSeen: true, isDirty: true }));
const folding = [...panels, { element: $("panel-transients"), hasData: (m) => m.transients.length > 0 }].filter((p) => p.hasData);

// A panel without data for this source is folded away. One that gets data later opens behind the others, so that nothing moves.
let known = "";

function fold() {
  const { kind, name, rig } = model.source;
  const isNew = known !== `${kind}\n${name}\n${rig}`;
  known = `${kind}\n${name}\n${rig}`;
  for (const { element, hasData } of folding) {
    if (isNew) {
      element.hidden = !hasData(model);
      element.classList.remove("late");
    } else if (element.hidden && hasData(model)) {
      element.hidden = false;
      element.classList.add("late");
    }
  }
}

function take(message) {
  link.heardAt = performance.now();
  if (!model.take(message)) return model.ignore();
  if (model.source === null || model.state === null) return undefined;
  fold();
  if (message.kind === "snapshot") {
    status.source(model);
    controls.allow();
    $("main").hidden = false;
  }
  if (message.kind === "snapshot" || message.restart === true) histories.restart();
  for (const panel of panels) panel.isDirty = true;
  isTextDirty = true;
  return schedule();
}

let isScheduled = false;
let drawnAt = 0;
let textDue = 0;
let isTextDirty = false;

function schedule() {
  if (isScheduled || document.hidden) return;
  isScheduled = true;
  setTimeout(() => requestAnimationFrame(draw), Math.max(0, FASTEST_MS - (performance.now() - drawnAt)));
}

function drawAll() {
  for (const panel of panels) {
    panel.due = 0;
    panel.isDirty = true;
  }
  textDue = 0;
  isTextDirty = true;
  schedule();
}

function draw() {
  isScheduled = false;
  if (document.hidden || model.state === null || model.source === null) return;
  const now = performance.now();
  drawnAt = now;
  let isLeft = false;
  for (const panel of panels) {
    if (!panel.isDirty || panel.element.hidden || !panel.isSeen || panel.due === Infinity) continue;
    if (now < panel.due) {
      isLeft = true;
      continue;
    }
    const every = wantsCalm.matches ? CALM_MS : panel.view.every;
    panel.due = histories.isPaused ? Infinity : now + every - 5;
    panel.isDirty = false;
    panel.view.draw();
  }
  if (isTextDirty && now >= textDue) {
    textDue = now + TEXT_MS - 5;
    isTextDirty = false;
    text(now);
  }
  if (isLeft || isTextDirty) schedule();
}

function text(now) {
  status.strip(model, link, now);
  if (model.state === null || model.source === null) return;
  status.numbers(model);
  status.link(model);
  status.log(model);
  controls.draw();
}

const observer = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    const panel = panels.find((p) => p.element === entry.target);
    panel.isSeen = entry.isIntersecting;
    panel.isDirty = true;
    panel.due = 0;
  }
  schedule();
}, { rootMargin: "100px" });
for (const panel of panels) observer.observe(panel.element);

document.addEventListener("visibilitychange", drawAll);

// Ages of messages and the time to the next attempt, also while nothing arrives.
setInterval(() => document.hidden || status.strip(model, link, performance.now()), 200);

const connection = new Connection(takeToken(), {
  message: take,
  damaged: model.ignore,
  state: (state) => {
    Object.assign(link, state);
    if (state.isOpen) link.heardAt = performance.now();
    status.strip(model, link, performance.now());
  },
});
const controls = new Controls(model, connection);
const large = new Large($("large"), drawAll);
save.addButtons(model, () => histories.held?.state ?? model.state);
$("log-save").addEventListener("click", () => model.state !== null && save.log(model));
$("log-only").addEventListener("change", drawAll);

const help = $("help");
$("help-open").addEventListener("click", () => help.showModal());

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || help.open) return;
  const target = event.target instanceof Element ? event.target : document.body;
  if (target.closest("input, select, textarea")) return;
  if (event.key === " ") {
    if (target.closest("button, summary, a")) return;
    event.preventDefault();
    histories.pause(!histories.isPaused);
  } else if (event.key === "?") {
    help.showModal();
  } else if (event.key === "s" || event.key === "S") {
    event.preventDefault();
    controls.focusStop();
  } else if (event.key === "l" || event.key === "L") {
    large.toggle();
  } else if (["1", "2", "3", "4"].includes(event.key)) {
    histories.choose([2, 5, 20, 60][Number(event.key) - 1]);
  }
});
