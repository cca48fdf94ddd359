// The transport state of one publisher: playing, paused, held, waiting for go, ended, or disconnected. In: the newest
// frame and the reason why none comes. Out: a sign, a word and a detail in the page's language. Draws nothing.

import { minutes, say } from "./words.js";

/** The states of playback by their numbers in a frame. */
const KINDS = ["playing", "paused", "held", "ended"];
const SIGNS = { playing: "▶", paused: "❚❚", held: "■", go: "▷❙", ended: "▣", lost: "◌" };
/** The words of a publisher that does not deliver, by the reason. */
const LOST = { server: "noServer", silent: "noFrames", noStage: "noStageYet", version: "otherVersion" };
/** The difference between a cue's time and that of a show that waits there, s. */
const AT_CUE = 1e-6;
/** The time for which the name of a passed cue is shown while the show plays (ms). */
const CUE_TIME = 6000;
/** The difference of two ends of a loop that are alike, s. */
const ALIKE = 0.5;

export class Transport {
  constructor() {
    this.kind = null;
    /** The reason of a disconnection: a key of the words, or the server's sentence; null while frames come. */
    this.reason = null;
    /** Words on what to do without a publisher; may be empty. */
    this.instead = "";
    /** The cue at which the show waits, or the cue that it has just passed. */
    this.cue = null;
    /** The moments of the latest change and of the latest passed cue, as this page saw them (ms). */
    this.since = this.cueAt = -Infinity;
    /** The last known rate of the run; 1 before the show has played. */
    this.pace = 1;
    this.frame = null;
    /** The wall seconds for which a looped show stands at its end; null if it is not known to begin again. */
    this.stand = null;
    /** The wall seconds of the last end that this page saw, and whether this page saw the present end begin. */
    this.seen = NaN;
    this.isWhole = false;
  }

  /**
   * Updates the state at a moment. `lost` is the reason why nothing comes, or null. `cueOf` finds a cue by its number.
   * `stand` is the scene's time at the end of a loop, s, or null.
   */
  look(now, newest, lost, cueOf, stand) {
    const before = this.key, was = this.kind;
    if (newest && newest.run !== this.frame?.run) [this.stand, this.seen] = [null, NaN];
    this.stand ??= stand;
    if (newest && newest.run !== this.frame?.run) this.pace = 1;
    if (newest?.scale > 0) this.pace = newest.scale;
    if (newest && !lost) this.pass(now, newest, cueOf);
    this.reason = lost;
    this.frame = newest;
    const waits = this.cue?.pauses && newest?.playback === 1 && Math.abs(newest.time - this.cue.time) < AT_CUE;
    this.kind = lost ? "lost" : waits ? "go" : KINDS[newest.playback] ?? "playing";
    if (was === "ended" && this.kind === "playing" && this.isWhole) this.learn((now - this.since) / 1000);
    if (this.key === before) return;
    // The end is timed only if its beginning was seen.
    this.isWhole = was === "playing" && this.kind === "ended";
    this.since = now;
  }

  /**
   * An option of the publisher may give another time than the scene; one end alone may have been cut short by a
   * command.
   */
  learn(seconds) {
    if (Math.abs(seconds - this.seen) < ALIKE) this.stand = seconds;
    this.seen = seconds;
  }

  /** Keeps the cue of a frame. A cue that passed before this page came, or in another epoch, is not announced. */
  pass(now, newest, cueOf) {
    const { frame } = this, isNext = frame?.run === newest.run && frame.epoch === newest.epoch;
    if (isNext && frame.cue === newest.cue && (this.cue || !newest.cue)) return;
    this.cue = newest.cue ? cueOf(newest.cue) : null;
    this.cueAt = isNext && newest.cue > frame.cue ? now : -Infinity;
  }

  /** Returns a value that changes with the state. */
  get key() {
    return [this.kind, this.reason, this.kind === "go" ? this.cue.number : ""].join();
  }

  get sign() {
    return SIGNS[this.kind];
  }

  get word() {
    return say(this.kind === "lost" ? LOST[this.reason] ?? "noPublisher" : `${this.kind}Word`);
  }

  /** Returns the detail at a moment. `keys`: whether commands are given by the "keys", by "touch" of the bar, or "none". */
  detail(now, keys) {
    const { kind, reason, frame, cue } = this, passed = minutes((now - this.since) / 1000),
        named = cue && say("cueNamed", cue);
    if (kind === "lost") return frame
        ? say("pictureFrom", { time: frame.time.toFixed(1), ago: minutes((now - frame.at) / 1000) })
        : [say(reason), this.instead].filter(Boolean).join("; ");
    if (kind === "held") return say(keys === "none" ? "sinceThen" : keys === "touch" ? "heldTouch" : "heldFor",
        { passed });
    if (kind === "go") return say("goDetail", { cue: named, passed });
    if (kind === "paused") return say("sinceThen", { passed });
    if (kind === "ended") {
      const time = frame.time.toFixed(1), left = this.stand - (now - this.since) / 1000;
      return this.isWhole && this.stand !== null ? say("endedAgain", { time, seconds: Math.max(0, Math.ceil(left)) })
          : say("endedAt", { time });
    }
    const rate = frame.scale === 1 ? "" : say("times", { rate: +frame.scale.toPrecision(3) });
    return [rate, cue && now - this.cueAt < CUE_TIME ? named : ""].filter(Boolean).join(" · ");
  }

  /** Returns the sentence for a screen reader. */
  get sentence() {
    if (this.kind === "lost") return say(this.reason === "silent" ? "noFramesNow" : this.reason);
    if (this.kind === "go") return say("goSpoken", { cue: say("cueNamed", this.cue) });
    return say(`${this.kind}Spoken`);
  }
}
