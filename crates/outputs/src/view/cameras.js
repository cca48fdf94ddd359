// Nine cameras that the page keeps: a digit takes one, Shift and the digit keep the present one. In: an eye with `kept`
// and `recall`. Out: the browser's storage of this page.

import { say } from "./words.js";

/** The time for which the page shows the result of a key (ms). */
const SHOWN = 2500;

export class Cameras {
  /**
   * `look` distinguishes the cameras of each look. `note` is an element for a sentence. `isWanted` returns true for an
   * event whose key may act.
   */
  constructor(eye, look, note, isWanted) {
    Object.assign(this, { eye, note, isWanted, name: `bench-dragon cameras ${look}`, timer: null });
    addEventListener("keydown", (event) => this.press(event));
  }

  press(event) {
    const { code, shiftKey, ctrlKey, metaKey, altKey, repeat, target } = event;
    const number = /^(?:Digit|Numpad)([1-9])$/.exec(code)?.[1];
    if (!number || ctrlKey || metaKey || altKey || repeat || target.closest?.("input, select, dialog") ||
        !this.isWanted(event)) return;
    const all = this.read();
    if (shiftKey) {
      const isKept = this.write({ ...all, [number]: this.eye.kept() });
      return this.tell(say(isKept ? "cameraKept" : "cameraUnkept", { number }));
    }
    const known = all[number], isTaken = known !== null && typeof known === "object" && this.eye.recall(known);
    this.tell(say(isTaken ? "cameraTaken" : "cameraEmpty", { number }));
  }

  read() {
    try {
      return JSON.parse(localStorage.getItem(this.name)) ?? {};
    } catch {
      // A browser without storage, or a text that is not this page's.
      return {};
    }
  }

  write(all) {
    try {
      localStorage.setItem(this.name, JSON.stringify(all));
      return true;
    } catch {
      return false;
    }
  }

  tell(sentence) {
    clearTimeout(this.timer);
    this.note.textContent = sentence;
    this.note.hidden = false;
    this.timer = setTimeout(() => (this.note.hidden = true), SHOWN);
  }
}
