// Spectrum of x with the waterfall of the last ones: amplitude of each line, and its colour over time.

import { roundStep } from "./axis.js";
import { Plot } from "./plot.js";
import { colour, onTheme } from "./theme.js";
import { fixed, put, significant } from "./text.js";

const $ = (id) => document.getElementById(id);
// Decades of amplitude that are shown.
const DECADES = 4;
const LEAST_MM = 1e-5;
// A spectrum's band in the waterfall is at most so many times as high as the shortest.
const LONGEST_BAND = 4;
// Two spectra come in a second: one that is older than this, at real time, is not of now.
const OLD_S = 2.5;

export class SpectrumPanel {
  every = 250;

  constructor(model) {
    this.model = model;
    this.ranges = { x: [0, 25], y: [1e-4, 1], t: [0, 30] };
    this.bands = document.createElement("canvas");
    const common = { x: () => this.ranges.x };
    this.plot = new Plot($("plot-spectrum"), {
      ...common, xLabel: "", yLabel: "x (mm)", isLog: true, hasXLabels: false, y: () => this.ranges.y, series: [{ colour: "curve-0" }],
      behind: (pen) => this.#drive(pen), onHover: (hz) => this.#hover(hz),
    });
    this.waterfall = new Plot($("plot-waterfall"), {
      ...common, xLabel: "Frequency (Hz)", yLabel: "Time (s)", y: () => this.ranges.t, before: (pen) => this.#waterfall(pen),
      onHover: (hz) => this.#hover(hz),
    });
    onTheme(() => { this.painted = undefined; });
  }

  static hasData = ({ source }) => source.signals.has("x");

  draw() {
    const { spectra } = this.model;
    const newest = spectra.at(-1);
    if (newest !== undefined) {
      const all = spectra.flatMap((s) => s.mm.slice(1));
      const top = Math.max(LEAST_MM * 10, all.reduce((most, mm) => Math.max(most, mm), 0)) * 1.5;
      const first = spectra[0].t_s;
      this.ranges = { x: [0, newest.step_hz * newest.mm.length], y: [top / 10 ** DECADES, top], t: [first, Math.max(newest.t_s, first + 5)] };
      this.#paint(spectra);
    }
    // The first line holds the mean, which is left out.
    const [hz, mm] = this.#present() === undefined ? [[], []] : [newest.mm.map((_, i) => i * newest.step_hz), newest.mm];
    this.plot.draw([hz.slice(1), mm.slice(1).map((value) => Math.max(value, this.ranges.y[0]))]);
    this.waterfall.draw();
    if (this.hovered !== true) this.#note();
  }

  // The newest spectrum, if it is of the newest samples.
  #present() {
    const newest = this.model.spectra.at(-1);
    const oldest = this.model.rows.last - OLD_S * Math.max(1, this.model.state?.speed ?? 1);
    return newest !== undefined && newest.t_s >= oldest ? newest : undefined;
  }

  #note() {
    const now = this.#present();
    put($("spectrum-note"), now === undefined ? "too few samples yet"
      : `${significant(now.step_hz, 2)} Hz a line, of ${significant(1 / now.step_hz, 3)} s; colours: ${DECADES} decades`);
  }

  #hover(hz) {
    const newest = this.#present();
    this.hovered = hz !== null && newest !== undefined;
    if (!this.hovered) return this.#note();
    const line = Math.min(newest.mm.length - 1, Math.max(1, Math.round(hz / newest.step_hz)));
    return put($("spectrum-note"), `${significant(line * newest.step_hz, 4)} Hz: ${significant(newest.mm[line], 3)} mm`);
  }

  #drive(pen) {
    const hz = this.model.state?.number("frequency_hz") ?? null;
    if (hz > 0) pen.upright(hz, "grey", { dash: [5, 4], alpha: 0.7 });
  }

  // A row of pixels for each spectrum, a pixel for each line.
  #paint(spectra) {
    const key = `${spectra[0].t_s} ${spectra.at(-1).t_s} ${this.ranges.y[1]}`;
    if (this.painted === key) return;
    this.painted = key;
    const width = Math.max(...spectra.map((s) => s.mm.length));
    [this.bands.width, this.bands.height] = [width, spectra.length];
    const scale = tints();
    const context = this.bands.getContext("2d");
    const pixels = context.createImageData(width, spectra.length);
    const top = Math.log10(this.ranges.y[1]);
    spectra.forEach(({ mm }, row) => mm.forEach((value, line) => {
      const share = 1 - (top - Math.log10(Math.max(value, LEAST_MM))) / DECADES;
      const tint = scale[Math.min(scale.length - 1, Math.max(0, Math.round(share * (scale.length - 1))))];
      pixels.data.set(line === 0 ? [0, 0, 0, 0] : [...tint, 255], 4 * (row * width + line));
    }));
    context.putImageData(pixels, 0, 0);
  }

  #waterfall(pen) {
    const { spectra } = this.model;
    const gaps = spectra.slice(1).map((s, i) => s.t_s - spectra[i].t_s);
    const shortest = Math.max(1e-3, Math.min(...gaps, 5));
    pen.ctx.imageSmoothingEnabled = false;
    spectra.forEach(({ t_s, step_hz, mm }, row) => {
      const from = t_s - Math.min(gaps[row - 1] ?? shortest, LONGEST_BAND * shortest);
      const [left, right] = [pen.x(-step_hz / 2), pen.x((mm.length - 0.5) * step_hz)];
      const [low, high] = [pen.y(from), pen.y(t_s)];
      pen.ctx.globalAlpha = 1;
      pen.ctx.drawImage(this.bands, 0, row, mm.length, 1, left, high, right - left, low - high + 0.5);
    });
  }
}

// From the background over blue to ink.
function tints() {
  const [from, over, to] = ["sheet", "curve-3", "ink"].map((name) => colour(name).match(/[0-9a-f]{2}/gi)?.map((part) => parseInt(part, 16)) ?? [128, 128, 128]);
  const mixed = (a, b, share) => a.map((value, i) => Math.round(value + share * (b[i] - value)));
  return Array.from({ length: 64 }, (_, i) => (i < 40 ? mixed(from, over, i / 40) : mixed(over, to, (i - 40) / 23)));
}
