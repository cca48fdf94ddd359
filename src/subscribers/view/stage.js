// The page: puts the stream into the drawing and into words, and takes the user's hand.

// First, since it takes the token out of the address.
import { conduct } from "./conduct.js";
import { wordsOf } from "./address.js";
import { benchAt } from "./boards.js";
import { Camera } from "./camera.js";
import { Ground, draw, pathOf } from "./drawing.js";
import { attach } from "./hands.js";
import { STRIDE } from "./hermite.js";
import { Overlap, marksOf } from "./marks.js";
import { SpeedScale, paletteOf } from "./palette.js";
import { element, put, showBench, showFigures, showNames, showSituation } from "./panel.js";
import { Show } from "./show.js";
import { Sound } from "./sound.js";
import { Stream } from "./stream.js";
import { benchesOf, capital, nameOf, remaining, say, setLanguage, translate } from "./words.js";

/** While there is nothing to show. */
const WAITING = { name: "waiting", severity: "ok", happened: false, sentence: null };
/** A state that the server does not list is shown as one without danger. */
const UNKNOWN = { ...WAITING, name: "unknown" };
/** Frames that do not come for so long (ms) are missed. */
const SILENCE = 2000;

const words = wordsOf(location.hash), root = document.documentElement, stillness = matchMedia("(prefers-reduced-motion: reduce)");
setLanguage(words.lang);
translate(document);
for (const word of ["show", "transparent"]) root.toggleAttribute(`data-${word}`, word in words);
if (words.dark || words.light || words.show) root.dataset.theme = words.light ? "light" : "dark";

const canvas = element("stage"), context = canvas.getContext("2d", { alpha: "transparent" in words });
const stream = new Stream(), camera = new Camera(), ground = new Ground("transparent" in words), overlap = new Overlap(), sound = new Sound();
const colours = new SpeedScale(), show = words.show ? new Show(stillness.matches) : null;
let palette = paletteOf(canvas), places = null, path = null, run = null, team = null, epoch = null, chosen = -1, last = null, passedAt = 0, state = WAITING;

/**
 * For tests and measurements: what the page has received and drawn. `shown` is the simulated time and the handles of the
 * latest picture, `range` speeds on the colour scale, `marks` and `labels` what is marked and written on
 * it; `latency` and `ways` in ms since the frame was sent.
 */
const picture = { received: 0, passes: 0, drawn: 0, state: null, run: null, sequence: null, time: null, head: null, shown: null, range: null, marks: [], labels: [], latency: [], ways: stream.ways, played: sound.played, toPixel: (x, y) => camera.toPixel(x, y) };
window.picture = picture;

function fitCanvas() {
  const { width, height } = canvas.getBoundingClientRect(), ratio = devicePixelRatio;
  Object.assign(camera, { width, height, ratio });
  const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width === wide && canvas.height === high) return;
  [canvas.width, canvas.height] = [wide, high];
  last = null;
}

/** How far from the centre the outermost bench is. */
function reachOf(stage, handles) {
  let most = 0;
  for (let k = 0; k < handles.length; k += STRIDE) most = Math.max(most, Math.hypot(handles[k], handles[k + 1]));
  return most + stage.width + stage.hole_inset || 1;
}

/** When the head reaches the end of the path, where the show comes so far and nothing that is counted down is before. */
function pathEnd(stage, alert) {
  const end = stage.events.find(({ event, time }) => event === "path_end" && time <= stage.freeze_time);
  return end && alert?.event == null ? end.time : NaN;
}

/** What is so now: the state, what is ahead and in how many seconds of wall time. */
function situation(now) {
  const { playback, stage, alert, trouble } = stream, { newest } = playback;
  const silence = newest ? now - newest.at : 0;
  const silent = !trouble && newest && silence > Math.max(SILENCE, 3 * playback.interval) ? Math.floor(silence / 1000) : null;
  const lost = trouble ?? (newest && stage ? null : "noStage");
  const current = lost ? WAITING : stage.states[newest.state] ?? UNKNOWN;
  let [seconds, ahead] = [NaN, null];
  if (!lost && silent === null && newest.playing && !current.happened) {
    ahead = alert?.event ?? "path_end";
    seconds = ((alert?.event_time ?? pathEnd(stage, alert)) - playback.time(now)) / newest.scale;
  }
  return { state: current, alert, trouble: lost, silent, seconds, ahead, benches: stage?.benches, now: "" };
}

/** Another run: another path and other speeds; and where the team is another one, nothing chosen for the last. */
function begin(stage, newest) {
  const look = JSON.stringify({ ...stage, run_id: null, scene: null });
  if (team !== null && team !== look) camera.forget();
  [team, run] = [look, newest.run];
  colours.clear();
}

/** Words for the marks, in the page's language. */
function named(marks, { seconds }, deepest) {
  const time = seconds > -1 ? remaining(Math.max(0, seconds)).join(" ") : null;
  for (const mark of marks) {
    mark.names = show ? [] : mark.pair.map(nameOf);
    const benches = mark.pair.length ? benchesOf(mark.pair) : "", { alert } = stream;
    if (mark.kind === "coming") mark.text = say(time === null ? "comingStill" : "coming", { kind: say(alert.event), benches, time });
    if (mark.kind === "overlap") mark.text = overlapWords(deepest);
  }
  return marks;
}

function overlapWords({ pair, depth }) {
  return depth < 0.0005 ? say("touchNow", { benches: benchesOf(pair) }) : say("overlapNow", { benches: benchesOf(pair), metres: depth.toFixed(3) });
}

function pass() {
  requestAnimationFrame(pass);
  picture.passes++;
  fitCanvas();
  const now = performance.now(), passed = now - passedAt, sight = situation(now), { playback, stage, alert } = stream, { newest } = playback;
  passedAt = now;
  picture.received = stream.received;
  const before = state;
  state = sight.state;
  if (!newest || !stage) {
    showText(sight, now);
    return drawNothing();
  }
  const shown = playback.at(now, places), { from, to } = shown;
  places = shown.handles;
  if (run !== newest.run) begin(stage, newest);
  colours.take(newest);
  camera.update(stage, places, passed);
  const reach = reachOf(stage, newest.handles);
  // Positions are rounded to 32 bits, which alone moves the outermost bench a little.
  if (!path || path.run !== run || reach > 1.001 * path.reach) {
    // A team that moves outward is given room ahead.
    const far = path?.run === run ? 1.1 * reach : reach;
    path = { run, reach: far, lines: pathOf(stage, far) };
    camera.reach = far;
  }
  const known = stage.states[newest.state] ?? UNKNOWN;
  const deepest = known.happened && known.severity !== "ok" ? overlap.look(stage, places, newest, reach, now) : null;
  const all = marksOf({ state: known, alert, stage, places, overlap: deepest });
  // An audience is shown where it will happen, not what the crew watches.
  const marks = named(show ? all.filter(({ kind }) => kind !== "now") : all, sight, deepest);
  sight.now = deepest && !sight.trouble ? overlapWords(deepest) : "";
  showText(sight, now);
  sound.count(state.severity === "ok" && !(sight.seconds < 10) ? NaN : sight.seconds);
  const struck = state.happened && state.severity === "error";
  if (struck && before !== WAITING && before.name !== state.name) sound.strike();
  if (show) show.update(now, places, epoch !== from.epoch, struck ? { x: alert?.event_x ?? places[0], y: alert?.event_y ?? places[1] } : null);
  epoch = from.epoch;
  // Nothing is drawn twice: a show that stands still costs nothing.
  const texts = marks.map(({ kind, pair, text }) => [kind, pair, text]);
  const look = [newest.run, newest.state, colours.resting, shown.time, from.epoch, camera.x, camera.y, camera.scale, camera.c, camera.s, path.reach, colours.step, colours.head, alert?.level, texts, chosen, palette.ground, stage.scene, show?.phase].join();
  if (look !== last) {
    const written = draw(context, camera, palette, { stage, places, colours, ground, path: path.lines, marks, chosen, words: !words.nolabels, show, chosenName: nameOf(chosen), endNames: [say("head"), say("tail")] });
    last = look;
    picture.drawn++;
    Object.assign(picture, { marks, labels: written });
    if (stream.clock !== null && from !== to) {
      const part = (shown.time - from.time) / (to.time - from.time);
      picture.latency.push(performance.now() + stream.clock - (from.sent + (to.sent - from.sent) * part));
      if (picture.latency.length > 600) picture.latency.shift();
    }
  }
  if (sight.trouble) return forget();
  const head = camera.toPixel(places[0], places[1]);
  Object.assign(picture, { state: newest.state, run: newest.run, sequence: newest.sequence, time: newest.time, head, shown, range: colours.ticks.map(({ speed }) => speed) });
}

/** The picture stays; what tests read of a publisher that is gone does not. */
function forget() {
  Object.assign(picture, { state: null, run: null, sequence: null, head: null, shown: null });
}

/** What has been drawn stays until there is something else to draw. */
function drawNothing() {
  forget();
  const blank = [palette.ground, canvas.width, canvas.height].join();
  if (last !== null) return;
  last = blank;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.fillStyle = palette.ground;
  if (!("transparent" in words)) context.fillRect(0, 0, canvas.width, canvas.height);
}

let figuresAt = 0, counted = { at: 0, received: 0 };
function showText(sight, now) {
  const { playback, stage } = stream, { newest } = playback;
  showSituation(sight);
  const stopped = sight.trouble ?? (sight.silent === null ? null : "silent"), kept = newest && stage && stopped;
  const notice = { server: "lostServer", silent: "silent" }[stopped] ?? "lostPublisher";
  // The picture alone has no panel that says why it is empty.
  const empty = show && !kept && sight.trouble;
  element("notice").hidden = !(kept || empty) || "nolabels" in words;
  put("notice", kept ? say(notice, { seconds: sight.silent, time: newest.time.toFixed(1) }) : empty ? capital(say(sight.trouble)) : "");
  // The rest changes too often to be read at every pass.
  if (!newest || !stage || now - figuresAt < 100) return;
  figuresAt = now;
  showNames(stage);
  showFigures({ clearance: newest.clearance, colours, time: playback.time(now), scale: newest.scale });
  showBench(chosen, newest.handles);
  if (now - counted.at < 1000) return;
  const rate = ((stream.received - counted.received) * 1000) / (now - counted.at), late = picture.latency.slice(-60).sort((a, b) => a - b);
  counted = { at: now, received: stream.received };
  const behind = late.length ? say("behind", { ms: late[late.length >> 1].toFixed(0) }) : "";
  put("rate", stopped ? "" : say("frames", { rate: rate.toFixed(rate < 10 ? 1 : 0), behind }));
}

// The user's hand.

function showFollow() {
  element("follow").setAttribute("aria-pressed", camera.mode === "bench");
  put("follow", chosen > 0 ? say("followBench", { bench: chosen + 1 }) : say("follow"));
}
function follow() {
  camera.mode === "bench" ? camera.release() : camera.follow(Math.max(0, chosen));
  showFollow();
}
function whole() {
  camera.whole();
  showFollow();
}
function pan(x, y) {
  camera.pan(x, y);
  showFollow();
}
function choose(bench) {
  chosen = bench;
  element("pick").value = bench >= 0 ? bench + 1 : "";
  showFollow();
}
function dressed() {
  palette = paletteOf(canvas);
  last = null;
}
function toggleTheme() {
  const theme = root.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  root.dataset.theme = theme === "dark" ? "light" : "dark";
  dressed();
}
async function fill() {
  if (document.fullscreenElement) return document.exitFullscreen();
  await root.requestFullscreen();
  // A projector must not go to sleep; a browser that cannot promise that still shows the picture.
  await navigator.wakeLock?.request("screen").catch(() => null);
}
function toggleSound() {
  sound.turn(!sound.on);
  element("sound").setAttribute("aria-pressed", sound.on);
}
const help = () => element("keys").showModal();

const zoom = (by) => () => camera.zoomAt(by);
const keys = {
  "+": zoom(1.25), "=": zoom(1.25), "-": zoom(0.8), 0: whole, Home: whole,
  f: follow, t: toggleTheme, p: fill, s: toggleSound, "?": help, Escape: () => choose(-1),
  ArrowLeft: () => pan(60, 0), ArrowRight: () => pan(-60, 0), ArrowUp: () => pan(0, 60), ArrowDown: () => pan(0, -60),
};
const tap = (x, y) => stream.stage && places && choose(benchAt(stream.stage, places, ...camera.toStage(x, y), 16 / camera.scale));
attach(canvas, { pan, tap, keys, zoomAt: (...to) => (camera.zoomAt(...to), showFollow()), isFree: () => camera.mode !== "bench" });
element("pick").oninput = ({ target }) => {
  chosen = target.value === "" ? -1 : Math.floor(target.value) - 1;
  showFollow();
};
Object.entries({ follow, whole, theme: toggleTheme, full: fill, sound: toggleSound, help, nearer: keys["+"], farther: keys["-"] }).forEach(([id, act]) => (element(id).onclick = act));
matchMedia("(prefers-color-scheme: dark)").onchange = dressed;
if (show) stillness.onchange = () => (show.still = stillness.matches);
// Sound that the address asks for begins with the first key or click, where the browser wants one.
if (words.sound) toggleSound();
addEventListener("pointerdown", () => sound.on && sound.turn(true));
addEventListener("hashchange", () => location.reload());

// The address may set how the picture begins, for a screen without a keyboard.
if (words.rotate) camera.turn(words.rotate[0]);
if (words.view) camera.view(...words.view);
if (words.bench) choose(words.bench[0] - 1);
if (words.follow) camera.follow(words.follow === true ? 0 : words.follow[0] - 1);
if (words.unknown.length) put("address", say("address", { words: words.unknown.join(", ") }));
element("address").hidden = !words.unknown.length;
showFollow();
conduct(stream);
pass();
