// The look from a seat: the dragon as a spectator sees it, carried by dancers before a village at night. Boards and
// places are true; heights and people are ornament. In: a seat, the dragons' poses and their `Show`. Out: a canvas.
//
// Light on the floor and the bloom of lanterns are drawn at a quarter of the size and enlarged. The floor is paving
// times light, and is made again in every third picture, or for another seat.

import { boardSize } from "./boards.js";
import { drawFigure, headFigure, tailFigure } from "./dragon_figure.js";
import { STRIDE, speedOf } from "./hermite.js";
import { OfLight } from "./lantern_light.js";
import { behindHead } from "./lantern_view.js";
import { Cuts, ball, reflection } from "./seat_sprites.js";
import { BOARD, SeatView, seatOf } from "./seat_view.js";
import { blank, halo, hash, paving, pool } from "./sprites.js";
import { floorOf, frontRow, nightOf } from "./village.js";

/** The enlargement of light, and pictures from one floor to the next, and from one bloom to the next. */
const PART = 4, FLOOR_EVERY = 3, BLOOM_EVERY = 2;
/** The usual seat: its height, m, its distance as a multiple of the stage's reach, and the least distance, m. */
const HEIGHT = 4.4, DISTANCE = 1.9, LEAST_DISTANCE = 19;
/** The stage is measured again when the boards leave it by this share, or fill less than the other. */
const OUTGROWN = 1.25, LEAST_FILLED = 0.5;
/** A board's thickness, m; the lanterns of a board, as shares of half its length. */
const THICK = 0.06, ON_BODY = [-0.41, 0, 0.41], ON_HEAD = [-0.7, -0.44, -0.18];
/**
 * Pixels a metre from which lanterns, dancers, bars in place of dancers, boards and reflections are drawn. Smaller
 * lanterns are rectangles; smaller bars, boards and reflections are left out.
 */
const LANTERNS_FROM = 10, DANCERS_FROM = 14, BARS_FROM = 7, BOARDS_FROM = 9, WET_FROM = 20;
/** Steps a second of a dancer, and the distance beside the handle, m. */
const STEPS = 1.45, BESIDE = 0.2;
/** The pearl: metres ahead of the head's board, and its height. */
const PEARL = 1.35, PEARL_HEIGHT = 2.35;
/** The sparks of the head: a second of show time, and their life, s. */
const SPARKS = 60, SPARK_LIFE = 3.2;

/** Returns the box of all handles: its middle, to whole metres, and the reach from there. */
function stageOf(teams) {
  let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const { places } of teams) {
    for (let k = 0; k < places.length; k += STRIDE) {
      [left, right] = [Math.min(left, places[k]), Math.max(right, places[k])];
      [low, high] = [Math.min(low, places[k + 1]), Math.max(high, places[k + 1])];
    }
  }
  return { x: Math.round((left + right) / 2), y: Math.round((low + high) / 2),
      reach: Math.max(right - left, high - low) / 2 + 1 };
}

export class Seat {
  /** `given` has turns, distance and height, or fewer of them. */
  constructor(given = []) {
    const [turns = 0, distance = null, height = HEIGHT] = given;
    this.home = { turns, distance, height };
    this.cuts = new Cuts();
    this.kits = new OfLight((light) => ({
      ...light, pools: light.pools.map((one) => pool(...one)), halo: halo(...light.halo.map(String)),
          wet: reflection(light.wet),
    }));
    this.fire = this.kits.of(null);
    [this.gold, this.white, this.wet] = [halo("255,214,130", "255,140,44"), halo("255,250,232", "255,206,130"),
        reflection([255, 176, 76])];
    this.balls = {
      skin: ball("#ffb066", "#ea4a1c", "#b3160f"), gold: ball("#fffbe0", "#ffc040", "#b0620e"),
          white: ball("#ffffff", "#fff4cf", "#d8a050"),
      dark: ball("#5a1a10", "#260606", "#0a0202"), flame: ball("#fff0a0", "#ff7a1a", "#a02a06"),
    };
    this.slabs = paving();
    [this.light, this.bloom, this.ground] = Array.from({ length: 3 }, () => blank(1, 1, { alpha: false }));
    this.stage = { x: 0, y: 0, reach: 10 };
    this.measured = false;
    this.picture = 0;
    this.built = this.view = null;
    this.whole();
  }

  // The seat, which hands may change.

  whole() {
    this.seat = { ...this.home };
  }

  /** Moves around the stage, and up, by pixels of a picture that is dragged. */
  pan(x, y) {
    this.seat = seatOf({ ...this.taken, turns: this.seat.turns - x / 3000, height: this.seat.height + y / 60 });
  }

  zoomAt(by) {
    this.seat = seatOf({ ...this.taken, distance: this.taken.distance / by });
  }

  /** Returns the seat as it is kept. */
  kept() {
    return { ...this.taken };
  }

  recall({ turns, distance, height }) {
    if (![turns, distance, height].every(Number.isFinite)) return false;
    this.seat = seatOf({ turns, distance, height });
    return true;
  }

  /** The seat that is taken: a usual distance follows from the stage. */
  get taken() {
    return seatOf({ ...this.seat, distance: this.seat.distance ?? Math.max(LEAST_DISTANCE,
        DISTANCE * this.stage.reach) });
  }

  get key() {
    const { turns, distance, height } = this.seat;
    return [turns, distance, height].join();
  }

  /** Returns a place of the stage in pixels of the screen, at the height of the boards if there is no other. */
  toPixel(x, y, z = BOARD) {
    const at = this.view?.to(x, y, z);
    return at ? [at.x / this.ratio, at.y / this.ratio] : null;
  }

  /** Draws the dragons, each with `stage`, `places` and `show`. */
  draw(context, { ratio }, dragons) {
    this.ratio = ratio;
    const now = stageOf(dragons), { stage } = this, away = Math.hypot(now.x - stage.x, now.y - stage.y);
    if (!this.measured || away + now.reach > OUTGROWN * stage.reach ||
        now.reach < LEAST_FILLED * stage.reach) this.stage = now;
    this.measured = true;
    const view = (this.view = new SeatView(context.canvas, this.taken, this.stage)), isNew = this.build(view);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.imageSmoothingQuality = "low";
    const teams = dragons.map((dragon) => teamOf(view, dragon, this.kits.of(dragon.identity))),
        isBloom = isNew || this.picture % BLOOM_EVERY === 0;
    if (isNew || this.picture % FLOOR_EVERY === 0) this.layFloor(view, teams);
    if (isBloom) this.layBloom(view, teams);
    this.picture++;
    context.drawImage(this.ground[0], 0, 0);
    const things = teams.flatMap(({ things }) => things).sort((one, other) => other.depth - one.depth);
    for (const thing of things) thing.dancer ? this.dancer(context, view, thing) : this.bench(context, view, thing);
    for (const team of teams) this.sparks(context, view, team);
    this.enlarged(context, this.bloom[0], "screen", bloomBox(view, teams));
    context.drawImage(this.front, 0, view.height - this.front.height);
    this.dim(context, view, dragons);
  }

  /** Without frames the night falls with the lanterns. */
  dim(context, { width, height }, dragons) {
    const life = Math.max(...dragons.map(({ show }) => show.life));
    if (life === 1) return;
    context.fillStyle = `rgba(0,0,0,${1 - life})`;
    context.fillRect(0, 0, width, height);
  }

  /** Makes what stands still; returns true for another view. */
  build(view) {
    if (this.built === view.key) return false;
    this.built = view.key;
    const { width, height } = view, small = [Math.ceil(width / PART), Math.ceil(height / PART)];
    for (const [[canvas], [wide, high]] of [[this.light, small], [this.bloom, small], [this.ground, [width, height]]]) {
      if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    }
    this.floor = floorOf(view, this.slabs);
    this.night = nightOf(view, this.cuts.lantern(96, this.fire).canvas, this.fire.halo);
    this.front = frontRow(view);
    return true;
  }

  enlarged(context, canvas, how, [x, y, width, height]) {
    if (!(width > 0 && height > 0)) return;
    context.globalCompositeOperation = how;
    context.drawImage(canvas, x / PART, y / PART, width / PART, height / PART, x, y, width, height);
    context.globalCompositeOperation = "source-over";
  }

  spot(context, picture, x, y, wide, high, alpha) {
    context.globalAlpha = Math.min(1, alpha);
    context.drawImage(picture, x - wide, y - high, 2 * wide, 2 * high);
  }

  /** The floor in the light of the lanterns, below the night. */
  layFloor(view, teams) {
    const [, light] = this.light, [, context] = this.ground, top = PART * Math.max(0,
        Math.floor((this.night.height - 2) / PART)), box = [0, top, view.width, view.height - top];
    light.globalCompositeOperation = "source-over";
    light.globalAlpha = 1;
    light.fillStyle = "#0b0a10";
    light.fillRect(0, 0, view.width, view.height);
    light.globalCompositeOperation = "lighter";
    for (const team of teams) this.layLight(light, view, team);
    light.globalAlpha = 1;
    context.drawImage(this.floor, ...box, ...box);
    this.enlarged(context, this.light[0], "multiply", box);
    context.drawImage(this.night, 0, 0);
    // The dragon's light on the mist before the houses.
    context.globalCompositeOperation = "screen";
    for (const { middle, reach, life, kit } of teams) {
      if (!middle) continue;
      const radius = 1.5 * reach * middle.k;
      this.spot(context, kit.halo, middle.x, this.night.height, radius, 0.42 * radius, 0.3 * life);
    }
    context.globalAlpha = 1;
    context.globalCompositeOperation = "source-over";
  }

  /** The light of a team on the floor: its spill, a pool for each bench, the lanterns' reflections. */
  layLight(light, view, { things, middle, reach, life, kit }) {
    if (middle) {
      const radius = (2.3 * reach * middle.k) / PART;
      this.spot(light, kit.pools[0], middle.x / PART, middle.y / PART, radius, radius * view.flat(middle) * 1.15,
          0.34 * life);
    }
    const at = {};
    for (const { foot, bench, x, y, c, s, half, lit, burn, dancer } of things) {
      if (dancer || !lit) continue;
      const radius = (2.6 * foot.k) / PART;
      if (radius < 0.7 || foot.x < -4 * radius || foot.x > view.width + 4 * radius) continue;
      this.spot(light, kit.pools[bench % 3 ? 0 : 1], foot.x / PART, foot.y / PART, radius, radius * view.flat(foot),
          (bench ? 0.4 : 0.6) * lit * (1 + burn));
      if (foot.k < WET_FROM) continue;
      (bench ? ON_BODY : ON_HEAD).forEach((share, k) => {
        if (!view.to(x + share * half * c, y + share * half * s, -1.5, at)) return;
        this.spot(light, k === 1 ? this.wet : kit.wet, at.x / PART, (at.y + 0.23 * at.k) / PART, (0.17 * at.k) / PART,
            (0.95 * at.k) / PART, 0.26 * lit);
      });
    }
  }

  /** The bloom of what shines. */
  layBloom(view, teams) {
    const [canvas, context] = this.bloom, at = {}, thin = Math.min(1, Math.max(0.16, (1.5 * view.eye.z) / 19));
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = 1;
    context.fillStyle = "#000";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.globalCompositeOperation = "screen";
    const shine = (picture, x, y, z, metres, alpha) => {
      if (!view.to(x, y, z, at)) return;
      const radius = (metres * at.k) / PART;
      this.spot(context, picture, at.x / PART, at.y / PART, radius, radius, alpha);
    };
    for (const { things, show, kit } of teams) {
      for (const { dancer, bench, x, y, c, s, half, lit, burn } of things) {
        if (dancer || !lit) continue;
        const flicker = 1 + 0.1 * Math.sin(4.1 * show.flames + 2.4 * bench) * Math.sin(1.7 * show.flames + bench),
            alpha = 0.3 * thin * flicker * lit * (1 + 2.5 * burn);
        (bench ? ON_BODY : ON_HEAD).forEach((share, k) => {
          shine(burn > 0.05 ? this.white : k === 1 ? this.gold : kit.halo, x + share * half * c, y + share * half * s,
              BOARD + 0.3, 0.55 + 0.7 * burn, alpha);
        });
        if (bench) continue;
        const ahead = (metres) => [x + (half + metres) * c, y + (half + metres) * s];
        shine(this.white, ...ahead(PEARL), PEARL_HEIGHT, 1.3, 0.95 * lit);
        for (const [metres, reach] of [[-1.1, 1.3], [-0.7, 0.9], [-0.2, 0.7]]) shine(kit.halo, ...ahead(metres), 2.15,
            reach, 0.25 * lit);
        if (show.burst) shine(this.white, show.burst.place.x, show.burst.place.y, BOARD, 2 + 6 * show.burst.part,
            (1 - show.burst.part) ** 2);
      }
    }
    context.globalAlpha = 1;
  }

  dancer(context, view, { foot, k, yaw, show, lit }) {
    if (foot.k < DANCERS_FROM) {
      context.fillStyle = "#1c0b08";
      context.fillRect(foot.x - 0.15 * foot.k, foot.y - 1.6 * foot.k, 0.3 * foot.k, 1.6 * foot.k);
      return;
    }
    const phase = show.still ? 0.15 : (((STEPS * show.time) / 2 + 0.37 * k) % 1 + 1) % 1;
    this.stand(context, this.cuts.dancer(foot.k, k % 9 === 4 ? 2 : k % 2, yaw, phase), foot, lit);
  }

  /** Draws a picture that stands at a place, at whole pixels: enlarging it again would cost twice as much. */
  stand(context, { canvas, left, up }, { x, y }) {
    context.drawImage(canvas, Math.round(x - left), Math.round(y - up));
  }

  bench(context, view, thing) {
    const { bench, last, foot, x, y, c, s, half, show } = thing, isAway = view.leads(c, s),
        time = show.still ? 0 : show.time;
    if (foot.k > BOARDS_FROM) this.board(context, view, thing);
    const figure = bench === 0 ? () => headFigure(time) : bench === last ? () => tailFigure(time) : null,
        end = bench === 0 ? half - 1.1 : -half;
    const crown = () => figure && drawFigure(context, view, figure(), { x: x + end * c, y: y + end * s, c, s },
        this.balls);
    // The head is at the front of its board, the tail at the rear. On a board that leads away from the eye the head is
    // behind the lanterns, else the tail.
    const isBehind = isAway === (bench === 0);
    if (isBehind) crown();
    this.lanterns(context, view, thing, isAway);
    if (!isBehind) crown();
    if (bench === 0) this.pearl(context, view, thing, time);
  }

  /** A board: its top, the side that is seen, and a gilded edge. */
  board(context, view, { x, y, c, s, half, w, kit }) {
    const corner = (along, across, z) => view.to(x + along * c - across * s, y + along * s + across * c, z);
    const near = c * view.rightX + s * view.rightY > 0 ? -w : w, top = [[half, w], [-half, w], [-half, -w],
        [half, -w]].map(([along, across]) => corner(along, across, BOARD));
    const edge = [half, -half].map((along) => corner(along, near, BOARD)),
        under = [-half, half].map((along) => corner(along, near, BOARD - THICK));
    if (![...top, ...edge, ...under].every(Boolean)) return;
    for (const [points, colour] of [[top, kit.top], [[...edge, ...under], kit.side]]) {
      context.fillStyle = colour;
      context.beginPath();
      for (const point of points) context.lineTo(point.x, point.y);
      context.fill();
    }
    Object.assign(context, { strokeStyle: "rgba(255,190,90,.75)", lineWidth: Math.max(0.6, 0.012 * edge[0].k) });
    context.beginPath();
    for (const point of edge) context.lineTo(point.x, point.y);
    context.stroke();
  }

  /** The lanterns of a board, from the farthest on; unlit ones are dark. */
  lanterns(context, view, { bench, x, y, c, s, half, lit, burn, kit }, isAway) {
    const places = bench ? ON_BODY : ON_HEAD, at = {};
    for (let k = 0; k < places.length; k++) {
      const which = isAway ? places.length - 1 - k : k, share = places[which] * half, isGold = which === 1;
      if (!view.to(x + share * c, y + share * s, BOARD, at)) continue;
      context.globalAlpha = 0.12 + 0.88 * lit;
      if (at.k > LANTERNS_FROM) this.stand(context, this.cuts.lantern(at.k, isGold ? null : kit), at);
      else {
        context.fillStyle = isGold ? "#ffd070" : kit.paper[1];
        context.fillRect(at.x - 0.12 * at.k, at.y - 0.46 * at.k, Math.max(1, 0.25 * at.k), Math.max(1, 0.38 * at.k));
      }
      if (burn > 0.05) this.spot(context, this.white, at.x, at.y - 0.3 * at.k, 0.34 * at.k, 0.36 * at.k, burn * lit);
    }
    context.globalAlpha = 1;
  }

  pearl(context, view, { x, y, c, s, half, lit }, time) {
    const at = view.to(x + (half + PEARL) * c, y + (half + PEARL) * s, PEARL_HEIGHT + 0.12 * Math.sin(2.4 * time));
    if (!at) return;
    this.spot(context, this.balls.white, at.x, at.y, 0.17 * at.k, 0.17 * at.k, lit);
    context.globalAlpha = 1;
  }

  /** Sparks that rise from the head: each is a function of the show time, and begins where the head was. */
  sparks(context, view, { show, places, speed, kit }) {
    if (!(show.embers > 0) || show.life < 1) return;
    const at = {};
    context.globalCompositeOperation = "lighter";
    for (let spark = Math.floor(show.time * SPARKS); spark > (show.time - SPARK_LIFE) * SPARKS; spark--) {
      const age = show.time - spark / SPARKS, left = 1 - age / SPARK_LIFE, [x, y] = behindHead(places, age * speed);
      const turn = 2 * Math.PI * hash(spark + 1), drift = (0.1 + 0.4 * hash(spark + 2)) * age,
          up = (0.7 + 0.9 * hash(spark + 4)) * age;
      if (!view.to(x + Math.cos(turn) * drift + 0.25 * Math.sin(2.2 * age + turn), y + Math.sin(turn) * drift,
          2.4 + up, at)) continue;
      const radius = 1.6 * Math.max(1, (0.02 + 0.025 * hash(spark + 3)) * at.k) * (0.4 + 0.6 * left),
          alpha = left * show.embers * (0.55 + 0.45 * Math.sin(15 * show.time + spark));
      this.spot(context, left > 0.6 ? this.white : left > 0.3 ? this.gold : kit.halo, at.x, at.y, radius, radius,
          alpha);
    }
    context.globalAlpha = 1;
    context.globalCompositeOperation = "source-over";
  }
}

/** A dragon's benches and dancers that are in the picture, its middle and its reach, for a view. */
function teamOf(view, { stage, places, show }, kit) {
  const count = places.length / STRIDE - 1, things = [], speed = speedOf(places, 0);
  let [sumX, sumY] = [0, 0];
  for (let k = 0; k <= count; k++) {
    const at = STRIDE * k, link = STRIDE * Math.min(k, count - 1), [x, y] = [places[at], places[at + 1]];
    const dx = places[link] - places[link + STRIDE], dy = places[link + 1] - places[link + STRIDE + 1],
        long = Math.hypot(dx, dy) || 1, c = dx / long, s = dy / long;
    [sumX, sumY] = [sumX + x, sumY + y];
    const foot = view.to(x + BESIDE * s, y - BESIDE * c, 0), lit = show.lit(Math.min(k, count - 1), count);
    // The margin is wider than a dancer is.
    if (foot && foot.k >= BARS_FROM && isSeen(view, foot, 1)) things.push(
        { dancer: true, depth: foot.depth - 0.02, foot, k, yaw: view.facing(c, s), show, lit });
    if (k === count) break;
    const middle = [x - dx / 2, y - dy / 2], below = view.to(...middle, 0);
    if (!below || !isSeen(view, below, 4)) continue;
    const [half, w] = boardSize(stage, k).map((metres) => metres / 2);
    things.push({ dancer: false, depth: below.depth, foot: below, bench: k, last: count - 1, x: middle[0],
        y: middle[1], c, s, half, w, show, lit, burn: show.burning.get(k) ?? 0, kit });
  }
  const [x, y] = [sumX / (count + 1), sumY / (count + 1)];
  let reach = 1;
  for (let at = 0; at < places.length; at += STRIDE) reach = Math.max(reach,
      Math.hypot(places[at] - x, places[at + 1] - y));
  return { things, middle: view.to(x, y, 0), reach, show, places, kit, life: show.life,
      speed: Number.isFinite(speed) ? speed : 0 };
}

/** Returns true if a part of the circle of `metres` around a place is in the picture. */
function isSeen({ width, height }, { x, y, k }, metres) {
  return x > -metres * k && x < width + metres * k && y > -metres * k && y - 3.5 * k < height;
}

/** The part of the picture that bloom reaches: x, y, width and height. */
function bloomBox({ width, height }, teams) {
  let [left, top, right, bottom] = [width, height, 0, 0];
  for (const { foot, dancer, bench } of teams.flatMap(({ things }) => things)) {
    if (dancer) continue;
    const reach = (bench ? 2.6 : 9) * foot.k;
    [left, right, top, bottom] = [Math.min(left, foot.x - reach), Math.max(right, foot.x + reach),
        Math.min(top, foot.y - 1.2 * reach - 2 * foot.k), Math.max(bottom, foot.y)];
  }
  const down = (one, most) => PART * Math.floor(Math.min(most, Math.max(0, one)) / PART),
      up = (one, most) => Math.min(most, PART * Math.ceil(Math.max(0, one) / PART));
  const x = down(left, width), y = down(top, height);
  return [x, y, up(right, width) - x, up(bottom, height) - y];
}
