// The connection to damprig: opens it again after a loss, hands on messages, sends actions with the token.

import { parse, text } from "./messages.js";

const WAITS_S = [0.5, 1, 2, 3, 5];
// damprig sends at least one message a second.
const SILENT_MS = 10000;
const OPENING_MS = 30000;
// damprig has ended: it told everything before it closed the connection.
const ENDED = 1001;

// Takes the token out of the address (#token=…) and keeps it for this tab.
export function takeToken() {
  const found = /^#token=([\w-]{1,200})$/.exec(location.hash);
  try {
    if (found) sessionStorage.setItem("damprig-token", found[1]);
    if (location.hash) history.replaceState(null, "", location.pathname + location.search);
    return found ? found[1] : sessionStorage.getItem("damprig-token");
  } catch {
    return found ? found[1] : null;
  }
}

export class Connection {
  #socket = null;
  #attempt = 0;
  #heard = 0;
  #nextId = 1;
  #waiting = new Map();

  // `on.message(message)` gets each message, `on.damaged()` is called for one that is not understood, `on.state({isOpen, retryAt})`
  // when the connection opens or closes.
  constructor(token, on) {
    this.token = token;
    this.on = on;
    setInterval(() => this.#watch(), 1000);
    addEventListener("online", () => this.#openNow());
    document.addEventListener("visibilitychange", () => document.hidden || this.#openNow());
    this.#open();
  }

  // Sends an action; resolves to {ok, text}.
  act(what) {
    if (this.#socket?.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ ok: false, text: "No connection to damprig." });
    }
    const id = this.#nextId;
    this.#nextId += 1;
    const token = what.do === "replay" || this.token === null ? {} : { token: this.token };
    this.#socket.send(JSON.stringify({ id, ...token, ...what }));
    return new Promise((resolve) => {
      this.#waiting.set(id, resolve);
      setTimeout(() => this.#answer(id, { ok: false, text: "damprig did not answer within 10 s." }), 10000);
    });
  }

  #answer(id, answer) {
    this.#waiting.get(id)?.(answer);
    this.#waiting.delete(id);
  }

  #open() {
    clearTimeout(this.timer);
    this.timer = undefined;
    // Those with the token have places of their own.
    const protocols = this.token === null ? ["damprig"] : ["damprig", `token.${this.token}`];
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`, protocols);
    this.#socket = socket;
    this.#heard = performance.now();
    socket.onmessage = (event) => {
      this.#heard = performance.now();
      const message = parse(event.data);
      if (message === null) this.on.damaged();
      else if (message.kind === "answer") this.#answer(message.id, { ok: message.ok === true, text: text(message.text) });
      else this.#hand(message);
    };
    socket.onclose = (event) => this.#closed(socket, event.code === ENDED);
  }

  #hand(message) {
    if (message.kind === "snapshot") {
      this.#attempt = 0;
      this.hasEnded = false;
      this.on.state({ isOpen: true, retryAt: null });
    }
    this.on.message(message);
  }

  #closed(socket, hasEnded = false) {
    if (socket !== this.#socket || this.timer !== undefined) return;
    for (const id of [...this.#waiting.keys()]) this.#answer(id, { ok: false, text: "The connection was lost." });
    const wait_s = WAITS_S[Math.min(this.#attempt, WAITS_S.length - 1)] * (0.9 + 0.2 * Math.random());
    this.#attempt += 1;
    this.timer = setTimeout(() => this.#open(), wait_s * 1000);
    this.hasEnded ||= hasEnded;
    this.on.state({ isOpen: false, hasEnded: this.hasEnded, retryAt: performance.now() + wait_s * 1000 });
  }

  #openNow() {
    if (this.timer !== undefined) this.#open();
  }

  // Closes a connection that has been silent for too long.
  #watch() {
    const socket = this.#socket;
    const most = socket.readyState === WebSocket.CONNECTING ? OPENING_MS : SILENT_MS;
    if (this.timer !== undefined || performance.now() - this.#heard < most) return;
    socket.close();
    this.#closed(socket);
  }
}
