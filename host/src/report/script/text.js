// Formats numbers and untrusted text for people.

const HIDDEN =
  /[\p{Cc}\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ufffe\uffff\u{e0000}-\u{e007f}]/gu;

// Text with control characters, direction marks and characters without width spelled out, as damprig's terminal output has them.
export function shown(text, most = 400) {
  const cut = text.length > most ? `${text.slice(0, most)}…` : text;
  return cut.replace(HIDDEN, (c) => `\\u{${c.codePointAt(0).toString(16)}}`);
}

export const UNKNOWN = "–";

// A number with fixed decimals; a dash if it is unknown.
export function fixed(value, decimals) {
  if (value === null || value === undefined || !Number.isFinite(value)) return UNKNOWN;
  const text = Math.abs(value) < 1e9 ? value.toFixed(decimals) : value.toExponential(2);
  return /^-0(\.0*)?$/.test(text) ? text.slice(1) : text.replace("-", "−");
}

// At most `digits` significant digits, without trailing zeros.
export function significant(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return UNKNOWN;
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

export const millimetres = (metres, decimals) => fixed(metres === null ? null : metres * 1e3, decimals);

// Phase of x relative to z in degrees, −270 to 90, so that it does not wrap above resonance.
export function degrees(radians) {
  if (radians === null) return null;
  const value = (radians * 180) / Math.PI;
  return value > 90 ? value - 360 : value;
}

// Whole number with thin spaces between groups of three digits.
export function count(value) {
  if (value === null || value === undefined) return UNKNOWN;
  return String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

// Duration in two units: "1 h 6 min", "4 min 10 s", "12 s".
export function duration(seconds) {
  if (seconds === null || !Number.isFinite(seconds)) return UNKNOWN;
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, "0")} s`;
  if (s < 172800) return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, "0")} min`;
  return `${Math.floor(s / 86400)} days ${Math.floor((s % 86400) / 3600)} h`;
}

// Sets the text of an element only if it changes.
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
