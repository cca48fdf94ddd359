// Undo and redo: the texts of the scene, one a gesture. Kept in the browser, so that a reload or a crash loses nothing.
// In: texts. Out: earlier and later texts.

/** The letters of all kept texts together, and the texts. */
const MOST_LETTERS = 600_000, MOST_STEPS = 300;
/** The time after a change until it is stored (ms). */
const DELAY = 100;

export class History {
  constructor() {
    this.key = null;
    /** The texts, each with the time that the picture showed; the place of the present one. */
    this.steps = [];
    this.at = -1;
    this.gesture = null;
    this.timer = null;
    addEventListener("pagehide", () => this.store());
  }

  /**
   * Begins with the text of the server, whose `key` names it. Returns the text that was kept of it, or the server's. A
   * tab keeps its own text; a new tab continues the latest one. A text that was replaced on the server can be undone.
   */
  begin(key, text) {
    this.key = `bench-dragon design ${key}`;
    const kept = this.read(sessionStorage) ?? this.read(localStorage);
    if (kept) [this.steps, this.at] = [kept.steps, kept.at];
    else this.take(text, 0, null);
    if (kept && kept.base !== text) this.take(text, 0, null);
    this.base = text;
    return this.now;
  }

  get now() {
    return this.steps[this.at];
  }

  /** Adds the text after a gesture. Further texts of the same gesture replace it; null is always a new gesture. */
  take(text, time, gesture) {
    if (this.now?.text === text) return;
    const isSame = gesture !== null && gesture === this.gesture && this.at === this.steps.length - 1;
    this.gesture = gesture;
    if (isSame) this.steps[this.at] = { text, time };
    else {
      this.steps.splice(++this.at, Infinity, { text, time });
      let letters = this.steps.reduce((sum, step) => sum + step.text.length, 0);
      while (this.at > 0 && (letters > MOST_LETTERS || this.steps.length > MOST_STEPS)) {
        letters -= this.steps.shift().text.length;
        this.at--;
      }
    }
    this.later();
  }

  /** Goes a step back (-1) or on (1); returns its text and time, or null. */
  go(by) {
    if (!this.steps[this.at + by]) return null;
    this.at += by;
    this.gesture = null;
    this.later();
    return this.now;
  }

  can(by) {
    return Boolean(this.steps[this.at + by]);
  }

  later() {
    this.timer ??= setTimeout(() => this.store(), DELAY);
  }

  store() {
    clearTimeout(this.timer);
    this.timer = null;
    if (this.key === null) return;
    const { steps, at, base } = this;
    for (const storage of [sessionStorage, localStorage]) {
      try {
        storage.setItem(this.key, JSON.stringify({ steps, at, base }));
      } catch {
        // A browser without storage, or without room for all steps: the present text has more weight.
        try {
          storage.setItem(this.key, JSON.stringify({ steps: [this.now], at: 0, base }));
        } catch {
          // Nothing is kept; the page still has it.
        }
      }
    }
  }

  read(storage) {
    try {
      const kept = JSON.parse(storage.getItem(this.key)), { steps, at, base } = kept;
      const isStep = (step) => typeof step?.text === "string" && Number.isFinite(step.time);
      return Array.isArray(steps) && steps.every(isStep) && steps[at] && typeof base === "string" ? kept : null;
    } catch {
      return null;
    }
  }
}
