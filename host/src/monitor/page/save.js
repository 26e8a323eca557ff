// Saves a panel as a picture, and the log as text.

import { colour, fontFamily, inLight } from "./theme.js";
import { duration } from "./text.js";

const LINE = 20;
const EDGE = 12;

// Adds a button to the header of every panel with a plot. `shown` gives the state of the rig that the plots show.
export function addButtons(model, shown) {
  for (const panel of document.querySelectorAll(".panel")) {
    if (panel.querySelector(".plot") === null) continue;
    const button = document.createElement("button");
    const title = panel.querySelector("h2").textContent;
    [button.type, button.className, button.textContent] = ["button", "save", "Save"];
    button.setAttribute("aria-label", `Save picture: ${title}`);
    button.addEventListener("click", async () => {
      if (panel.querySelector(".plot canvas") === null) return;
      const of = { source: model.source, state: shown() };
      const whole = await inLight(() => picture(panel, title, of));
      whole.toBlob((blob) => offer(blob, fileName(of, title, "png")));
    });
    (panel.querySelector("header .tools") ?? panel.querySelector("header")).append(button);
  }
}

export function log(model) {
  const lines = model.log.map(({ at, level, text }) => `${at}\t${level}\t${text}\n`);
  offer(new Blob(lines, { type: "text/plain" }), fileName(model, "log", "txt"));
}

function fileName({ source, state }, what, ending) {
  const words = [source.name, what, state.rig_s === null ? "" : `${Math.round(state.rig_s)} s`];
  return `${words.join(" ").replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").toLowerCase()}.${ending}`;
}

function offer(blob, name) {
  const link = document.createElement("a");
  [link.href, link.download] = [URL.createObjectURL(blob), name];
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// The plots of a panel under its title, with its notes, its legend and what was watched.
async function picture(panel, title, { source, state }) {
  const scale = uPlot.pxRatio;
  const plots = [...panel.querySelectorAll(".plot canvas")];
  const words = (selector) => [...panel.querySelectorAll(selector)].map((e) => e.textContent.trim()).filter((text) => text !== "");
  const legend = await Promise.all([...panel.querySelectorAll(".legend li")].map(async (item) => ({
    text: [...item.children].slice(1).map((e) => e.textContent).join(" ") || item.textContent,
    swatch: await image(item.querySelector("svg")),
  })));
  const run = panel.classList.contains("curves") ? [] : [state.set_up && `set-up ${state.set_up}`, state.experiment && `experiment ${state.experiment}`];
  const rig = state.rig_s === null ? "" : `rig time ${duration(state.rig_s)}`;
  const saved = `saved ${new Date(Date.now() - 60000 * new Date().getTimezoneOffset()).toISOString().slice(0, 16).replace("T", " ")}`;
  const about = [source.name, ...run, rig, source.folder, source.rig && `rig ${source.rig}`, source.version, saved].filter(Boolean);
  const width = Math.max(...plots.map((plot) => plot.width)) / scale + 2 * EDGE;
  const ruler = document.createElement("canvas").getContext("2d");
  ruler.font = `13px ${fontFamily()}`;
  const wide = (text) => ruler.measureText(text).width;
  const column = Math.max(160, ...legend.map(({ text }) => wide(text) + 56));
  const columns = Math.max(1, Math.floor((width - 2 * EDGE) / column));
  const notes = [...words(".readout"), ...words("p.foot"), ...lines(about, " · ", width - 2 * EDGE, wide)];
  const height = plots.reduce((sum, plot) => sum + plot.height / scale, 0) + LINE * (2 + notes.length + Math.ceil(legend.length / columns)) + EDGE;
  const whole = document.createElement("canvas");
  [whole.width, whole.height] = [Math.round(width * scale), Math.round(height * scale)];
  const ctx = whole.getContext("2d");
  ctx.fillStyle = colour("sheet");
  ctx.fillRect(0, 0, whole.width, whole.height);
  ctx.scale(scale, scale);
  const write = (text, x, y, name, font) => {
    [ctx.font, ctx.fillStyle] = [`${font} ${fontFamily()}`, name];
    ctx.fillText(text, x, y, width - x - EDGE);
  };
  write(title, EDGE, 1.2 * LINE, colour("ink"), "600 16px");
  let y = 1.6 * LINE;
  for (const plot of plots) {
    ctx.drawImage(plot, EDGE, y, plot.width / scale, plot.height / scale);
    y += plot.height / scale;
  }
  legend.forEach(({ text, swatch }, i) => {
    const [x, top] = [EDGE + column * (i % columns), y + LINE * Math.floor(i / columns)];
    ctx.drawImage(swatch, x, top + 4, 30, 14);
    write(text, x + 36, top + 15, colour("ink"), "13px");
  });
  y += LINE * Math.ceil(legend.length / columns);
  notes.forEach((text, i) => write(text, EDGE, y + LINE * (i + 0.8), colour("grey"), "13px"));
  return whole;
}

// Parts joined to lines that are not wider than `width`, where a part alone is not.
function lines(parts, between, width, wide) {
  const all = [];
  for (const part of parts) {
    const longer = `${all.at(-1)}${between}${part}`;
    if (all.length > 0 && wide(longer) <= width) all[all.length - 1] = longer;
    else all.push(part);
  }
  return all;
}

// A swatch of the legend as an image in its colour.
async function image(svg) {
  const text = new XMLSerializer().serializeToString(svg).replaceAll("currentColor", getComputedStyle(svg).color);
  const whole = new Image();
  whole.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
  await whole.decode();
  return whole;
}
