// Stop, pause, hold, spring, faults to practise, replay: sends actions and shows the answers.

import { duration, put } from "./text.js";

const $ = (id) => document.getElementById(id);

export class Controls {
  constructor(model, connection) {
    this.model = model;
    this.connection = connection;
    this.isDragging = false;
    const on = (id, action) => $(id).addEventListener("click", () => this.act(action()));
    on("stop", () => ({ do: "stop" }));
    on("pause-run", () => ({ do: this.#is("paused") ? "resume" : "pause" }));
    on("hold", () => ({ do: this.#is("held") ? "release" : "hold" }));
    on("clear-fault", () => ({ do: "clear_fault" }));
    on("spring-release", () => ({ do: "set_spring", force_n: 0 }));
    $("spring-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const force_n = $("spring-force").valueAsNumber;
      if (Number.isFinite(force_n)) this.act({ do: "set_spring", force_n });
    });
    this.#listenToFaults();
    this.#listenToReplay();
  }

  #is = (activity) => this.model.state?.activity === activity;

  async act(action) {
    this.#say("", "quiet");
    const { ok, text } = await this.connection.act(action);
    this.#say(text || (ok ? "Done." : "Refused."), ok ? "good" : "bad");
  }

  #say(text, tone) {
    clearTimeout(this.timer);
    put($("answer"), text);
    $("answer").dataset.tone = tone;
    if (tone === "good") this.timer = setTimeout(() => put($("answer"), ""), 6000);
  }

  #listenToFaults() {
    $("inject").addEventListener("submit", (event) => {
      event.preventDefault();
      this.act({ do: "inject", fault: { kind: "sensor", sensor: $("inject-sensor").value, how: $("inject-how").value || null } });
    });
    for (const button of $("inject").querySelectorAll("[data-fault]")) {
      const { fault } = button.dataset;
      const on = button.dataset.on === "true";
      const isSupply = fault === "sensors" || fault === "amplifier";
      const what = isSupply ? { kind: "supply", supply: fault, on } : { kind: fault, on };
      button.addEventListener("click", () => this.act({ do: "inject", fault: what }));
    }
  }

  #listenToReplay() {
    const replay = (what) => this.act({ do: "replay", ...what });
    $("replay-play").addEventListener("click", () => replay({ paused: !this.model.state?.replay?.paused }));
    $("replay-speed").addEventListener("change", () => replay({ speed: Number($("replay-speed").value) }));
    const time = $("replay-time");
    time.addEventListener("input", () => {
      this.isDragging = true;
      this.#clock(Number(time.value));
    });
    time.addEventListener("change", () => {
      this.isDragging = false;
      replay({ to_s: Number(time.value) });
    });
  }

  // Shows what this viewer may do; after each snapshot.
  allow() {
    const { source } = this.model;
    const mayControl = source.can_control && this.connection.token !== null;
    $("controls").hidden = !mayControl;
    $("spring-form").hidden = !mayControl;
    $("panel-inject").hidden = !(source.can_inject && mayControl);
    $("replay").hidden = !source.is_replay;
    put($("hint"), mayControl ? "" : ["View only.", source.where_to_stop].filter(Boolean).join(" "));
    $("hint").hidden = mayControl;
  }

  draw() {
    const { state } = this.model;
    const label = (id, isOn, on, off) => put($(id), isOn ? on : off);
    label("pause-run", this.#is("paused"), "Resume run", "Pause run");
    label("hold", this.#is("held"), "Release point", "Hold point");
    $("clear-fault").disabled = state.fault === null || this.#is("over");
    $("pause-run").disabled = ["idle", "over", "replay"].includes(state.activity);
    $("hold").disabled = !["running", "held"].includes(state.activity);
    put($("injected"), state.injected.length > 0 ? `Now: ${state.injected.join(", ")}.` : "No fault is injected.");
    $("injected").dataset.tone = state.injected.length > 0 ? "warn" : "quiet";
    if (state.replay !== null) this.#replay(state.replay);
  }

  #replay(replay) {
    put($("replay-play"), replay.paused ? "Play" : "Pause");
    const time = $("replay-time");
    time.max = String(Math.max(replay.end_s, 0.01));
    if (!this.isDragging) {
      time.value = String(replay.t_s);
      this.#clock(replay.t_s);
    }
    const speed = $("replay-speed");
    if (document.activeElement !== speed) {
      let option = [...speed.options].find((o) => Number(o.value) === replay.speed);
      if (option === undefined) {
        option = new Option(String(replay.speed));
        speed.append(option);
      }
      option.selected = true;
    }
  }

  #clock(t_s) {
    put($("replay-clock"), `${duration(t_s)} of ${duration(this.model.state?.replay?.end_s ?? null)}`);
    $("replay-time").setAttribute("aria-valuetext", $("replay-clock").textContent);
  }

  // Keyboard: S goes to the stop button.
  focusStop() {
    if (!$("controls").hidden) $("stop").focus();
  }
}
