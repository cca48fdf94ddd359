// The lantern look: dragons at night, seen from above, in the light of their own lanterns. The boards stay the true
// rectangles; the rest is ornament. In: a camera, the dragons' poses and their `Show`. Out: a canvas. No pixel beyond
// the light is other than black.
//
// Light is drawn small and enlarged: pools on the ground at an eighth of the size, halos at a quarter. The ground is
// paving times light, and is made again in every fourth picture, or for another camera; so are the halos.

import { headPicture, tailPicture } from "./dragon_head.js";
import { STRIDE } from "./hermite.js";
import { OfLight } from "./lantern_light.js";
import { behindHead, boardsOf, viewOf } from "./lantern_view.js";
import {
  CLOTHES, POOL_RADIUS, barrel, blank, box, dancer, halo, hash, paving, pool, shrunk, turned,
} from "./sprites.js";

/** The enlargement of the light on the ground, and of the halos. */
const GROUND = 8, AIR = 4;
/** Pixels a metre from which lanterns are drawn one by one, and dancers and slabs. */
const FINE = 22, CLOSE = 16;
/** The lanterns of a board, as shares of half its length: on the body's red, gold, red. */
const ON_BODY = [-0.41, 0, 0.41], ON_HEAD = [-0.7, -0.44, -0.18, 0.09];
/** The reach of halos from the middle of a board. */
const HALO_REACH = 1.6;
/** Pictures from one ground to the next, and from one picture of the halos to the next, which is made between. */
const LIGHT_EVERY = 4;
/** The step of the sizes in which sprites are cut. */
const SIZES = 1.06;
/** Handles of a line of light that is drawn at once. */
const THREAD = 60;
/** The moonlight, and the daylight of a light theme, on stone. */
const MOON = [26, 34, 58], DAY = [214, 206, 192];
/** The sparks of the head: a second of show time, their life, s. */
const SPARKS = 46, SPARK_LIFE = 2.6;

const step = (angle, count, span) => ((Math.round((angle * count) / span) % count) + count) % count;

/** Returns the box around two boxes of x, y, width and height. */
function union([x, y, width, height], [ox, oy, wide, high]) {
  const left = Math.min(x, ox), top = Math.min(y, oy);
  return [left, top, Math.max(x + width, ox + wide) - left, Math.max(y + height, oy + high) - top];
}

export class Lanterns {
  /** `moon` and `day` select a light besides the lanterns'; a `transparent` picture has no ground. */
  constructor({ transparent, moon, day }) {
    this.transparent = transparent;
    this.ambient = day ? DAY : moon ? MOON.map((one) => one / 2) : null;
    this.kits = new OfLight((light) => ({
      ...light, pools: light.pools.map((one) => pool(...one)), halo: halo(light.core.join(), light.glow.join()),
          barrel: barrel(light.barrel),
    }));
    this.fire = this.kits.of(null);
    this.gold = halo("255,226,150", "255,160,60");
    this.white = halo("255,252,240", "255,214,150");
    [this.box, this.people] = [box(), CLOTHES.map((one) => dancer(...one))];
    [this.head, this.tail, this.slabs] = [headPicture(), tailPicture(), paving()];
    this.air = blank(1, 1);
    [this.light, this.floor, this.ground] = Array.from({ length: 3 }, () => blank(1, 1, { alpha: false }));
    this.picture = 0;
    this.paved = this.lighted = null;
    /** The lit part of the last ground, and the part that differs from the canvas. */
    this.part = this.renewed = [0, 0, 0, 0];
    this.cut = new Map();
  }

  /** Draws the dragons, each with `stage`, `places` and `show`. */
  draw(context, camera, dragons) {
    const view = viewOf(context.canvas, camera),
        teams = dragons.map((dragon) => ({ ...boardsOf(view, dragon), kit: this.kits.of(dragon.identity) }));
    const isOther = this.lighted !== view.key, isNew = isOther || this.picture % LIGHT_EVERY === 0;
    const isAir = isOther || this.picture % LIGHT_EVERY === 2;
    this.lighted = view.key;
    this.picture++;
    view.fine = view.pixels >= FINE;
    this.fit(view);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.imageSmoothingQuality = "low";
    if (this.transparent) context.clearRect(0, 0, view.width, view.height);
    else {
      if (isNew) this.layGround(view, teams);
      this.enlarge(context, this.ground[0], 1, this.renewed);
    }
    if (isAir) this.layAir(view, teams);
    for (const team of teams) this.boards(context, view, team);
    if (view.pixels >= CLOSE) for (const team of teams) this.dancers(context, view, team);
    this.blend(context, "lighter", () => this.enlarge(context, this.air[0], AIR, view.around(teams, HALO_REACH)));
    for (const team of teams) this.lamps(context, view, team);
    for (const team of teams) this.crown(context, view, team);
    this.blend(context, "lighter", () => teams.forEach((team) => this.sparks(context, view, team)));
  }

  fit(view) {
    for (const [[canvas], share] of [[this.light, GROUND], [this.air, AIR], [this.ground, 1], [this.floor, 1]]) {
      const [width, height] = [Math.ceil(view.width / share), Math.ceil(view.height / share)];
      if (canvas.width === width && canvas.height === height) continue;
      Object.assign(canvas, { width, height });
      this.paved = null;
    }
  }

  blend(context, how, draw) {
    context.globalCompositeOperation = how;
    draw();
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = 1;
  }

  /** Draws a part of a canvas `share` times as large. */
  enlarge(context, canvas, share, [x, y, width, height]) {
    if (width > 0 && height > 0) context.drawImage(canvas, x / share, y / share, width / share, height / share, x, y,
        width, height);
  }

  spot(context, picture, x, y, radius, alpha) {
    context.globalAlpha = Math.min(1, alpha);
    context.drawImage(picture, x - radius, y - radius, 2 * radius, 2 * radius);
  }

  /** The paving as the camera sees it. From far, slabs are a grey, without moire. */
  pave(view) {
    if (this.paved === view.key) return;
    this.paved = view.key;
    const [, context] = this.floor, { canvas, perMetre } = this.slabs;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = "#7c7772";
    if (view.pixels >= CLOSE) {
      const pattern = context.createPattern(canvas, "repeat"), { c, s } = view, part = view.pixels / perMetre;
      pattern.setTransform(new DOMMatrix([part * c, -part * s, part * s, part * c, ...view.place(0, 0)]));
      context.fillStyle = pattern;
      context.imageSmoothingQuality = "high";
    }
    context.fillRect(0, 0, view.width, view.height);
  }

  /** The ground: paving times light, black where no light falls. */
  layGround(view, teams) {
    this.pave(view);
    this.layLight(view, teams);
    const [, context] = this.ground, whole = [0, 0, view.width, view.height],
        part = this.ambient ? whole : view.around(teams, POOL_RADIUS + 1.2, GROUND);
    // Beyond the light both are black already.
    this.renewed = this.filled === view.key ? union(this.part, part) : whole;
    [this.part, this.filled] = [part, view.key];
    context.fillStyle = "#000";
    if (this.renewed.some((one, k) => one !== part[k])) context.fillRect(...this.renewed);
    this.enlarge(context, this.floor[0], 1, part);
    this.blend(context, "multiply", () => this.enlarge(context, this.light[0], GROUND, part));
  }

  /** The light on the ground: a pool for each bench, one for the pearl, and what is left behind the tail. */
  layLight(view, teams) {
    const [canvas, context] = this.light, metre = view.pixels / GROUND;
    context.fillStyle = this.ambient ? `rgb(${this.ambient.join(" ")})` : "#000";
    context.fillRect(0, 0, canvas.width, canvas.height);
    this.blend(context, "screen", () => {
      for (const { boards, show, exposure, dragon, pearl, head, kit } of teams) {
        if (!view.fine) {
          this.thread(context, view, GROUND, dragon, 2.4, 1.6, `rgba(${kit.spill},${0.2 * exposure})`);
          this.thread(context, view, GROUND, dragon, 1.1, 1.2, `rgba(${kit.lit},${0.36 * exposure})`);
        } else {
          const radius = Math.max(POOL_RADIUS * metre, 3);
          for (const { bench, x, y, lit, burn } of boards) this.spot(context, kit.pools[bench % 3 ? 0 : 1], x / GROUND,
              y / GROUND, radius, exposure * lit * (bench ? 1 : 1.3) * (1 + 1.4 * burn));
        }
        for (const one of show.trail) {
          const [x, y] = view.place(one.x, one.y), left = Math.max(0, 1 - (show.time - one.time) / 4);
          this.spot(context, kit.pools[0], x / GROUND, y / GROUND, 2.2 * metre,
              0.3 * left ** 1.5 * show.lit(boards.count - 1, boards.count));
        }
        if (!head) continue;
        this.spot(context, this.fire.pools[1], pearl.x / GROUND, pearl.y / GROUND, 2.6 * metre, 0.75 * head.lit);
        this.spot(context, kit.pools[0], (head.x + 1.1 * view.pixels * head.c) / GROUND,
            (head.y + 1.1 * view.pixels * head.s) / GROUND, 3 * metre, 0.6 * head.lit);
        if (show.burst) this.spot(context, this.fire.pools[1], ...view.place(show.burst.place.x,
            show.burst.place.y).map((one) => one / GROUND), 4.5 * metre, (1 - show.burst.part) ** 2);
      }
    });
    if (view.pixels < 12) return;
    // Shadows below boards and dancers, which the enlarging makes soft.
    Object.assign(context, { strokeStyle: "rgba(0,0,0,.62)", lineWidth: 0.42 * metre });
    for (const { boards } of teams) this.lines(context, boards, 1 / GROUND, 0);
  }

  /** A line of light through the handles, for lanterns too far to be drawn one by one; at least `least` pixels wide. */
  thread(context, view, share, { places, show }, wide, least, colour) {
    const count = places.length / STRIDE, { a, b, e, f } = view.matrix;
    context.setTransform(a / share, b / share, b / share, -a / share, e / share, f / share);
    Object.assign(context,
        { strokeStyle: colour, lineJoin: "round", lineWidth: Math.max(wide, (least * share) / view.pixels) });
    for (let first = 0; first < count - 1; first += THREAD) {
      context.globalAlpha = show.lit(first, count);
      context.beginPath();
      for (let k = first; k <= Math.min(count - 1, first + THREAD); k++) context.lineTo(places[STRIDE * k],
          places[STRIDE * k + 1]);
      context.stroke();
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
  }

  /** Halos of the lanterns, which light boards and dancers too. */
  layAir(view, teams) {
    const [canvas, context] = this.air, metre = view.pixels / AIR, usual = Math.max(0.62 * metre, 1.8);
    context.clearRect(0, 0, canvas.width, canvas.height);
    this.blend(context, "lighter", () => {
      for (const { boards, show, dragon, head, pearl, kit } of teams) {
        const { flames } = show;
        if (!view.fine) {
          this.thread(context, view, AIR, dragon, 0.9, 1.8, `rgba(${kit.glow},.09)`);
          this.thread(context, view, AIR, dragon, 0.4, 1, `rgba(${kit.thread},.13)`);
        } else {
          for (const { bench, x, y, dx, dy, lit, burn } of boards) {
            if (!lit) continue;
            const flicker = 1 + 0.1 * Math.sin(4.1 * flames + 2.4 * bench) * Math.sin(1.7 * flames + bench),
                radius = usual * (1 + 1.2 * burn);
            const alpha = 0.62 * flicker * lit * (1 + burn);
            (bench ? ON_BODY : ON_HEAD).forEach((at, k) => {
              const place = [(x + at * dx) / AIR, (y + at * dy) / AIR, radius];
              if (burn < 1) this.spot(context, k === 1 ? this.gold : kit.halo, ...place, alpha * (1 - burn));
              if (burn > 0) this.spot(context, this.white, ...place, alpha * burn);
            });
          }
        }
        if (!head) continue;
        this.spot(context, this.gold, pearl.x / AIR, pearl.y / AIR, Math.max(1.1 * metre, 5), 0.9 * head.lit);
        this.spot(context, kit.halo, (head.x + 1.15 * view.pixels * head.c) / AIR,
            (head.y + 1.15 * view.pixels * head.s) / AIR, 1.5 * metre, 0.55 * head.lit);
        if (show.burst) this.burst(context, view, show.burst);
      }
    });
  }

  /** One flash, then the calm light of the lanterns that burn white. */
  burst(context, view, { place, part }) {
    const [x, y] = view.place(place.x, place.y), size = Math.min(view.width, view.height) / AIR, left = (1 - part) ** 2;
    this.spot(context, this.white, x / AIR, y / AIR, size * (0.12 + 0.5 * Math.sqrt(part)), left);
    this.spot(context, this.gold, x / AIR, y / AIR, size * (0.06 + 0.2 * part), left);
  }

  lines(context, boards, share, inset) {
    for (const { x, y, c, s, half, lit } of boards) {
      if (!lit) continue;
      const long = half - inset;
      context.beginPath();
      context.moveTo((x - long * c) * share, (y - long * s) * share);
      context.lineTo((x + long * c) * share, (y + long * s) * share);
      context.stroke();
    }
  }

  /** The true rectangles: a lit edge, lacquer, a worn middle. */
  boards(context, view, { boards, dragon, kit }) {
    const edge = Math.max(0.02 * view.pixels, 0.9);
    context.globalAlpha = Math.min(1, dragon.show.life * 1.5);
    for (const width of new Set(boards.map((board) => board.width))) {
      const alike = boards.filter((board) => board.width === width), wide = width * view.pixels;
      const coats = wide > 7 ? [[kit.edge, wide, 0], ["#1c0605", wide - 2 * edge, edge]] : [["#3d0f0a", wide, 0]];
      if (wide > 24) coats.push(["#2c0a07", 0.46 * wide, edge + 0.02 * view.pixels]);
      for (const [strokeStyle, lineWidth, inset] of coats) {
        Object.assign(context, { strokeStyle, lineWidth });
        this.lines(context, alike, 1, inset);
      }
    }
    context.globalAlpha = 1;
  }

  /** Sprites of a size in pixels, cut once for sizes that are nearly equal. */
  sprites(name, radius, make) {
    const size = SIZES ** Math.round(Math.log(radius) / Math.log(SIZES)), key = `${name} ${size}`;
    // A camera that zooms goes through many sizes.
    if (!this.cut.has(key) && this.cut.size > 40) this.cut.clear();
    if (!this.cut.has(key)) this.cut.set(key, make(size));
    return this.cut.get(key);
  }

  dancers(context, view, { boards, show }) {
    const people = this.sprites("dancers", 0.32 * view.pixels, (size) =>
        this.people.map((one) => turned(one, size, 32, 2 * Math.PI)));
    for (const { bench, c, s, ax, ay, lit } of boards) {
      if (!lit) continue;
      const sway = show.still ? 0 : 0.12 * Math.sin(5.2 * show.time + 1.7 * bench);
      const one = people[bench === 0 || bench % 9 === 4 ? 2 : bench % 2][
          step(Math.atan2(s, c) + sway, 32, 2 * Math.PI)];
      if (lit < 1) context.globalAlpha = lit;
      context.drawImage(one, Math.round(ax - one.width / 2), Math.round(ay - one.width / 2));
    }
    context.globalAlpha = 1;
  }

  lamps(context, view, { boards, dragon, kit }) {
    if (!view.fine) {
      const half = Math.max(0.13 * view.pixels, 1.2);
      context.fillStyle = kit.dot;
      for (const { x, y, lit, burn } of boards) {
        context.globalAlpha = lit;
        const size = half * (1 + burn);
        context.fillRect(x - size, y - size, 2 * size, 2 * size);
      }
      context.globalAlpha = 1;
      return;
    }
    const radius = Math.max(0.5 * Math.min(0.3, dragon.stage.width) * view.pixels, 2.2);
    const [round] = this.sprites(`barrel ${kit.number}`, radius, (size) => turned(kit.barrel, size, 1, 1)),
        boxes = this.sprites("box", radius, (size) => turned(this.box, size, 16, Math.PI / 2));
    for (const { bench, x, y, c, s, dx, dy, lit, burn } of boards) {
      if (!lit) continue;
      (bench ? ON_BODY : ON_HEAD).forEach((at, k) => {
        const one = k === 1 ? boxes[step(Math.atan2(s, c), 16, Math.PI / 2)] : round;
        context.globalAlpha = lit;
        context.drawImage(one, Math.round(x + at * dx - one.width / 2), Math.round(y + at * dy - one.width / 2));
        if (burn > 0) this.blend(context, "lighter", () => this.spot(context, this.white, x + at * dx, y + at * dy,
            1.7 * radius, burn * lit));
      });
    }
    context.globalAlpha = 1;
  }

  /** The head behind its pearl, and the tail. */
  crown(context, view, { head, tail, pearl, show }) {
    const size = Math.max(1.3 * view.pixels, 26);
    const place = (name, board, end, turn, picture) => {
      const { long, wide, front } = picture, one = this.sprites(name, size, (pixels) => shrunk(picture, pixels));
      const c = board.c * Math.cos(turn) - board.s * Math.sin(turn), s = board.s * Math.cos(turn) + board.c *
          Math.sin(turn);
      context.setTransform(c, s, -s, c, board.x + end * board.dx, board.y + end * board.dy);
      context.globalAlpha = board.lit;
      context.drawImage(one, -front * size, (-wide / 2) * size, long * size, wide * size);
    };
    if (tail) place("tail", tail, -1, 0, this.tail);
    if (head) {
      place("head", head, 1, show.still ? 0 : 0.03 * Math.sin(2.6 * show.time), this.head);
      Object.assign(context, { strokeStyle: "#ffcf6a", lineWidth: 0.026 * size, lineCap: "round" });
      for (const side of [1, -1]) {
        const sway = show.still ? 0 : 0.07 * Math.sin(2.2 * show.time + side),
            at = (x, y) => [x * size, y * side * size];
        context.beginPath();
        context.moveTo(...at(-0.12, 0.14));
        context.bezierCurveTo(...at(0.16, 0.34 + sway), ...at(-0.1, 0.6 - sway), ...at(-0.48, 0.62 + sway));
        context.stroke();
      }
      context.lineCap = "butt";
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalAlpha = 1;
    if (!head?.lit) return;
    const radius = 0.15 * size, { x, y } = pearl, ball = context.createRadialGradient(x - radius / 3, y - radius / 3,
        0, x, y, radius);
    this.blend(context, "lighter", () => this.spot(context, this.white, x, y, 0.6 * size, head.lit));
    for (const [at, colour] of [[0, "#fffef6"], [0.55, "#ffe9b0"], [1, "#ff9a3a"]]) ball.addColorStop(at, colour);
    context.globalAlpha = head.lit;
    context.fillStyle = ball;
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.fill();
    context.globalAlpha = 1;
  }

  /** Sparks of the head: each is a function of the show time, and begins where the head was, which is on the body. */
  sparks(context, view, { show, dragon, speed, kit }) {
    const { places } = dragon, { time } = show;
    if (!(show.embers > 0) || show.life < 1) return;
    for (let spark = Math.floor(time * SPARKS); spark > (time - SPARK_LIFE) * SPARKS; spark--) {
      const age = time - spark / SPARKS, left = 1 - age / SPARK_LIFE;
      const [startX, startY] = behindHead(places, age * speed), turn = 2 * Math.PI * hash(spark + 1),
          drift = (0.12 + 0.5 * hash(spark + 2)) * age, swirl = 0.16 * age;
      const x = startX + Math.cos(turn) * drift + swirl * Math.sin(3 * age + turn);
      const y = startY + Math.sin(turn) * drift + swirl * Math.cos(2.6 * age + turn);
      const [px, py] = view.place(x, y),
          size = Math.max((0.014 + 0.022 * hash(spark + 3)) * view.pixels * (0.5 + 0.5 * left), 1);
      const alpha = Math.max(0, left * show.embers * (0.6 + 0.4 * Math.sin(17 * time + spark)));
      if (size > 2) {
        this.spot(context, left > 0.55 ? this.white : left > 0.3 ? this.gold : kit.halo, px, py, 2 * size, alpha);
        continue;
      }
      context.globalAlpha = alpha;
      context.fillStyle = left > 0.55 ? "#fff0c8" : left > 0.3 ? "#ffb050" : "#ff6a24";
      context.fillRect(px - 0.7 * size, py - 0.7 * size, 1.4 * size, 1.4 * size);
    }
  }
}
