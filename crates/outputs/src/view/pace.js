// The pace of a costly look: pictures in motion, or a still that is renewed, on a computer that draws too slowly. Knows
// no canvas and no page.

/**
 * Milliseconds a picture from which the look is a still, below which it moves again, and from one still to the next.
 */
const SLOW = 100, FAST = 60, RENEWED = 4000;
/** The pictures over which the mean is taken, in motion and of stills. */
const MOVING = 20, STILLS = 3;
/** The most that one picture counts, ms: a page that was hidden has drawn nothing for a while. */
const MOST = 400;

export class Pace {
  constructor() {
    this.isStill = false;
    /** The mean time of a picture, ms, and the moment of the last one. */
    this.mean = FAST / 2;
    this.drawnAt = -Infinity;
    this.isOpen = false;
  }

  /** Begins a pass of the page. Returns true if a picture is due. */
  begin(now) {
    if (this.isOpen) {
      this.mean += (Math.min(MOST, now - this.drawnAt) - this.mean) / (this.isStill ? STILLS : MOVING);
      this.isStill = this.mean > (this.isStill ? FAST : SLOW);
    }
    this.isOpen = false;
    return !this.isStill || now - this.drawnAt > RENEWED;
  }

  /** A picture has been drawn in the pass that began at `now`. */
  drawn(now) {
    [this.drawnAt, this.isOpen] = [now, true];
  }

  /** Pictures a second, and seconds from one still to the next. */
  get rate() {
    return 1000 / this.mean;
  }

  get seconds() {
    return RENEWED / 1000;
  }
}
