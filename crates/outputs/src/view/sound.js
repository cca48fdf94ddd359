// Sound: a tick at three, two and one second, a gong at an event. Made from sines; off by default.

/** Overtones of a gong, over its lowest; they beat against each other. */
const GONG = [1, 1.48, 1.52, 2.31, 2.74, 3.87, 5.12];

export class Sound {
  constructor() {
    this.context = null;
    this.on = false;
    this.second = Infinity;
    /** For tests: the played sounds. */
    this.played = [];
  }

  /** Browsers allow sound only after a key or a click, unless they were started with another setting. */
  turn(on) {
    this.on = on;
    if (!on) return;
    this.context ??= new AudioContext();
    this.context.resume();
  }

  /** `seconds` of wall time until the event; no countdown if not finite. */
  count(seconds) {
    const second = seconds > 0 && seconds <= 3 ? Math.ceil(seconds) : Infinity;
    if (this.on && second < this.second) this.tick(second);
    this.second = second;
  }

  tick(second) {
    this.played.push(String(second));
    this.tone(second === 1 ? 1320 : 880, 0.25, 0.12);
  }

  strike() {
    if (!this.on) return;
    this.played.push("gong");
    GONG.forEach((overtone, k) => this.tone(86 * overtone, 0.3 / (k + 1), 5 / (1 + 0.4 * k)));
  }

  tone(frequency, loud, seconds) {
    const { context } = this, now = context.currentTime, gain = context.createGain(), tone = context.createOscillator();
    tone.frequency.value = frequency;
    gain.gain.setValueAtTime(0, now);
    gain.gain.linearRampToValueAtTime(loud, now + 0.008);
    gain.gain.exponentialRampToValueAtTime(1e-4, now + seconds);
    tone.connect(gain).connect(context.destination);
    tone.start(now);
    tone.stop(now + seconds);
  }
}
