// Large numbers for a second screen: the state and the main numbers alone, as large as the window allows. Kept in the address
// (?large), so that a screen comes back with them.

import { put } from "./text.js";

const inAddress = () => new URLSearchParams(location.search).has("large");

export class Large {
  constructor(button, onChange) {
    this.button = button;
    this.onChange = onChange;
    button.addEventListener("click", () => this.toggle());
    this.#show(inAddress());
  }

  toggle() {
    const isLarge = !inAddress();
    history.replaceState(null, "", isLarge ? "?large" : location.pathname);
    this.#show(isLarge);
    this.onChange();
  }

  #show(isLarge) {
    document.body.classList.toggle("large", isLarge);
    this.button.setAttribute("aria-pressed", String(isLarge));
    put(this.button, isLarge ? "All panels" : "Large");
  }
}
