// One publisher: its stream, its situation, its transport, and the dragons of its show, which share them. In: the name
// of the publisher. Out: for each picture the present poses and marks of its dragons. Knows the words for marks, no
// canvas.

import { ownerOf } from "./boards.js";
import { Dragon } from "./dragon.js";
import { Nearest, Overlap, marksOf } from "./marks.js";
import { Stream } from "./stream.js";
import { Transport } from "./transport.js";
import { benchIn, benchesIn, capital, remaining, say } from "./words.js";

/** The situation without anything to show. */
const WAITING = { name: "waiting", severity: "ok", happened: false, sentence: null };
/** A state that the server does not list is shown as one without danger. */
const UNKNOWN = { ...WAITING, name: "unknown" };
/** The time without frames after which the page reports silence (ms). */
const SILENCE = 2000;
/** The number of `ended` among the states of playback. */
const ENDED = 3;
/** Milliseconds between the frames of the slowest publisher. */
const LONGEST_PERIOD = 10_000;

/**
 * Returns the time at which the head reaches the end of the path, if the show gets there and no counted event is
 * before.
 */
function pathEnd(stage, alert) {
  const end = stage.events.findLast(({ event, time }) => event === "path_end" && time <= stage.freeze_time);
  return end && alert?.event == null ? end.time : NaN;
}

export class Publisher {
  /**
   * `name` is written before its words if there are `several` publishers; `show` selects the show look, `still` stops
   * its motion. `stream` delivers its frames.
   */
  constructor(name, { several, show, still }, stream = new Stream(several ? name : null)) {
    Object.assign(this, { name, several, look: { show, still }, stream });
    this.transport = new Transport();
    this.overlap = new Overlap();
    this.nearest = new Nearest();
    /** At least one, so that there is a dragon to wait for. */
    this.dragons = [new Dragon(this, this.look)];
    /** The handles of all dragons at the moment of the picture, and the two frames around it. */
    this.places = this.shown = null;
    this.run = this.team = this.epoch = null;
    /** The age of the frames in the last pictures, ms; the frames a second, NaN until they have been counted. */
    this.latency = [];
    this.rate = NaN;
    this.counted = 0;
    this.state = WAITING;
    this.sight = null;
  }

  get stage() {
    return this.stream.stage;
  }

  get newest() {
    return this.stream.playback.newest;
  }

  /** Returns true if there is something to draw. */
  get isThere() {
    return Boolean(this.newest && this.stage);
  }

  /** Returns a word or a sentence of the picture, after the publisher's name if there are several. */
  own(words) {
    return this.several ? `${this.name}: ${words}` : words;
  }

  /**
   * Returns the situation: the state, the next event, the seconds of wall time until then at the last known rate, and
   * whether the show stands.
   */
  situation(now) {
    const { playback, stage, alert, trouble } = this.stream, { newest } = playback,
        silence = newest ? now - newest.at : 0;
    const patience = Math.max(SILENCE, 3 * (playback.isPaced ? playback.interval : LONGEST_PERIOD));
    const silent = !trouble && newest && silence > patience ? Math.floor(silence / 1000) : null;
    const lost = trouble ?? (newest && stage ? null : "noStage");
    const current = lost ? WAITING : stage.states[newest.state] ?? UNKNOWN;
    const stand = this.stream.facts?.loop_stand ?? null;
    this.transport.instead = this.instead(lost);
    this.transport.look(now, newest, lost ?? (silent === null ? null : "silent"), (number) => this.cueOf(number),
        stand);
    let [seconds, ahead] = [NaN, null];
    if (!lost && silent === null && newest.playback !== ENDED && !current.happened) {
      ahead = alert?.event ?? "path_end";
      seconds = ((alert?.event_time ?? pathEnd(stage, alert)) - playback.time(now)) / this.transport.pace;
    }
    const stale = Boolean(lost) || silent !== null, stands = !newest?.playing;
    return { state: current, alert, trouble: lost, silent, stale, seconds, ahead, stands, stage, now: "" };
  }

  /** Returns a cue of the run by its number; null for one that is not known. The stage has the first cues only. */
  cueOf(number) {
    const { stage, cue } = this.stream, passed = cue?.number === number ? { ...cue, time: cue.cue_time } : null;
    return stage?.cues.find((one) => one.number === number) ?? passed;
  }

  /**
   * Updates the situation and the dragons, and sets `struck`: true if something has just happened. Returns true for
   * another scene, for which earlier choices do not fit.
   */
  update(now) {
    const before = this.state, { playback } = this.stream, { newest, stage } = this;
    this.sight = this.situation(now);
    this.state = this.sight.state;
    this.struck = false;
    if (!this.isThere) return false;
    playback.reader.setStage(stage);
    this.shown = playback.at(now, this.places);
    this.places = this.shown.handles;
    const isOther = this.run !== newest.run && this.begin(stage, newest);
    this.dragons.forEach((dragon) => dragon.place(newest, this.places));
    this.mark(now, stage.states[newest.state] ?? UNKNOWN);
    const happened = this.state.happened && this.state.severity === "error";
    this.struck = happened && before !== WAITING && before.name !== this.state.name;
    const lighting = { now, sight: this.sight, alert: this.stream.alert, happened, shown: this.shown,
        epoch: this.epoch };
    this.dragons.forEach((dragon) => dragon.light(lighting));
    this.epoch = this.shown.from.epoch;
    return isOther;
  }

  /** Another run: perhaps other dragons, paths and speeds. */
  begin(stage, newest) {
    const look = JSON.stringify({ ...stage, run_id: null, scene: null, scene_hash: null, proved: null });
    const isOther = this.team !== null && this.team !== look;
    [this.team, this.run] = [look, newest.run];
    this.dragons = stage.dragons.map((_, k) => this.dragons[k] ?? new Dragon(this, this.look));
    this.dragons.forEach((dragon, k) => dragon.begin(stage, k));
    return isOther;
  }

  /** Gives each dragon its part of the marks. The place of a mark, its line and its words are with its first bench. */
  mark(now, known) {
    const { newest, dragons } = this, { alert } = this.stream, reach = Math.max(...dragons.map((one) => one.reach));
    const isBad = known.happened && known.severity !== "ok";
    const deepest = isBad ? this.overlap.look(dragons, newest, reach, now) : null;
    const { stage, shown } = this;
    const near = this.look.show ? [] : this.nearest.look(dragons, newest, { stage, shown, now });
    this.sight.now = deepest && !this.sight.trouble ? this.overlapWords(deepest) : "";
    // Marks are for the crew; an audience sees lanterns that burn white.
    const all = this.look.show ? [] : this.named(marksOf({ state: known, alert, dragons, overlap: deepest, near }),
        deepest);
    for (const dragon of dragons) {
      dragon.marks = all.flatMap((mark) => {
        const isOwn = dragon === (ownerOf(dragons, mark.pair[0]) ?? dragons[0]);
        const names = mark.names.filter((_, k) => ownerOf(dragons, mark.pair[k]) === dragon);
        const pair = mark.pair.filter((number) => ownerOf(dragons, number) === dragon).map(
            (number) => number - dragon.first);
        if (isOwn) return [{ ...mark, pair, names }];
        return pair.length ? [{ ...mark, pair, names, place: null, line: null, text: undefined }] : [];
      });
    }
  }

  /** Words for the marks, in the page's language. */
  named(marks, deepest) {
    const { seconds } = this.sight, { stage } = this, { alert } = this.stream;
    const time = seconds > -1 ? remaining(Math.max(0, seconds)).join(" ") : null;
    for (const mark of marks) {
      mark.names = mark.pair.map((number) => this.own(benchIn(stage, number)));
      if (mark.kind === "coming") mark.text = this.own(this.comingWords(alert, time));
      if (mark.line) mark.text = this.own(this.distanceWords(mark));
      if (mark.kind === "overlap") mark.text = this.own(this.overlapWords(deepest));
    }
    return marks;
  }

  /** The coming event of an alert; `time` is the time until then in words, or null. */
  comingWords({ event, event_bench_a, event_bench_b }, time) {
    const numbers = [event_bench_a, event_bench_b].filter((number) => number !== null);
    const values = { kind: say(event), benches: numbers.length ? benchesIn(this.stage, numbers) : "", time };
    return say(time === null ? "comingStill" : "coming", values);
  }

  /** The length of a line; with the names of its dragons if there are several, and of its obstacle. */
  distanceWords({ place, benches = [], obstacle }) {
    const parts = [...new Set(benches.map((number) => ownerOf(this.dragons, number).part))].filter(Boolean);
    const of = parts.length > 1 ? say("both", { a: parts[0], b: parts[1] }) : parts[0] ?? "";
    const keepOut = obstacle?.keep_out ?? 0, distance = (metres) => say("distance", { metres: metres.toFixed(3) });
    const metres = distance(place.away + keepOut);
    let to = obstacle ? say("distanceTo", { metres, to: say("theObstacle", obstacle) }) : metres;
    if (keepOut > 0) to = say("distanceBeyond", { to, metres: distance(place.away) });
    return of ? say("distanceOf", { distance: to, of }) : to;
  }

  overlapWords({ pair, depth }) {
    const benches = benchesIn(this.stage, pair);
    return depth < 0.0005 ? say("touchNow", { benches }) : say("overlapNow", { benches, metres: depth.toFixed(3) });
  }

  /** Measures the age of the frame in the picture that has just been drawn, if the clock is known. */
  drawn() {
    const { clock } = this.stream, { from, to, time } = this.shown;
    if (clock === null) this.latency.length = 0;
    if (clock === null || from === to) return;
    const part = (time - from.time) / (to.time - from.time);
    this.latency.push(performance.now() + clock - (from.sent + (to.sent - from.sent) * part));
    if (this.latency.length > 600) this.latency.shift();
  }

  /** Counts the frames since the last call, `ms` ago. */
  count(passed) {
    const { received } = this.stream;
    this.rate = ((received - this.counted) * 1000) / passed;
    this.counted = received;
  }

  /** Returns the shows that run here instead of this publisher, or how to start it; empty where that is not known. */
  instead(lost) {
    const { running } = this.stream;
    if (lost !== "publisher" || !running) return "";
    return running.length ? say("runningHere", { names: running.join(", ") }) : say("startOne", { name: this.name });
  }

  /** Returns the reason why no frames come, after the first frame; empty while they come. */
  notice() {
    const { newest, sight } = this, stopped = sight.trouble ?? (sight.silent === null ? null : "silent");
    if (!stopped || !this.isThere) return "";
    const words = { server: "lostServer", silent: "silent" }[stopped] ?? "lostPublisher";
    const { instead } = this.transport, further = instead ? ` ${capital(instead)}.` : "";
    return this.own(say(words, { seconds: sight.silent, time: newest.time.toFixed(1) }) + further);
  }
}
