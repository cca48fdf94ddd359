// The session with the server: requests over one WebSocket, which opens again whenever it breaks. In: changes of the
// scene, times, plans. Out: the server's messages, to the functions of a listener. Knows no element of the page.

import { token } from "../conduct.js";
import { frameOf } from "../stream.js";

/** The time limit of the answer to a change, and of a frame, after which the next request is sent (ms). */
const PATIENCE = 10_000, FRAME_PATIENCE = 1000;
/** Changes whose times are kept for measurements. */
const KEPT_TIMES = 1000;

export class Session {
  /**
   * `listener` has a function for each message of the server: hello, allowed, offer (the first scene, or its error),
   * stage, frame, refused, events, facts, progress, plan and cancelled. It also has lost, for a broken connection.
   */
  constructor(listener) {
    this.listener = listener;
    this.id = 0;
    /** The change without an answer, and the changes that wait for that answer. */
    this.inFlight = null;
    this.waiting = [];
    /** The time of the picture without an answer, and the time that waits. */
    this.atInFlight = this.wantedAt = null;
    /** The id of the newest accepted change: results of earlier ones are dropped. */
    this.accepted = 0;
    /** The times of the last changes, ms: when each began, was drawn, and had its events and facts. */
    this.times = new Map();
    /** The stages and frames so far; true while they are of a scene that the page does not show. */
    this.stages = this.frames = 0;
    this.isForeign = false;
    this.retry = 250;
    this.open();
  }

  open() {
    const address = new URL("session", import.meta.url);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = (this.socket = new WebSocket(address));
    socket.binaryType = "arraybuffer";
    this.isOffered = false;
    socket.onopen = () => (this.retry = 250);
    socket.onmessage = ({ data }) => (typeof data === "string" ? this.receive(JSON.parse(data)) : this.draw(data));
    socket.onclose = () => {
      [this.inFlight, this.waiting, this.atInFlight, this.wantedAt] = [null, [], null, null];
      this.listener.lost();
      setTimeout(() => this.open(), this.retry);
      this.retry = Math.min(4000, 2 * this.retry);
    };
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  greet(hello) {
    if (hello.token && token !== null) this.socket.send(JSON.stringify({ token }));
    this.listener.hello(hello);
  }

  /** Sends a request at once; returns its id. */
  send(request) {
    const id = ++this.id;
    this.socket.send(JSON.stringify({ id, ...request }));
    return id;
  }

  /**
   * Changes the scene. One change is in flight, and a waiting one is replaced by a newer one with the same `key`.
   * `done` is called with the new scene, or with null and the error.
   */
  change(request, key, done) {
    if (!this.isOpen) return;
    const last = this.waiting.at(-1), next = { request, key, done, began: performance.now() };
    if (last && last.key === key) this.waiting[this.waiting.length - 1] = next;
    else this.waiting.push(next);
    this.proceed();
  }

  proceed() {
    if (this.inFlight && performance.now() - this.inFlight.sent < PATIENCE) return;
    const next = this.waiting.shift();
    this.inFlight = next ?? null;
    if (!next) return;
    next.sent = performance.now();
    next.id = this.send(next.request);
    this.times.set(next.id, { began: next.began });
    this.times.delete(next.id - KEPT_TIMES);
  }

  /** Drops the changes that wait, and the answer to the one in flight: another text follows. */
  forget() {
    this.waiting = [];
    if (this.inFlight) this.inFlight.done = () => null;
  }

  /** Sets the time that the picture shows. */
  at(time) {
    if (this.atInFlight !== null && performance.now() - this.atInFlight < FRAME_PATIENCE) return (this.wantedAt = time);
    if (!this.isOpen) return;
    [this.atInFlight, this.wantedAt] = [performance.now(), null];
    this.send({ at: time });
  }

  /** Notes the time at which something of a change happened. */
  note(id, what) {
    const times = this.times.get(id);
    if (times) times[what] ??= performance.now();
  }

  receive(message) {
    const { listener, inFlight } = this, { id } = message;
    if (message.hello) return this.greet(message.hello);
    if (id === 0 && !this.isOffered && (message.scene || message.error)) {
      this.isOffered = true;
      this.isForeign = !listener.offer(message);
      return;
    }
    if (message.allowed !== undefined) return listener.allowed(message.allowed);
    if (message.type === "stage") return this.stage(message);
    if (message.scene || message.error) {
      if (id !== inFlight?.id) return message.error && listener.refused(id, message.error);
      this.inFlight = null;
      if (message.scene) [this.accepted, this.isForeign] = [id, false];
      inFlight.done(message.scene ?? null, message.error ?? null);
      return this.proceed();
    }
    for (const kind of ["events", "facts"]) {
      if (!message[kind] || id < this.accepted) continue;
      if (message[kind].state === "exact") this.note(id, kind);
      listener[kind](message[kind], id);
    }
    if (message.progress !== undefined) listener.progress(id, message.progress);
    if (message.plan) listener.plan(id, message.plan, message.text ?? null);
    if (message.cancelled) listener.cancelled(id);
  }

  /** Numbers the stages: the frames that follow one are of that stage. */
  stage(message) {
    this.stages++;
    if (!this.isForeign) this.listener.stage({ ...message, run_id: String(this.stages) });
  }

  draw(data) {
    const frame = frameOf(data, performance.now());
    this.atInFlight = null;
    if (frame && !this.isForeign) this.listener.frame({ ...frame, run: String(this.stages), sequence: ++this.frames });
    if (this.wantedAt !== null) this.at(this.wantedAt);
  }
}
