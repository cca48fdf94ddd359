// The pixels of the canvas: as many as the screen has, or fewer on the longer side where pictures take long.

/** The most pixels on the longer side of a canvas that is drawn too slowly. */
const MOST = 2560;
/** The time of a picture above which the canvas gets fewer pixels, and the longest that counts (ms). */
const SLOW = 25, LONGEST = 1000;
/** Pictures before the time is believed, and the share of each in the mean. */
const ENOUGH = 60, SHARE = 1 / 30;

export class Resolution {
  constructor() {
    this.clear();
  }

  /** Begins to measure, for example for another size of the window. */
  clear() {
    this.mean = this.pictures = 0;
    this.isLow = false;
  }

  /** Takes the time from one picture to the next, ms. */
  take(passed) {
    if (!(passed < LONGEST)) return;
    this.pictures++;
    this.mean += (passed - this.mean) * Math.max(SHARE, 1 / this.pictures);
    this.isLow ||= this.pictures >= ENOUGH && this.mean > SLOW;
  }

  /**
   * Returns the canvas's pixels for one of the page, where the screen has `ratio` and the picture is `width` x
   * `height`.
   */
  ratio(ratio, width, height) {
    return this.isLow ? Math.min(ratio, MOST / Math.max(width, height, 1)) : ratio;
  }
}
