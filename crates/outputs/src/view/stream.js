// The stream: receives frames, stage and alerts, reconnects by itself, and interpolates where everything is
// between two frames. Knows nothing of the page.

import { HermiteReader } from "./hermite.js";

const VERSION = 3;
const HEADER_BYTES = 72;
/** The number of `playing` among the states of playback. */
const PLAYING = 0;
/** Frames that are kept: half a second of the most that come, and more than the longest gap of the slowest. */
const KEPT_FRAMES = 64;
/** More frames a second than this make no motion smoother once it is interpolated. */
const MOST_FRAMES = 125;
/** Frames further apart than this (ms) are shown one after another: the motion between them is not known. */
const LONGEST_GAP = 1000;
/** The clock is requested this often (ms); a server that has not answered by the next time is gone. */
const CLOCK_INTERVAL = 5000;
/** The window of the past (ms) from which the jitter of the frames is estimated. */
const JITTER_WINDOW = 2000;

/** A frame, as the server's layout has it. Null for a layout of another version. */
function frameOf(data, at) {
  const bytes = new DataView(data);
  if (data.byteLength < HEADER_BYTES || bytes.getUint8(0) !== VERSION) return null;
  return {
    at,
    state: bytes.getUint8(1),
    playing: bytes.getUint8(2) === PLAYING,
    playback: bytes.getUint8(2),
    time: bytes.getFloat64(8, true),
    scale: bytes.getFloat64(16, true),
    sequence: Number(bytes.getBigUint64(24, true)),
    run: String(bytes.getBigUint64(32, true)),
    sent: Number(bytes.getBigUint64(40, true)) / 1e6,
    tick: Number(bytes.getBigUint64(48, true)),
    clearance: bytes.getFloat32(56, true),
    epoch: bytes.getUint32(60, true),
    handles: new Float32Array(data, HEADER_BYTES),
  };
}

/**
 * Milliseconds of wall time from one frame to the next. Simulated time has no jitter; where it stands still, jumps or
 * changes its rate, the moments at which the two were sent have to do.
 */
function elapsed(from, to) {
  const even = from.playing && to.playing && from.epoch === to.epoch && from.scale === to.scale && to.time > from.time;
  return even ? (1000 * (to.time - from.time)) / to.scale : Math.max(0, to.sent - from.sent);
}

/** The last frames, and a clock that runs evenly a little behind them however unevenly they come. */
class Playback {
  constructor() {
    this.reader = new HermiteReader(KEPT_FRAMES);
    this.clear();
  }

  clear() {
    this.reader.clear();
    this.offsets = [];
    this.earliest = this.lag = this.shown = NaN;
    this.interval = 50;
    this.isPaced = false;
    this.drawnAt = 0;
  }

  get newest() {
    return this.reader.newest;
  }

  push(frame) {
    const last = this.newest;
    if (last && (last.run !== frame.run || last.handles.length !== frame.handles.length)) this.clear();
    // The frame's place on the clock of the publisher: wall time since the first frame that came.
    frame.due = this.newest ? last.due + elapsed(last, frame) : 0;
    this.reader.push(frame);
    this.offsets.push({ at: frame.at, offset: frame.at - frame.due });
    while (this.offsets[0].at < frame.at - JITTER_WINDOW) this.offsets.shift();
    const offsets = this.offsets.map((one) => one.offset).sort((a, b) => a - b);
    this.earliest = offsets[0];
    const spread = offsets[Math.floor(0.95 * (offsets.length - 1))] - offsets[0];
    const { frames } = this.reader, count = Math.min(frames.length, 16);
    this.isPaced = count > 1;
    if (this.isPaced) this.interval = (frame.due - frames.at(-count).due) / (count - 1);
    this.lag = Math.min(this.interval, LONGEST_GAP) + Math.min(spread, 100);
  }

  /** The show's time now, in seconds, as far as the newest frame reaches or a little further. */
  time(now) {
    const { newest } = this;
    if (!newest.playing) return newest.time;
    return newest.time + (Math.min(now - this.earliest - newest.due, this.interval) * newest.scale) / 1000;
  }

  /** What to draw now: see `HermiteReader.at`. `into` is used again. */
  at(now, into) {
    const { frames } = this.reader;
    const passed = Math.min(now - this.drawnAt, 1000), target = now - this.earliest - this.lag;
    this.drawnAt = now;
    const error = target - this.shown - passed;
    // A small error is worked off unseen.
    this.shown = Math.abs(error) < 300 ? this.shown + passed + error * Math.min(1, passed / 300) : target;
    const after = frames.findIndex((frame) => frame.due > this.shown);
    const tooFar = after > 0 && frames[after].due - frames[after - 1].due > LONGEST_GAP;
    return this.reader.at(tooFar ? frames[after].due : this.shown, into);
  }
}

/** The server's stream, opened again whenever it breaks. */
export class Stream {
  /** The stream of a publisher; of the server's only one where `name` is null. */
  constructor(name = null) {
    this.name = name;
    this.playback = new Playback();
    this.messages = { stage: {}, alert: {} };
    /** Why no frames come: a key of the page's words, or the server's own reason; null while they come. */
    this.trouble = "server";
    this.received = 0;
    /** How long the last frames were on their way, ms. */
    this.ways = [];
    /** What the clock of the frames is ahead of this page's, ms; null while unknown, and always of another machine's frames. */
    this.clock = null;
    /** Called with each message that is no frame and no clock. */
    this.onmessage = null;
    this.retry = 250;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const whose = this.name === null ? "" : `&name=${encodeURIComponent(this.name)}`;
    const socket = new WebSocket(`${scheme}://${location.host}/frames?rate=${MOST_FRAMES}${whose}`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let requested = null, nearest = Infinity;
    const again = () => {
      clearInterval(requests);
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close();
      this.lose("server");
      setTimeout(() => this.open(), this.retry);
      this.retry = Math.min(4000, 2 * this.retry);
    };
    const requestClock = () => {
      // Without waiting for the socket to close: a machine that was switched off never closes it.
      if (requested !== null || socket.readyState !== WebSocket.OPEN) return again();
      requested = performance.now();
      socket.send("clock");
    };
    let requests = setInterval(requestClock, CLOCK_INTERVAL);
    socket.onclose = again;
    socket.onopen = () => {
      this.retry = 250;
      this.trouble = "publisher";
      requestClock();
    };
    socket.onmessage = ({ data }) => {
      if (typeof data !== "string") return this.receive(data);
      const message = JSON.parse(data);
      if (message.type === "clock") {
        // The shortest round trip bounds the offset between the two clocks best.
        const now = performance.now(), way = now - requested;
        requested = null;
        if (message.monotonic_ns === null) {
          // No publisher, or one on another machine: what may have been measured of its frames so far was wrong.
          [nearest, this.clock] = [Infinity, null];
          this.ways.length = 0;
        } else if (this.clock === null || way <= nearest) {
          nearest = way;
          this.clock = Number(message.monotonic_ns) / 1e6 - (now - way / 2);
        }
      } else this.handle(message);
      if (message.type === "stage" && requested === null) {
        // Another publisher may have another clock. The answer has as long as any other.
        clearInterval(requests);
        requests = setInterval(requestClock, CLOCK_INTERVAL);
        requestClock();
      }
    };
  }

  /** What was shown last is kept until there is something newer to show. The next frames may be of another clock. */
  lose(trouble) {
    this.trouble = trouble;
    this.clock = null;
  }

  /** Sends a message; whether there is a server to send it to. */
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  handle(message) {
    this.onmessage?.(message);
    if (message.type === "waiting") this.lose(message.reason ?? "publisher");
    if (this.messages[message.type]) this.messages[message.type].newest = message;
  }

  receive(data) {
    const frame = frameOf(data, performance.now());
    if (!frame) return this.lose("version");
    if (this.trouble !== null) this.playback.clear();
    this.trouble = null;
    this.received++;
    if (this.clock !== null && this.ways.push(frame.at + this.clock - frame.sent) > 600) this.ways.shift();
    this.playback.push(frame);
  }

  /** The stage of the run whose frames came last, if it is known. */
  get stage() {
    return this.ofRun("stage");
  }

  /** The latest alert of that run, or null. */
  get alert() {
    return this.ofRun("alert");
  }

  /** Messages of the next run may come before its first frame: until then those of the last one are kept. */
  ofRun(type) {
    const run = this.playback.newest?.run, { newest, kept } = this.messages[type];
    if (newest && newest.run_id === run) return (this.messages[type].kept = newest);
    return kept && kept.run_id === run ? kept : null;
  }
}
