// Figures of a report: the values under the pointer, zoom by dragging, curves hidden in the legend. Without this script they are drawn whole.
// plot/traces.rs writes the elements and numbers that it needs.

import { around, figureTicks } from "./axis.js";
import { significant } from "./text.js";

const SVG = "http://www.w3.org/2000/svg";
const HINT = "Point at a curve for its values, drag to zoom, click on an entry of the legend to hide its curve.";
// Distances in points of the figure: shortest drag that zooms, farthest point of a curve that is read out.
const MIN_DRAG = 5;
const FARTHEST = 40;

function make(name, attributes, text = "") {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  return element;
}

// An axis: `range` is what it shows, `home` what was drawn; `low` and `high` are the places of their ends.
class Axis {
  constructor({ label, from, to, isLog }, low, high) {
    Object.assign(this, { label, isLog, low, high, home: [from, to], range: [from, to] });
  }

  #even = (value) => (this.isLog ? Math.log(value) : value);

  place(value, [from, to] = this.range) {
    const share = (this.#even(value) - this.#even(from)) / (this.#even(to) - this.#even(from));
    return this.low + share * (this.high - this.low);
  }

  value(place, [from, to] = this.range) {
    const even = this.#even(from) + ((place - this.low) / (this.high - this.low)) * (this.#even(to) - this.#even(from));
    return this.isLog ? Math.exp(even) : even;
  }

  // Where a place of the drawing is now.
  move = (place) => this.place(this.value(place, this.home));

  shows = (value) => value >= this.range[0] && value <= this.range[1];
}

const points = (element) => element.getAttribute("points").trim().split(/\s+/).map((pair) => pair.split(",").map(Number));
const translation = (element) => element.getAttribute("transform").match(/-?[\d.]+/g).map(Number);

// A frame with its curves.
class Frame {
  constructor(group, name) {
    const { bounds, x, y } = JSON.parse(group.dataset.axes);
    [this.left, this.top, this.right, this.bottom] = bounds;
    this.x = new Axis(x, this.left, this.right);
    this.y = new Axis(y, this.bottom, this.top);
    this.group = group;
    this.ticks = group.querySelector("[data-ticks]");
    this.drawnTicks = [...this.ticks.childNodes];
    this.font = { fill: "#222222", "font-size": this.ticks.querySelector("text")?.getAttribute("font-size") };
    const inside = [...group.querySelectorAll("[data-inside] > g")];
    this.parts = inside.map((part) => ({
      part,
      isUpright: part.dataset.upright !== undefined,
      elements: [...part.children].map((element) =>
        element.hasAttribute("transform") ? { element, at: translation(element) } : { element, line: points(element) }),
    }));
    this.curves = inside.filter((part) => part.dataset.curve !== undefined).map((part) => ({
      part, place: part.dataset.curve, label: part.dataset.label, points: JSON.parse(part.dataset.points), isHidden: false,
    }));
    this.clip = `clip-${name}`;
    const clip = make("clipPath", { id: this.clip });
    clip.append(make("rect", { x: this.left, y: this.top, width: this.right - this.left, height: this.bottom - this.top }));
    this.cursor = make("g", { class: "cursor", "pointer-events": "none" });
    group.append(clip, this.cursor);
  }

  has = (x, y) => x >= this.left && x <= this.right && y >= this.top && y <= this.bottom;

  get shown() {
    return this.curves.filter((curve) => !curve.isHidden);
  }

  // Abscissae of the curves in view, rising.
  get abscissae() {
    const all = this.shown.flatMap((curve) => curve.points.map((point) => point[0])).filter(this.x.shows);
    return [...new Set(all)].sort((a, b) => a - b);
  }

  draw() {
    const isWhole = this.x.range === this.x.home && this.shown.length === this.curves.length;
    const seen = this.shown.flatMap((curve) => curve.points.filter((point) => this.x.shows(point[0])));
    const values = seen.flatMap((point) => point.slice(1));
    this.y.range = isWhole || values.length === 0 ? this.y.home : around(values, this.y.isLog);
    for (const { part, isUpright, elements } of this.parts) {
      if (isUpright) part.style.display = elements.every(({ at }) => this.has(this.x.move(at[0]), this.top)) ? "" : "none";
      else part.setAttribute("clip-path", isWhole ? "none" : `url(#${this.clip})`);
      const up = isUpright ? (place) => place : this.y.move;
      const moved = ([x, y]) => [this.x.move(x).toFixed(1), up(y).toFixed(1)];
      for (const { element, at, line } of elements) {
        if (at) element.setAttribute("transform", `translate(${moved(at).join(" ")})`);
        else element.setAttribute("points", line.map((pair) => moved(pair).join(",")).join(" "));
      }
    }
    for (const curve of this.curves) curve.part.style.display = curve.isHidden ? "none" : "";
    if (isWhole) this.ticks.replaceChildren(...this.drawnTicks);
    else this.#drawTicks();
  }

  #drawTicks() {
    const { left, top, right, bottom, font } = this;
    const line = (x1, y1, x2, y2, stroke, opacity = 1) => make("line", { x1, y1, x2, y2, stroke, opacity });
    const [across, up] = [this.x, this.y].map((axis) => figureTicks(...axis.range, axis.isLog));
    const minor = up.minor.map((value) => line(left, this.y.place(value), right, this.y.place(value), "#DDDDDD", 0.45));
    const levels = up.major.flatMap((value, n) => {
      const y = this.y.place(value);
      return [line(left, y, right, y, "#DDDDDD"), line(left - 5, y, left, y, "#222222"),
        make("text", { x: left - 9, y, dy: "0.27em", "text-anchor": "end", ...font }, up.labels[n])];
    });
    const uprights = across.major.flatMap((value, n) => {
      const x = this.x.place(value);
      return [line(x, top, x, bottom, "#DDDDDD"), line(x, bottom, x, bottom + 5, "#222222"),
        make("text", { x, y: bottom + 9, dy: "0.76em", "text-anchor": "middle", ...font }, across.labels[n])];
    });
    this.ticks.replaceChildren(...minor, ...levels, ...uprights);
  }

  // Marks the points nearest to a place across the frame, and returns their values as text.
  read(place) {
    const distance = (x) => Math.abs(this.x.place(x) - place);
    const nearest = (all) => all.reduce((best, x) => (distance(x) < distance(best) ? x : best), all[0]);
    const x = nearest(this.abscissae);
    this.cursor.replaceChildren();
    if (x === undefined) return HINT;
    this.at = x;
    const across = this.x.place(x);
    this.cursor.append(make("line", { x1: across, y1: this.top, x2: across, y2: this.bottom, stroke: "#666666" }));
    const words = [`${this.x.label} ${significant(x, 5)}`];
    for (const curve of this.shown) {
      const own = curve.points.reduce((best, point) =>
        (Math.abs(this.x.place(point[0]) - across) < Math.abs(this.x.place(best[0]) - across) ? point : best), curve.points[0]);
      if (own === undefined || Math.abs(this.x.place(own[0]) - across) > FARTHEST) continue;
      const [at, value, low, high] = own;
      const range = low === undefined ? "" : ` (${significant(low, 4)} to ${significant(high, 4)})`;
      const elsewhere = at === x ? "" : ` at ${significant(at, 5)}`;
      words.push(`${curve.label ? `${curve.label}: ` : ""}${significant(value, 4)}${range}${elsewhere}`);
      const ring = { cx: this.x.place(at), cy: this.y.place(value), r: 7, fill: "none", stroke: "#222222" };
      this.cursor.append(make("circle", ring));
    }
    return words.join(" · ");
  }

  // The abscissa before (−1) or after (1) the one that is read out.
  next(step) {
    const all = this.abscissae;
    const n = all.indexOf(this.at);
    return all[n < 0 ? (step > 0 ? 0 : all.length - 1) : Math.min(all.length - 1, Math.max(0, n + step))];
  }
}

// A drawing with its frames: those with the same abscissa are zoomed together.
class Drawing {
  constructor(svg, frames) {
    Object.assign(this, { svg, frames, readout: document.createElement("p"), whole: document.createElement("button") });
    this.readout.className = "readout";
    this.readout.textContent = HINT;
    this.whole.textContent = "Whole range";
    this.whole.className = "whole";
    this.whole.hidden = true;
    this.whole.addEventListener("click", () => this.zoom(null));
    svg.after(this.readout, this.whole);
    svg.setAttribute("tabindex", "0");
    svg.setAttribute("class", "interactive");
    svg.addEventListener("pointerdown", (event) => this.#down(event));
    svg.addEventListener("pointermove", (event) => this.#move(event));
    svg.addEventListener("pointerup", (event) => this.#up(event));
    svg.addEventListener("pointercancel", () => this.#endDrag());
    svg.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && this.#leave());
    svg.addEventListener("dblclick", () => this.zoom(null));
    svg.addEventListener("keydown", (event) => this.#key(event));
    for (const entry of svg.querySelectorAll("[data-legend]")) this.#listen(entry);
  }

  // Shows a part of the abscissa, or all of it.
  zoom(range) {
    const first = this.dragged ?? this.frames[0];
    for (const frame of this.frames) {
      const isAlike = frame === first || String(frame.x.home) === String(first.x.home);
      if (range === null) frame.x.range = frame.x.home;
      else if (isAlike) frame.x.range = range;
      frame.cursor.replaceChildren();
      frame.draw();
    }
    this.whole.hidden = this.frames.every((frame) => frame.x.range === frame.x.home);
    this.readout.textContent = HINT;
  }

  #listen(entry) {
    entry.setAttribute("role", "button");
    entry.setAttribute("tabindex", "0");
    entry.setAttribute("aria-pressed", "true");
    const toggle = () => {
      const isHidden = entry.getAttribute("aria-pressed") === "true";
      entry.setAttribute("aria-pressed", String(!isHidden));
      for (const frame of this.frames) {
        for (const curve of frame.curves) if (curve.place === entry.dataset.legend) curve.isHidden = isHidden;
        frame.cursor.replaceChildren();
        frame.draw();
      }
    };
    entry.addEventListener("click", toggle);
    entry.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      toggle();
    });
  }

  #at(event) {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return { x, y, frame: this.frames.find((frame) => frame.has(x, y)) };
  }

  #down(event) {
    const { x, frame } = this.#at(event);
    if (frame === undefined || event.button !== 0) return;
    event.preventDefault();
    this.svg.focus({ preventScroll: true });
    this.svg.setPointerCapture(event.pointerId);
    this.dragged = frame;
    this.from = x;
    const { top, bottom } = frame;
    this.selection = make("rect", { class: "selection", x, y: top, width: 0, height: bottom - top });
    frame.group.append(this.selection);
    this.readout.textContent = frame.read(x);
  }

  #move(event) {
    const { x, frame } = this.#at(event);
    if (this.selection !== undefined) {
      const [from, to] = this.#span(x);
      this.selection.setAttribute("x", from);
      this.selection.setAttribute("width", to - from);
    } else if (frame === undefined) {
      this.#leave();
    } else {
      for (const other of this.frames) if (other !== frame) other.cursor.replaceChildren();
      this.readout.textContent = frame.read(x);
    }
  }

  // The dragged part of the frame.
  #span(x) {
    const { left, right } = this.dragged;
    const end = Math.min(right, Math.max(left, x));
    return [Math.min(this.from, end), Math.max(this.from, end)];
  }

  #up(event) {
    if (this.selection === undefined) return;
    const span = this.#span(this.#at(event).x);
    const range = span.map((place) => this.dragged.x.value(place));
    if (span[1] - span[0] >= MIN_DRAG && range[1] > range[0]) this.zoom(range);
    this.#endDrag();
  }

  #endDrag() {
    this.selection?.remove();
    this.selection = this.dragged = undefined;
  }

  #leave() {
    for (const frame of this.frames) frame.cursor.replaceChildren();
    this.readout.textContent = HINT;
  }

  #key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey || event.target !== this.svg) return;
    if (event.key === "Escape") this.zoom(null);
    if (step === undefined) return;
    event.preventDefault();
    const [frame] = this.frames;
    const x = frame.next(step);
    if (x !== undefined) this.readout.textContent = frame.read(frame.x.place(x));
  }
}

for (const [place, svg] of document.querySelectorAll("figure svg").entries()) {
  const frames = [...svg.querySelectorAll("[data-axes]")].map((group, n) => new Frame(group, `${place}-${n}`));
  if (frames.length > 0) new Drawing(svg, frames);
}
