// A plot in the look of the report's figures: uPlot with round ticks, fixed margins, frame and fonts.

import { linearLabels, linearTicks, logLabels, logTicks } from "./axis.js";
import { colour, fontFamily, onTheme } from "./theme.js";
import { fixed, significant } from "./text.js";

const TOP = 8;
const RIGHT = 12;
const LEFT = 64;
const BOTTOM = 46;

// `spec`: xLabel, yLabel; x() and y() give the ranges [from, to]; isLog of the ordinate; series [{colour, width, dash}];
// behind(pen) and before(pen) draw below and above the series; onSelect(from, to) for a dragged part; onHover(x | null, y);
// hasXLabels false leaves out the labels of the abscissa; yTicks are the places that the ordinate may have ticks at.
export class Plot {
  constructor(host, spec) {
    this.host = host;
    this.spec = spec;
    this.data = [[0, 1], ...(spec.series ?? []).map(() => [null, null])];
    onTheme(() => this.u?.redraw(false));
    new ResizeObserver(() => this.#resize()).observe(host);
  }

  // Draws the series: `[x, y…]`, all of one length; without data only the axes and what behind and before draw.
  draw(data) {
    if (data !== undefined && data[0].length > 0) {
      this.data = data;
    } else {
      const [from, to] = this.spec.x();
      this.data = [[from, to], ...(this.spec.series ?? []).map(() => [null, null])];
    }
    if (this.u === undefined) this.#make();
    else this.u.setData(this.data);
  }

  get columns() {
    return Math.max(50, Math.round((this.host.clientWidth - LEFT - RIGHT) * Math.min(devicePixelRatio || 1, 2)));
  }

  #resize() {
    const size = { width: this.host.clientWidth, height: this.host.clientHeight };
    if (this.u !== undefined && size.width > 0) this.u.setSize(size);
  }

  #axis(isX) {
    const { spec } = this;
    const isLog = !isX && spec.isLog === true;
    const isBlank = isX && spec.hasXLabels === false;
    const font = () => `12px ${fontFamily()}`;
    const gap = isX ? 90 : 26;
    const across = (u) => (isX ? u.width - LEFT - RIGHT : u.height - TOP - BOTTOM);
    const divisions = (u) => Math.max(2, Math.min(7, Math.floor(across(u) / (isX ? 48 : gap))));
    const own = isX ? undefined : spec.yTicks;
    const ticks = (u, from, to) => (own ? own.filter((value) => value >= from && value <= to) : isLog ? logTicks(from, to).major : linearTicks(from, to, divisions(u)));
    return {
      scale: isX ? "x" : "y",
      side: isX ? 2 : 3,
      stroke: () => colour("ink"),
      font: font(),
      labelFont: `13px ${fontFamily()}`,
      label: isBlank ? undefined : isX ? spec.xLabel : spec.yLabel,
      labelSize: isX ? 20 : 18,
      labelGap: 0,
      gap: 4,
      size: isBlank ? 8 : isX ? BOTTOM - 20 : LEFT - 18,
      grid: { stroke: () => colour("grid"), width: 1 },
      ticks: { stroke: () => colour("ink"), width: 1, size: 4 },
      splits: (u, _index, from, to) => ticks(u, from, to),
      values: (_u, splits) => (isBlank ? splits.map(() => "") : isLog ? logLabels(splits) : linearLabels(splits)),
    };
  }

  #make() {
    const { spec } = this;
    const isHoverable = spec.onHover !== undefined;
    this.u = new uPlot(
      {
        width: this.host.clientWidth || 300,
        height: this.host.clientHeight || 200,
        padding: [TOP, RIGHT, 0, 0],
        legend: { show: false },
        cursor: {
          show: isHoverable || spec.onSelect !== undefined,
          y: false,
          points: { show: false },
          drag: { x: spec.onSelect !== undefined, y: false, setScale: false },
        },
        scales: {
          x: { time: false, range: () => spec.x() },
          y: { range: () => spec.y(), distr: spec.isLog ? 3 : 1 },
        },
        axes: [this.#axis(true), this.#axis(false)],
        series: [
          {},
          ...(spec.series ?? []).map((one) => ({
            stroke: () => colour(one.colour),
            width: one.width ?? 1.4,
            dash: one.dash,
            paths: one.isStepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
            points: { show: false },
          })),
        ],
        hooks: {
          drawAxes: [(u) => this.#paint(u, () => this.#behind(u))],
          draw: [(u) => this.#paint(u, () => spec.before?.(new Pen(u))), (u) => frame(u)],
          setSelect: [(u) => this.#selected(u)],
          setCursor: isHoverable ? [(u) => this.#hovered(u)] : [],
        },
      },
      this.data,
      this.host,
    );
  }

  #behind(u) {
    if (this.spec.isLog) {
      const pen = new Pen(u);
      for (const value of logTicks(u.scales.y.min, u.scales.y.max).minor) pen.level(value, "grid", { alpha: 0.45 });
    }
    this.spec.behind?.(new Pen(u));
  }

  #paint(u, paint) {
    const { left, top, width, height } = u.bbox;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(left, top, width, height);
    u.ctx.clip();
    paint();
    u.ctx.restore();
  }

  #selected(u) {
    const { left, width } = u.select;
    if (width < 3) return;
    const [from, to] = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.spec.onSelect?.(from, to);
  }

  #hovered(u) {
    const { left, top } = u.cursor;
    if (left === undefined || left < 0) this.spec.onHover(null, null);
    else this.spec.onHover(u.posToVal(left, "x"), u.posToVal(top, "y"));
  }
}

function frame(u) {
  const { left, top, width, height } = u.bbox;
  u.ctx.save();
  u.ctx.strokeStyle = colour("ink");
  u.ctx.lineWidth = uPlot.pxRatio;
  u.ctx.globalAlpha = 0.7;
  u.ctx.setLineDash([]);
  u.ctx.strokeRect(left - 0.5, top - 0.5, width + 1, height + 1);
  u.ctx.restore();
}

// Outlines of markers, one per set-up: those of figures/frequency_response.rs.
const SHAPES = [
  [[5, 0], [4, 3], [3, 4], [0, 5], [-3, 4], [-4, 3], [-5, 0], [-4, -3], [-3, -4], [0, -5], [3, -4], [4, -3]],
  [[-4, -4], [4, -4], [4, 4], [-4, 4]],
  [[0, -6], [6, 4], [-6, 4]],
  [[0, -6], [6, 0], [0, 6], [-6, 0]],
  [[0, 6], [6, -4], [-6, -4]],
  [[-6, 0], [-3, -5], [3, -5], [6, 0], [3, 5], [-3, 5]],
];

export const outline = (index) => SHAPES[index % SHAPES.length];

// Draws in the units of a plot's axes; sizes and widths are in CSS pixels.
export class Pen {
  constructor(u) {
    this.u = u;
    this.ctx = u.ctx;
    this.scale = uPlot.pxRatio;
  }

  x = (value) => this.u.valToPos(value, "x", true);
  y = (value) => this.u.valToPos(value, "y", true);

  #style(name, { alpha = 1, width = 1, dash = [] } = {}) {
    this.ctx.globalAlpha = alpha;
    this.ctx.strokeStyle = colour(name);
    this.ctx.fillStyle = colour(name);
    this.ctx.lineWidth = width * this.scale;
    this.ctx.lineJoin = "round";
    this.ctx.setLineDash(dash.map((length) => length * this.scale));
  }

  // A polyline through pairs; null lifts the pen.
  path(points, name, style) {
    this.#style(name, style);
    this.ctx.beginPath();
    let isDown = false;
    for (const point of points) {
      if (point === null) isDown = false;
      else if (isDown) this.ctx.lineTo(this.x(point[0]), this.y(point[1]));
      else {
        this.ctx.moveTo(this.x(point[0]), this.y(point[1]));
        isDown = true;
      }
    }
    this.ctx.stroke();
  }

  // A horizontal line over the plot.
  level(value, name, style) {
    const { left, width } = this.u.bbox;
    const y = Math.round(this.y(value)) + 0.5;
    this.#style(name, style);
    this.ctx.beginPath();
    this.ctx.moveTo(left, y);
    this.ctx.lineTo(left + width, y);
    this.ctx.stroke();
  }

  // The two lines of a symmetric limit, at the edge of the plot where they lie beyond it, and in words what is left to it. `largest` is
  // the largest value shown; the words are in this row of text from above.
  limits(limit, largest, unit, decimals, row = 1) {
    const { min, max } = this.u.scales.y;
    const { left, top, width, height } = this.u.bbox;
    const isBeyond = limit > max;
    for (const side of [-1, 1]) {
      const value = Math.min(max - (max - min) / height, Math.max(min + (2 * (max - min)) / height, side * limit));
      this.level(value, "bad", { dash: isBeyond ? [2, 6] : [6, 4], width: isBeyond ? 2 : 1.2 });
    }
    const margin = limit - largest;
    const leftOver = Number.isFinite(margin) ? `, margin ${fixed(margin, decimals)} ${unit} (${fixed((100 * margin) / limit, 0)} %)` : "";
    const words = `${isBeyond ? "▲ " : ""}limit ±${significant(limit, 4)} ${unit}${leftOver}`;
    const [x, y] = [left + width - 6 * this.scale, top + (4 + 16 * row) * this.scale];
    this.#style("sheet", { alpha: 0.85 });
    this.ctx.font = `${12 * this.scale}px ${fontFamily()}`;
    const wide = this.ctx.measureText(words).width;
    this.ctx.fillRect(x - wide - 3 * this.scale, y - 15 * this.scale, wide + 6 * this.scale, 16 * this.scale);
    this.text(words, x, y, margin < 0.1 * limit ? "bad" : "grey", "right");
  }

  // A vertical line over the plot.
  upright(value, name, style) {
    const { top, height } = this.u.bbox;
    const x = Math.round(this.x(value)) + 0.5;
    this.#style(name, style);
    this.ctx.beginPath();
    this.ctx.moveTo(x, top);
    this.ctx.lineTo(x, top + height);
    this.ctx.stroke();
  }

  dot(x, y, radius, name, style) {
    this.#style(name, style);
    this.ctx.beginPath();
    this.ctx.arc(this.x(x), this.y(y), radius * this.scale, 0, 2 * Math.PI);
    this.ctx.fill();
  }

  ring(x, y, radius, name, style) {
    this.#style(name, style);
    this.ctx.beginPath();
    this.ctx.arc(this.x(x), this.y(y), radius * this.scale, 0, 2 * Math.PI);
    this.ctx.stroke();
  }

  // The marker of a set-up; hollow ones are filled with the background.
  marker(x, y, index, name, isFilled) {
    const [cx, cy] = [this.x(x), this.y(y)];
    this.#style(name, { width: 2 });
    this.ctx.beginPath();
    for (const [dx, dy] of outline(index)) this.ctx.lineTo(cx + dx * 0.85 * this.scale, cy + dy * 0.85 * this.scale);
    this.ctx.closePath();
    this.ctx.fillStyle = colour(isFilled ? name : "sheet");
    this.ctx.fill();
    this.ctx.stroke();
  }

  // A triangle at the upper (side 1) or lower (side −1) edge that points outwards.
  edge(x, side, name) {
    const { top, height } = this.u.bbox;
    const tip = side > 0 ? top + 2 * this.scale : top + height - 2 * this.scale;
    const cx = this.x(x);
    this.#style(name);
    this.ctx.beginPath();
    this.ctx.moveTo(cx, tip);
    this.ctx.lineTo(cx - 4 * this.scale, tip + side * 7 * this.scale);
    this.ctx.lineTo(cx + 4 * this.scale, tip + side * 7 * this.scale);
    this.ctx.fill();
  }

  // A short text beside a place; `align` is the canvas' textAlign.
  text(words, x, y, name, align = "left") {
    this.#style(name);
    this.ctx.font = `${12 * this.scale}px ${fontFamily()}`;
    this.ctx.textAlign = align;
    this.ctx.textBaseline = "bottom";
    this.ctx.fillText(words, x, y);
  }
}
