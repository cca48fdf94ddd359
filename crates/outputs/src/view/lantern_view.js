// Geometry of the lantern look: boards in pixels of the canvas, and the part of the picture that light reaches.

import { boardSize } from "./boards.js";
import { STRIDE, speedOf } from "./hermite.js";

/** The pearl's distance ahead of the head's board, m. */
const PEARL = 0.42;

/**
 * The camera in pixels of a canvas: `place` of a point of the stage, pixels a metre, and a key that changes with it.
 */
export function viewOf({ width, height }, camera) {
  const { ratio, scale, c, s } = camera, pixels = ratio * scale, [e, f] = camera.toPixel(0,
      0).map((one) => one * ratio);
  const matrix = { a: pixels * c, b: -pixels * s, e, f };
  return {
    width, height, pixels, c, s, matrix, key: [width, height, pixels, c, s, e, f].join(),
    place: (x, y) => [matrix.a * x + matrix.b * y + e, matrix.b * x - matrix.a * y + f],
    /**
     * The box of all boards and pearls and `metres` around it, at whole multiples of `grid` pixels, as x, y, width and
     * height.
     */
    around(teams, metres, grid = 4) {
      let [left, top, right, bottom] = [Infinity, Infinity, -Infinity, -Infinity];
      for (const { boards, pearl } of teams) {
        for (const { x, y } of pearl ? [...boards, pearl] : boards) {
          if (x < left) left = x;
          if (x > right) right = x;
          if (y < top) top = y;
          if (y > bottom) bottom = y;
        }
      }
      const reach = metres * pixels,
          down = (one, most) => grid * Math.floor(Math.min(most, Math.max(0, one - reach)) / grid),
          up = (one, most) => Math.min(most, grid * Math.ceil((one + reach) / grid));
      const x = down(left, width), y = down(top, height);
      return [x, y, up(right, width) - x, up(bottom, height) - y];
    },
  };
}

/**
 * A dragon's boards that light the picture, in pixels. A board has its middle, direction `c`, `s`, half the length
 * along it `dx`, `dy`, and the front handle `ax`, `ay`. A board also has the shares `lit` and `burn` to which its
 * lanterns are lit and burn white. The head, the tail and the pearl are added where they are among the boards. The
 * exposure is less for a coil, which has many lanterns to a square metre, than for a procession.
 */
export function boardsOf(view, dragon) {
  const { stage, places, show } = dragon, count = places.length / STRIDE - 1, boards = [], margin = 5 * view.pixels;
  let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let bench = 0; bench <= count; bench++) {
    const k = STRIDE * bench, x = places[k], y = places[k + 1];
    if (x < left) left = x;
    if (x > right) right = x;
    if (y < low) low = y;
    if (y > high) high = y;
    if (bench === count) break;
    const [ax, ay] = view.place(x, y), [bx, by] = view.place(places[k + STRIDE], places[k + STRIDE + 1]),
        cx = (ax + bx) / 2, cy = (ay + by) / 2;
    if (cx < -margin || cx > view.width + margin || cy < -margin || cy > view.height + margin) continue;
    const long = Math.hypot(ax - bx, ay - by) || 1, c = (ax - bx) / long, s = (ay - by) / long,
        [length, width] = boardSize(stage, bench), half = (length / 2) * view.pixels;
    boards.push({ bench, x: cx, y: cy, c, s, ax, ay, half, width, dx: half * c, dy: half * s,
        lit: show.lit(bench, count), burn: show.burning.get(bench) ?? 0 });
  }
  boards.count = count;
  const head = boards[0]?.bench === 0 ? boards[0] : null, tail = boards.at(-1)?.bench === count - 1 && count > 1
      ? boards.at(-1) : null;
  const ahead = head && head.half + PEARL * view.pixels, pearl = head && { x: head.x + ahead * head.c,
      y: head.y + ahead * head.s };
  const density = count / (0.785 * (right - left + 1) * (high - low + 1)),
      exposure = Math.min(0.8, Math.max(0.3, 0.34 / density));
  const speed = speedOf(places, 0);
  return { dragon, show, boards, head, tail, pearl, exposure, speed: Number.isFinite(speed) ? speed : 0 };
}

/** Returns the place on the dragon's body `metres` behind the head: where the head was. */
export function behindHead(places, metres) {
  const distance = (k) => Math.hypot(places[k] - places[k + STRIDE], places[k + 1] - places[k + STRIDE + 1]);
  let way = metres, k = 0, link = distance(0);
  while (way > link && k < places.length - 2 * STRIDE) [way, k, link] = [way - link, k + STRIDE, distance(k + STRIDE)];
  const share = Math.min(1, way / (link || 1));
  return [places[k] + (places[k + STRIDE] - places[k]) * share, places[k + 1] +
      (places[k + STRIDE + 1] - places[k + 1]) * share];
}
