// The text of the scene: a text area with line numbers, marks of lines, and the error at its line. In: texts, errors,
// lines. Out: what the user types.

const element = (id) => document.getElementById(id);

export class SceneText {
  /** `typed` is called with the text, the time of the key (ms), and whether the typing begins another gesture. */
  constructor(typed) {
    this.area = element("scene-text");
    this.pane = this.area.parentElement;
    [this.gutter, this.shown, this.wrong] = ["gutter", "shown-line", "text-error"].map(element);
    this.lines = 0;
    this.line = this.errorLine = null;
    this.area.oninput = (event) => {
      this.number();
      typed(this.value, event.timeStamp, /^insertFromPaste|^insertFromDrop|^deleteByCut/.test(event.inputType ?? ""));
    };
    this.area.onscroll = () => this.place();
    new ResizeObserver(() => this.place()).observe(this.area);
  }

  get value() {
    return this.area.value;
  }

  /** Replaces the text and keeps what is in sight. */
  set(text) {
    const { area } = this;
    if (area.value === text) return;
    const { selectionStart: at, scrollTop, scrollLeft } = area;
    area.value = text;
    area.setSelectionRange(at, at);
    Object.assign(area, { scrollTop, scrollLeft });
    this.number();
  }

  number() {
    const lines = this.value.split("\n").length;
    if (lines !== this.lines) this.gutter.textContent = Array.from({ length: lines }, (_, k) => k + 1).join("\n");
    this.lines = lines;
    this.place();
  }

  get height() {
    return parseFloat(getComputedStyle(this.area).lineHeight);
  }

  /** Moves the numbers and the marks with the text. */
  place() {
    const { scrollTop } = this.area, top = parseFloat(getComputedStyle(this.area).paddingTop);
    const at = (line) => top + (line - 1) * this.height - scrollTop;
    this.gutter.style.transform = `translateY(${-scrollTop}px)`;
    this.shown.hidden = this.line === null;
    if (this.line !== null) this.shown.style.transform = `translateY(${at(this.line)}px)`;
    if (this.errorLine === null) return;
    const below = Math.min(at(this.errorLine + 1), this.area.clientHeight - this.wrong.offsetHeight);
    this.wrong.style.transform = `translateY(${Math.max(0, below)}px)`;
  }

  /** Shows an error at its line, or none. */
  error(error) {
    const { wrong } = this;
    wrong.hidden = !error;
    this.area.setAttribute("aria-invalid", Boolean(error));
    this.errorLine = error?.line ?? (error ? 1 : null);
    wrong.toggleAttribute("data-error", Boolean(error));
    if (error) {
      wrong.dataset.line = error.line ?? "";
      // The name of the file is not news here.
      const sentence = error.sentence.replace(/^.*?, line \d+: /, "");
      wrong.textContent = error.line ? `Line ${error.line}: ${sentence}` : sentence;
    }
    this.gutter.parentElement.style.setProperty("--error-line", this.errorLine ?? -1);
    this.place();
  }

  /** Marks a line and moves it into sight. */
  show(line) {
    this.line = line ?? null;
    if (this.line !== null) {
      const middle = (this.line - 0.5) * this.height, { area } = this, { scrollTop, clientHeight } = area;
      if (middle < scrollTop || middle > scrollTop + clientHeight) area.scrollTop = middle - clientHeight / 2;
    }
    this.place();
  }
}
