// The second thumb of the time line: the stage at another time of the show. It sends no command, and the show continues.
// In: the publishers of the page. Out: the dragons at that time, with ghosts of earlier and later moments, for the
// drawing. The server computes the frames from the scene's text.

import { STRIDE } from "./hermite.js";
import { withWord } from "./address.js";
import { SpeedScale } from "./palette.js";
import { frameOf } from "./stream.js";
import { say } from "./words.js";

/** The seconds from the shown time to the ghosts before and after it. */
const APART = 10;
/** Simulated seconds of one key. */
const STEPS = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
/** The share of a step with Shift. */
const FINE = 0.1;
/** The least time between two changes of the address: browsers limit them (ms). */
const ADDRESS_INTERVAL = 300;
/** The time before a request is sent again to a server that has no scene or has gone (ms). */
const RETRY = 1000;

const element = (name) => document.getElementById(name);

/** The frames of one publisher's scene. One request is in flight; of later ones only the newest waits. */
class Source {
  constructor(publisher) {
    this.publisher = publisher;
    this.socket = null;
    this.id = 0;
    this.wanted = this.asked = this.shown = null;
  }

  /** Requests the frames of some moments, each with a `kind` and a `time`. */
  ask(moments) {
    this.wanted = moments;
    this.send();
  }

  /** Ends the connection, and forgets the frames. */
  close() {
    [this.wanted, this.asked, this.shown] = [null, null, null];
    if (this.socket) this.socket.onclose = null;
    this.socket?.close();
    this.socket = null;
  }

  send() {
    if (!this.wanted || this.asked) return;
    if (!this.socket) return this.open();
    if (this.socket.readyState !== WebSocket.OPEN) return;
    [this.asked, this.wanted, this.frames] = [this.wanted, null, []];
    this.socket.send(JSON.stringify({ id: ++this.id, times: this.asked.map(({ time }) => time) }));
  }

  open() {
    const { name } = this.publisher, address = new URL(`scrub?name=${encodeURIComponent(name)}`, import.meta.url);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = Object.assign(new WebSocket(address), { binaryType: "arraybuffer" });
    this.socket = socket;
    socket.onopen = () => this.send();
    socket.onclose = () => {
      this.socket = null;
      this.again();
    };
    socket.onmessage = ({ data }) => {
      // The page has the stage from its stream.
      if (typeof data === "string") return JSON.parse(data).type === "unknown" && this.again();
      const frame = frameOf(data, performance.now());
      if (!frame || frame.sequence !== this.id || !this.asked) return;
      this.frames.push({ ...this.asked[frame.tick], frame });
      if (frame.tick < this.asked.length - 1) return;
      [this.shown, this.asked] = [this.frames, null];
      this.send();
    };
  }

  /** Sends the unanswered request again, later. */
  again() {
    this.wanted ??= this.asked;
    this.asked = null;
    if (this.wanted) setTimeout(() => this.send(), RETRY);
  }

  /** True if the frames are those of an earlier run, and no request is on its way. */
  get isOld() {
    const run = this.publisher.newest?.run, { shown, asked, wanted } = this;
    return run !== undefined && !asked && !wanted && shown !== null && shown[0]?.frame.run !== run;
  }

  /** Returns the frames of the run that the page shows; null until they have come. */
  get current() {
    const { shown } = this;
    return shown?.[0]?.frame.run === this.publisher.newest?.run ? shown : null;
  }
}

export class Scrub {
  /** `at` is the time of the page's address; undefined for the live picture. */
  constructor(publishers, at) {
    this.sources = publishers.map((publisher) => new Source(publisher));
    /** The time that is shown, in seconds; null while the picture is live. */
    this.time = null;
    this.end = Infinity;
    this.addressAt = -Infinity;
    this.line = element("scrub-line");
    /** The dragons of the latest frames, by the live ones. */
    this.dragons = new Map();
    this.line.oninput = () => this.to(Number(this.line.value));
    element("live").onclick = () => this.live();
    addEventListener("keydown", (event) => this.press(event), { capture: true });
    if (at !== undefined) this.to(at);
  }

  get isOn() {
    return this.time !== null;
  }

  /** Shows a time, in seconds. */
  to(time) {
    // The address has the same digits, so that it shows the same frame.
    this.time = Math.round(1000 * Math.min(Math.max(0, time), this.end)) / 1000;
    for (const source of this.sources) source.ask(this.moments(source));
    document.documentElement.toggleAttribute("data-scrubbed", true);
    this.address();
  }

  /** Shows the live picture again. */
  live() {
    const hadFocus = element("scrubbed").contains(document.activeElement);
    this.time = null;
    this.dragons.clear();
    for (const source of this.sources) source.close();
    document.documentElement.toggleAttribute("data-scrubbed", false);
    this.address();
    element("scrubbed").hidden = true;
    // The button that had the focus is gone.
    if (hadFocus) this.line.focus();
  }

  /** The shown moment first, then the ghosts: earlier, later, and the next event of the show. */
  moments({ publisher: { stage } }) {
    const { time } = this, end = stage?.freeze_time ?? Infinity;
    const next = stage?.events.find((event) => event.time > time && event.time <= end);
    const ghosts = [{ kind: "before", time: time - APART }, { kind: "after", time: time + APART }].filter(
        (ghost) => ghost.time >= 0 && ghost.time <= end);
    return [{ kind: "shown", time }, ...ghosts, ...(next ? [{ kind: "event", event: next.event, time: next.time }] : [])];
  }

  address() {
    clearTimeout(this.later);
    const now = performance.now(), early = ADDRESS_INTERVAL - (now - this.addressAt);
    if (early > 0) return void (this.later = setTimeout(() => this.address(), early));
    this.addressAt = now;
    const hash = withWord(location.hash, "at", this.time);
    history.replaceState(null, "", hash || location.pathname + location.search);
  }

  /** Keys of the thumb; Escape anywhere. No other part of the page acts on these. */
  press(event) {
    const { key, target, shiftKey, ctrlKey, metaKey, altKey } = event;
    if (ctrlKey || metaKey || altKey) return;
    const take = (time) => {
      event.preventDefault();
      event.stopImmediatePropagation();
      if (time === null) this.live();
      else this.to(time);
    };
    if (key === "Escape" && this.isOn && !document.querySelector("dialog[open]")) return take(null);
    if (target !== this.line) return;
    if (key === "Home" || key === "End") return take(key === "Home" ? 0 : this.end);
    if (Object.hasOwn(STEPS, key)) take((this.time ?? Number(this.line.value)) + STEPS[key] * (shiftKey ? FINE : 1));
  }

  /** Updates the line and the words. `now` is the time of the live show of the first publisher. */
  update(now) {
    const ends = this.sources.map(({ publisher }) => publisher.stage?.freeze_time).filter((end) => end > 0);
    element("scrub").hidden = !ends.length;
    if (!ends.length) return;
    const end = Math.max(...ends);
    if (end !== this.end) {
      [this.end, this.line.max] = [end, end];
      // The events of the show are known now.
      if (this.isOn) this.to(this.time);
    }
    this.line.value = this.time ?? now;
    element("scrub-live").style.setProperty("--share", Math.min(1, now / end));
    const time = (this.time ?? now).toFixed(1);
    this.line.setAttribute("aria-valuetext", this.isOn ? say("notLive", { time }) : say("liveAt", { time }));
    element("scrubbed").hidden = !this.isOn;
    if (!this.isOn) return;
    // A new run of the show has frames of its own.
    for (const source of this.sources) if (source.isOld) source.ask(this.moments(source));
    const isThere = this.sources.some((source) => source.current);
    const words = say(isThere ? "notLive" : "notLiveYet", { time });
    if (element("scrub-time").textContent !== words) element("scrub-time").textContent = words;
  }

  /** Returns a dragon as it is at the shown time; the live one while that is not known. */
  of(dragon) {
    const current = this.sources.find(({ publisher }) => publisher === dragon.publisher)?.current;
    if (!this.isOn || !current) return dragon;
    const { frame } = current[0], known = this.dragons.get(dragon);
    if (known?.frame.of === frame) return known;
    const one = Object.create(dragon, {
      original: { value: dragon },
      sight: { value: { ...dragon.sight, stale: false } },
      lookKey: { value: () => [frame.run, frame.time, frame.sequence, dragon.path.reach, one.colours.step].join() },
    });
    const places = handlesOf(dragon, frame.handles), colours = new SpeedScale();
    Object.assign(one, { places, marks: [], frame: { ...frame, of: frame, handles: places } });
    colours.take(one.frame);
    colours.step = Math.max(colours.step, dragon.colours.step);
    one.colours = colours;
    one.measure();
    // The path of an earlier time may go further out.
    dragon.path = one.path;
    this.dragons.set(dragon, one);
    return one;
  }

  /** Returns the ghosts of a dragon: its places, a kind and words. */
  ghostsOf({ original }) {
    const current = this.sources.find(({ publisher }) => publisher === original?.publisher)?.current;
    if (!this.isOn || !current) return [];
    return current.slice(1).map(({ kind, event, frame }) => ({
      kind, places: handlesOf(original, frame.handles),
      text: original.own(kind === "event" ? say("ghostEvent", { kind: say(event), time: frame.time.toFixed(1) })
          : say(kind === "before" ? "ghostBefore" : "ghostAfter", { seconds: APART })),
    }));
  }

  /** For tests and measurements: the shown time and the handles of the first publisher; null while it is live. */
  report() {
    const frame = this.isOn ? this.sources[0].current?.[0].frame : null;
    return frame ? { time: frame.time, state: frame.state, handles: frame.handles } : null;
  }
}

/** The handles of a dragon among those of all dragons of its show. */
function handlesOf({ first, stage, isOnly }, all) {
  return isOnly ? all : all.subarray(STRIDE * first, STRIDE * (first + stage.benches + 1));
}
