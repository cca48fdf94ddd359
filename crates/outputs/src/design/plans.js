// The searches: least pitch, least turn, greatest speed, proof, hand-outs. In: clicks, progress and answers. Out:
// requests; a text that the user uses, or a file.

const element = (id) => document.getElementById(id);

export class Plans {
  /** `session` sends requests; `use` is called with the text of a result, `keep` with a file. */
  constructor(session, use, keep) {
    Object.assign(this, { session, use, keep, running: null, text: null, varied: [] });
    for (const button of document.querySelectorAll("[data-plan], [data-action=sheets]")) button.onclick = () => this.start(button);
    element("plan-stop").onclick = () => this.stop();
    element("plan-use").onclick = () => {
      const { text } = this;
      this.clear();
      use(text);
    };
    element("plan-discard").onclick = () => this.clear();
    this.clear();
    this.vary([]);
  }

  start(button) {
    if (this.running !== null) this.stop();
    if (!this.session.isOpen) return;
    this.clear();
    // Hand-outs have a list of their forms.
    const plan = button.dataset.plan ?? element("sheets-form").value;
    this.running = this.id = this.session.send(plan === "fit" ? { plan, vary: this.varied } : { plan });
    this.put(`${button.textContent} …`, { isRunning: true });
    element("plan-progress").removeAttribute("value");
  }

  /** Names the fields that a fit changes: those that are marked. */
  vary(names) {
    this.varied = names;
    const fit = element("plan-fit");
    fit.disabled = names.length === 0;
    fit.textContent = names.length > 1 ? `Fit ${names.length} numbers` : `Fit ${names[0] ?? ""}`.trim();
  }

  stop() {
    if (this.running !== null && this.session.isOpen) this.session.send({ cancel: true });
    this.clear("Stopped.");
  }

  progress(id, share) {
    if (id === this.running) element("plan-progress").value = share;
  }

  /** Shows a result; with a text it can be used, and a file is kept. */
  result(id, { sentence, status, list }, text, file) {
    if (id !== this.running) return;
    this.running = null;
    if (file) this.keep(file);
    this.text = text;
    const lines = [sentence ?? status ?? "No result.", ...(list ?? []).map((one) => one.sentence ?? "")];
    this.put(lines.filter(Boolean).join("\n"), { hasText: text !== null, isDone: true });
  }

  /** Shows the reason of a refusal. Returns true for the running search. */
  refuse(id, { sentence }) {
    if (id !== this.running) return false;
    this.running = null;
    this.put(sentence, { isDone: true });
    return true;
  }

  /** The server has stopped a search, since the text has changed. */
  cancelled(id) {
    if (id === this.running) this.clear("Stopped: the text has changed.");
  }

  /** Drops a result of a text before the change `accepted`. */
  outdate(accepted) {
    if (!element("plan-discard").hidden && this.id < accepted) this.clear();
  }

  /** A search of an earlier text is over. */
  clear(sentence = "") {
    this.running = this.text = null;
    this.put(sentence, {});
  }

  put(sentence, { isRunning = false, isDone = false, hasText = false }) {
    element("plan-answer").textContent = sentence;
    element("plan-progress").hidden = element("plan-stop").hidden = !isRunning;
    element("plan-use").hidden = !hasText;
    element("plan-discard").hidden = !isDone;
  }
}
