// Light or dark: the reader's choice, kept by the browser, else the system's. Gives the drawings their colours.

const KEY = "damprig-theme";
const system = matchMedia("(prefers-color-scheme: dark)");
let colours = {};
const listeners = [];

function stored() {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
  }
}

// Runs something with the page in its light colours: a picture for paper.
export async function inLight(run) {
  const { dataset } = document.documentElement;
  const own = dataset.theme;
  const show = async (theme) => {
    if (theme === undefined) delete dataset.theme;
    else dataset.theme = theme;
    read();
    // The plots are drawn before the next picture of the page.
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  };
  if (!isDark()) return run();
  await show("light");
  try {
    return await run();
  } finally {
    await show(own);
  }
}

const isDark = () => (document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";

function read() {
  const style = getComputedStyle(document.documentElement);
  const names = ["paper", "sheet", "ink", "grey", "line", "grid", "good", "bad", "warn"];
  for (let i = 0; i < 12; i += 1) names.push(`curve-${i}`);
  colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  for (const listener of listeners) listener();
}

function changed(button) {
  read();
  button.textContent = isDark() ? "Light" : "Dark";
}

// A colour of look.css by its name without dashes: "ink", "curve-3".
export const colour = (name) => colours[name] ?? "#888888";
export const fontFamily = () => getComputedStyle(document.body).fontFamily;
export const curveColour = (index) => colour(`curve-${index % 12}`);
export const onTheme = (listener) => listeners.push(listener);

export function start(button) {
  const choice = stored();
  if (choice === "light" || choice === "dark") document.documentElement.dataset.theme = choice;
  button.addEventListener("click", () => {
    const next = isDark() ? "light" : "dark";
    document.documentElement.dataset.theme = next;
    try {
      localStorage.setItem(KEY, next);
    } catch {
      // The choice then lasts until the page is closed.
    }
    changed(button);
  });
  system.addEventListener("change", () => changed(button));
  changed(button);
}
