// The page: passes the dragons to the drawing and to the words, and handles the user's input.

// First, since it takes the token out of the address.
import { conduct } from "./conduct.js";
import { wordsOf } from "./address.js";
import { benchAt } from "./boards.js";
import { Camera } from "./camera.js";
import { Cameras } from "./cameras.js";
import { Curve } from "./curve.js";
import { Labels } from "./labels.js";
import { Lanterns } from "./lanterns.js";
import { lock } from "./lock.js";
import { Ground, draw } from "./drawing.js";
import { speedOf } from "./hermite.js";
import { KeySwitch } from "./key_switch.js";
import { Measure } from "./measure.js";
import { Pace } from "./pace.js";
import { attach } from "./pointer_input.js";
import { identitiesOf, paletteOf } from "./palette.js";
import { element, put, showBench, showChase, showFigures, showNames, showProofs, showSituation,
    showTransport } from "./panel.js";
import { Publisher } from "./publisher.js";
import { publishers as names } from "./publishers.js";
import { Resolution } from "./resolution.js";
import { Roster } from "./roster.js";
import { Scrub } from "./scrub.js";
import { Seat } from "./seat.js";
import { Sound } from "./sound.js";
import { capital, say, setLanguage, translate } from "./words.js";

/** The interval at which figures are updated, ms: short enough, and readable. */
const FIGURES_INTERVAL = 100;
/** The seconds by which another publisher's countdown must end earlier for the header to change to that publisher. */
const HEADER_LEAD = 1;
/** The part of a pixel by which a plan may be behind the show. */
const PART = 1 / 16;

const words = wordsOf(location.hash), root = document.documentElement,
    stillness = matchMedia("(prefers-reduced-motion: reduce)");
// A seat is a place in the audience of a show.
words.show ??= words.seat && true;
setLanguage(words.lang ?? navigator.language);
translate(document);
for (const word of ["show", "transparent", "tell"]) root.toggleAttribute(`data-${word}`, Boolean(words[word]));
if (words.dark || words.light || words.show) root.dataset.theme = words.light ? "light" : "dark";

const canvas = element("stage"), context = canvas.getContext("2d", { alpha: "transparent" in words });
const camera = new Camera(), resolution = new Resolution(), ground = new Ground("transparent" in words),
    sound = new Sound();
const labels = "nolabels" in words ? null : new Labels(stillness.matches);
const seat = words.seat ? new Seat(words.seat === true ? [] : words.seat) : null, pace = seat ? new Pace() : null;
const lanterns = seat ??
    (words.show ? new Lanterns({ transparent: words.transparent, moon: words.moon, day: words.light }) : null);
/** The eye that hands move. */
const eye = seat ?? camera;
const isOneOfMany = names.length > 1, look = { several: isOneOfMany, show: words.show, still: stillness.matches };
const publishers = names.map((name) => new Publisher(name, look));
const keySwitch = new KeySwitch(words.keys || words.desk || words.hands, element("keys-on"));
const curve = new Curve(element("curve"));
const measure = new Measure((said) => {
  put("measured", said);
  element("measured").hidden = !said;
  element("measure").setAttribute("aria-pressed", measure.on);
});
const roster = new Roster(select);
/** Another time than the live one; an audience sees the live one only. */
const scrub = words.show ? null : new Scrub(publishers, words.at?.[0]);
/** The dragons of the picture: the live ones, or those at another time. */
const pictured = (dragons) => (scrub ? dragons.map((dragon) => scrub.of(dragon)) : dragons);
/** The dragons of all publishers, and whether there are several. */
let dragons = [], several = false;
meet();
/**
 * `chosen` is a bench (from 0, or -1) of the dragon `whose`. `selected` is the dragon of the figures, or null for the
 * dragon of the publisher of the header.
 */
let palette = paletteOf(canvas), chosen = -1, whose = dragons[0], selected = null, last = null;
/** The moments of this pass of the page and of the one before, and of the pass that drew last. */
let passedAt = 0, beforeAt = 0, drawnAt = -Infinity;

/**
 * For tests and measurements: the received and drawn data. `shown` is the simulated time and the handles at the latest
 * pass, and `range` speeds on the colour scale. `marks` and `labels` are the marks and words on the latest picture.
 * `latency` and `ways` are in ms since the frame was sent. With several dragons the data are those of the first, and
 * `dragons` has the same of each.
 */
const picture = { received: 0, passes: 0, drawn: 0, state: null, run: null, sequence: null, time: null, head: null,
    shown: null, range: null, marks: [], labels: [], latency: publishers[0].latency, ways: publishers[0].stream.ways,
    played: sound.played, scrub: null, toPixel: (...place) => eye.toPixel(...place), dragons: [] };
window.picture = picture;

/** Lists the dragons that the publishers have now. Each of several has an identity. */
function meet() {
  const now = publishers.flatMap((one) => one.dragons), key = now.map(({ name }) => name).join(" ");
  if (now.length === dragons.length && now.every((one, k) => one === dragons[k]) && key === meet.key) return;
  [dragons, several, meet.key] = [now, now.length > 1, key];
  const identities = several ? identitiesOf(now.map(({ ownName }) => ownName)) : [null];
  now.forEach((dragon, k) => (dragon.identity = identities[k]));
  root.toggleAttribute("data-several", several);
  roster.list(several ? dragons : []);
}

function fitCanvas() {
  const { width, height } = canvas.getBoundingClientRect();
  if (width !== camera.width || height !== camera.height) resolution.clear();
  const ratio = resolution.ratio(devicePixelRatio, width, height);
  Object.assign(camera, { width, height, ratio, still: stillness.matches });
  const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width === wide && canvas.height === high) return;
  [canvas.width, canvas.height] = [wide, high];
  last = null;
}

/** The publisher of the header. */
let header = publishers[0];
/**
 * The most urgent publisher that is present: by the severity of its state, then by the soonest coming event. The header
 * keeps its publisher if another countdown is nearly equal, since the header is read aloud.
 */
function foremost() {
  const rank = ({ sight, isThere }) => (sight.stale ? (isThere ? -1 : -2)
      : { ok: 0, warning: 1, error: 2 }[sight.state.severity] ?? 0);
  const soon = ({ sight }) => (sight.seconds > -1 ? sight.seconds : Infinity);
  const best = publishers.reduce(
      (best, one) => (rank(one) > rank(best) || (rank(one) === rank(best) && soon(one) < soon(best)) ? one : best));
  if (rank(best) > rank(header) || soon(best) + HEADER_LEAD < soon(header)) header = best;
  return header;
}

function pass() {
  requestAnimationFrame(pass);
  picture.passes++;
  fitCanvas();
  const now = performance.now(), passed = now - passedAt;
  [beforeAt, passedAt] = [passedAt, now];
  const isOther = publishers.map((one) => one.update(now)).some(Boolean);
  meet();
  if (!dragons.includes(whose)) choose(-1, dragons[0]);
  const there = dragons.filter((dragon) => dragon.isThere);
  picture.received = publishers.reduce((sum, { stream }) => sum + stream.received, 0);
  if (isOther) camera.forget();
  if (!there.length) {
    showText(now);
    return drawNothing();
  }
  const shown = pictured(there);
  camera.update(shown, passed, shown[Math.max(0, there.indexOf(whose))],
      Math.max(...there.map(({ newest }) => newest.scale)));
  camera.reach = Math.max(...shown.map(({ path }) => path.reach));
  showText(now);
  const soonest = publishers.map(
      ({ state, sight }) => (sight.stands || (state.severity === "ok" && !(sight.seconds < 10)) ? NaN
      : sight.seconds)).filter((seconds) => seconds > -1);
  sound.count(soonest.length ? Math.min(...soonest) : NaN);
  if (publishers.some(({ struck }) => struck)) sound.strike();
  paint(shown);
  report();
}

/** Draws the picture, only if it has changed: a show that stands still costs nothing. */
function paint(there) {
  if (lanterns) return light(there);
  const hasFocus = document.activeElement === canvas, least = PART / (camera.scale * camera.ratio);
  const [x, y] = [camera.x, camera.y].map((one) => Math.floor(one / least));
  const look = [there.map((dragon) => dragon.lookKey(least)), x, y, camera.scale, camera.c, camera.s, chosen,
      whose.name, palette.ground, measure.key, hasFocus && measure.on, scrub?.isOn].join();
  if (look === last && !labels?.isDue(passedAt)) return;
  took(look);
  const allStale = there.every(({ sight }) => sight.stale);
  const scene = there.map((dragon) => {
    const { stage, places, colours, path, obstacles, marks, sight, identity } = dragon,
        own = (dragon.original ?? dragon) === whose ? chosen : -1;
    const named = { chosen: own, chosenName: dragon.benchName(own), endNames: dragon.endNames() };
    // A line between boards has no meaning without words.
    const drawn = labels ? marks : marks.filter(({ kind }) => kind !== "nearest");
    return { stage, places, colours, path: path.lines, obstacles, marks: drawn, ...named, identity,
        stale: sight.stale && !allStale };
  });
  const ghosts = scrub?.isOn ? there.flatMap((dragon) => scrub.ghostsOf(dragon).map(
      (ghost) => ({ ...ghost, stage: dragon.stage }))) : [];
  const written = draw(context, camera, palette, { ground, dragons: scene, ghosts, labels, measure, hasFocus });
  picture.drawn++;
  Object.assign(picture, { marks: there.flatMap(({ marks }) => marks), labels: written });
  drawnOf(isOneOfMany);
}

/** Notes what is drawn now, and measures the time of a picture if the last pass drew one too. */
function took(look) {
  if (last && !seat && drawnAt === beforeAt) resolution.take(passedAt - drawnAt);
  [last, drawnAt] = [look, passedAt];
}

/** Draws the show look. */
function light(there) {
  const isDue = pace?.begin(passedAt) ?? true, look = [there.map((dragon) => dragon.lookKey(0)), camera.x,
      camera.y, camera.scale, camera.c, camera.s, seat?.key].join();
  if (look === last || !isDue) return;
  took(look);
  lanterns.draw(context, camera, there);
  pace?.drawn(passedAt);
  picture.drawn++;
  drawnOf(true);
}

/** A publisher that has stopped is drawn again while another one moves: this is no latency of its frames. */
function drawnOf(isLiveOnly) {
  for (const one of publishers) if (one.isThere && !(isLiveOnly && one.sight.stale)) one.drawn();
}

/** The picture stays; the data for tests of a publisher that is gone does not. */
function report() {
  picture.dragons = dragons.map((dragon) => dragon.report(eye));
  picture.scrub = scrub?.report() ?? null;
  const { name: _, time, ...rest } = picture.dragons[0];
  Object.assign(picture, rest, time === null ? {} : { time });
  if (picture.shown) picture.range = dragons[0].colours.ticks.map(({ speed }) => speed);
}

/** The drawing stays until there is another one. */
function drawNothing() {
  report();
  const blank = [palette.ground, canvas.width, canvas.height].join();
  if (last !== null) return;
  last = blank;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.fillStyle = palette.ground;
  if (!("transparent" in words)) context.fillRect(0, 0, canvas.width, canvas.height);
}

/** Returns how commands are given here: a phone has no keys. */
function commandsBy() {
  return element("conduct").hidden ? "none" : matchMedia("(hover: none) and (pointer: coarse)").matches ? "touch" : "keys";
}

let figuresAt = 0, countedAt = 0;
function showText(now) {
  const first = foremost(), { sight } = first;
  const of = isOneOfMany ? first.name : null;
  showSituation({ ...sight, stale: publishers.every((one) => one.sight.stale), of });
  showTransport(first.transport, { now, of, keys: commandsBy() });
  roster.show(first, selected);
  showChase(first.stream.chase, now, of);
  const notices = publishers.map((one) => one.notice()).filter(Boolean);
  // The style sheet shows them in the show look only on request.
  if (words.show && !notices.length && sight.trouble) notices.push(capital(say(sight.trouble)));
  element("notice").hidden = !notices.length || "nolabels" in words;
  put("notice", notices.join("\n"));
  showSeat();
  const dragon = selected ?? first.dragons[0], shown = dragon.publisher, { newest, stage, stream } = shown;
  scrub?.update(newest ? stream.playback.time(now) : 0);
  curve.show(shown.isThere ? stream.facts : null, stage, newest?.time);
  // The scene of a picture that stays may no longer be played.
  showProofs(shown.isThere && !shown.sight.trouble ? stage : null);
  // The rest changes too often to be readable at every pass.
  if (!shown.isThere || now - figuresAt < FIGURES_INTERVAL) return;
  figuresAt = now;
  showNames(stage, isOneOfMany ? names : null, first.transport.kind === "playing" ? "" : first.transport.sign);
  const { colours } = dragon, { frame } = pictured([dragon])[0];
  showFigures({ clearance: newest.clearance, colours, time: stream.playback.time(now), scale: newest.scale });
  showBench(whose === dragon ? chosen : -1, frame.handles, dragon.part);
  if (now - countedAt < 1000) return;
  for (const one of publishers) one.count(now - countedAt);
  countedAt = now;
  // The send time of another machine's frames is unknown.
  const { rate, latency } = shown, late = stream.clock === null ? [] : latency.slice(-60).sort((a, b) => a - b);
  const behind = late.length ? say("behind", { ms: late[late.length >> 1].toFixed(0) }) : "";
  put("rate", shown.sight.stale ? "" : say("frames", { rate: rate.toFixed(rate < 10 ? 1 : 0), behind }));
}

/** A line of the seat: the picture's heights are not to scale; and why it stands on a slow computer. */
function showSeat() {
  element("seat-note").hidden = !seat || "nolabels" in words || publishers.every(({ sight }) => sight.stale);
  if (!seat) return;
  put("seat-note", [say("notToScale"),
      pace.isStill ? say("still", { seconds: pace.seconds, rate: pace.rate.toFixed(1) }) : ""].filter(Boolean).join(
      " "));
}

// The user's input.

function showFollow() {
  element("follow").setAttribute("aria-pressed", camera.mode === "bench");
  put("follow", chosen > 0 ? say("followBench", { bench: chosen + 1 }) : say("follow"));
}
function follow() {
  camera.mode === "bench" ? camera.release() : camera.follow(Math.max(0, chosen));
  showFollow();
}
function whole() {
  eye.whole();
  showFollow();
}
function pan(x, y) {
  eye.pan(x, y);
  showFollow();
}
function choose(bench, dragon = whose) {
  [chosen, whose] = [bench, dragon];
  if (several) selected = bench >= 0 ? dragon : null;
  element("pick").value = bench >= 0 ? bench + 1 : "";
  showFollow();
}
/** Shows the figures of a dragon, or again of the dragon of the header. */
function select(dragon) {
  choose(-1, dragon ?? whose);
  selected = dragon;
}
function dressed() {
  palette = paletteOf(canvas);
  last = null;
}
/** Paper is white: the picture is printed light, and then has its theme again. */
function print(isBegin) {
  if (lanterns) return;
  if (isBegin) root.dataset.printed = root.dataset.theme ?? "";
  const before = root.dataset.printed;
  if (isBegin) root.dataset.theme = "light";
  else if (before) root.dataset.theme = before;
  else delete root.dataset.theme;
  dressed();
  const there = dragons.filter(({ isThere, places }) => isThere && places);
  if (there.length) paint(pictured(there));
}
addEventListener("beforeprint", () => print(true));
addEventListener("afterprint", () => print(false));
function toggleTheme() {
  const theme = root.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  root.dataset.theme = theme === "dark" ? "light" : "dark";
  dressed();
}
async function fill() {
  if (document.fullscreenElement) return document.exitFullscreen();
  await root.requestFullscreen();
  // A projector must not go to sleep; a browser without this function still shows the picture.
  await navigator.wakeLock?.request("screen").catch(() => null);
}
function toggleSound() {
  sound.turn(!sound.on);
  element("sound").setAttribute("aria-pressed", sound.on);
}
function help() {
  element("keys-conduct").hidden = element("conduct").hidden;
  element("keys").showModal();
}
/** Announces the place of the head to a screen reader, again if the words are the same. */
function speak() {
  if (!whose.isThere) return;
  const { handles } = whose.newest, speed = speedOf(handles, 0), values = { x: handles[0].toFixed(2),
      y: handles[1].toFixed(2), speed: Number.isNaN(speed) ? say("notSent") : say("perSecond",
      { speed: speed.toFixed(2) }), clearance: element("metres").textContent };
  put("spoken", "");
  setTimeout(() => put("spoken", whose.own(say("spokenNow", values))), 100);
}
const measureMiddle = () => measure.on && document.activeElement === canvas &&
    measure.take(camera.toStage(camera.width / 2, camera.height / 2));
function escape() {
  if (measure.on) return measure.toggle(false);
  choose(-1);
}

const zoom = (by) => () => eye.zoomAt(by);
const keys = {
  "+": zoom(1.25), "=": zoom(1.25), "-": zoom(0.8), 0: whole, Home: whole,
  f: follow, t: toggleTheme, p: fill, s: toggleSound, "?": help, i: speak, m: () => measure.toggle(),
      Enter: measureMiddle, Escape: escape,
  ArrowLeft: () => pan(60, 0), ArrowRight: () => pan(-60, 0), ArrowUp: () => pan(0, 60), ArrowDown: () => pan(0, -60),
};
function tap(x, y) {
  if (measure.on) return measure.take(camera.toStage(x, y));
  const there = dragons.filter(({ isThere, places }) => isThere && places), place = camera.toStage(x, y),
      reach = 16 / camera.scale;
  if (!there.length) return;
  // A hit board has priority over a near one.
  for (const most of [0, reach]) {
    for (const dragon of there) {
      const bench = benchAt(dragon.stage, pictured([dragon])[0].places, ...place, most);
      if (bench >= 0) return choose(bench, dragon);
    }
  }
  choose(-1);
}
const isWanted = (event) => keySwitch.acts(event, canvas);
// The picture of an audience ignores every hand that touches it by chance.
if (words.show) lock(() => `${say("locked")} · ${element("time").textContent} · ${element("playback").textContent}`);
if (words.show) keys["?"] = () => null;
if (!words.show || words.hands) attach(canvas, { pan, tap: words.show ? () => null : tap, keys,
    zoomAt: (...to) => (eye.zoomAt(...to), showFollow()), isFree: () => camera.mode !== "bench", isWanted });
if (!words.show || words.hands) new Cameras(eye, seat ? "seat" : "stage", element("camera-note"), isWanted);
element("pick").oninput = ({ target }) => {
  chosen = target.value === "" ? -1 : Math.floor(target.value) - 1;
  const own = selected ?? foremost().dragons[0];
  if (several && chosen >= 0) [whose, selected] = [own, own];
  showFollow();
};
Object.entries({ follow, whole, theme: toggleTheme, full: fill, sound: toggleSound, help, measure: keys.m,
    nearer: keys["+"], farther: keys["-"] }).forEach(([id, act]) => (element(id).onclick = act));
matchMedia("(prefers-color-scheme: dark)").onchange = dressed;
stillness.onchange = () => dragons.forEach(({ show }) => show && (show.still = stillness.matches));
// Sound set in the address begins with the first key or click, if the browser requires one.
if (words.sound) toggleSound();
addEventListener("pointerdown", () => sound.on && sound.turn(true));
addEventListener("hashchange", () => location.reload());

// The address may set the initial picture, for a screen without a keyboard.
if (words.rotate) camera.turn(words.rotate[0]);
if (words.view) camera.view(...words.view);
if (words.bench) choose(words.bench[0] - 1);
if (words.follow) camera.follow(words.follow === true ? 0 : words.follow[0] - 1);
if (words.unknown.length) put("address", say("address", { words: words.unknown.join(", ") }));
element("address").hidden = !words.unknown.length;
showFollow();
conduct(publishers, !words.show || words.desk, keySwitch);
pass();
