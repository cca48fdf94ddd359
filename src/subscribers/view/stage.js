// The page: puts the stream into the drawing and into words, and takes the user's hand.

// First, since it takes the token out of the address.
import { conduct } from "./conduct.js";
import { STRIDE, speedOf } from "./hermite.js";
import { Stream } from "./stream.js";
import { Camera, Ground, benchAt, draw, paletteOf, pathOf } from "./drawing.js";

/** By severity; the list of the states, with the severity of each, comes with the stage. */
const SIGNS = { ok: "○", warning: "△", error: "✖" };
/** While there is nothing to show; a state that the server does not list is shown as one without danger. */
const WAITING = { name: "waiting", severity: "ok", happened: false, sentence: null };
const element = (id) => document.getElementById(id);
const canvas = element("stage"), context = canvas.getContext("2d", { alpha: false });
const stream = new Stream(), camera = new Camera(), ground = new Ground();
let palette = paletteOf(canvas), places = null, path = null, pathRun = null, chosen = -1, range = null, still = false, last = null;

/**
 * For tests and measurements: what the page has received and drawn. `shown` is the simulated time and the handles of the
 * latest picture; `latency` and `ways` in ms since the frame was sent.
 */
const picture = { received: 0, passes: 0, drawn: 0, state: null, run: null, sequence: null, time: null, head: null, shown: null, latency: [], ways: stream.ways, toPixel: (x, y) => camera.toPixel(x, y) };
window.picture = picture;

function put(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}

// The drawing.

function fitCanvas() {
  const { width, height } = canvas.getBoundingClientRect(), ratio = devicePixelRatio;
  Object.assign(camera, { width, height, ratio });
  const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
}

/** How far from the centre the outermost bench is. */
function reachOf(stage, handles) {
  let most = 0;
  for (let k = 0; k < handles.length; k += STRIDE) most = Math.max(most, Math.hypot(handles[k], handles[k + 1]));
  return most + stage.width + stage.hole_inset || 1;
}

/** The colours' scale holds all speeds and changes gently; none while nothing moves or no speeds are sent. */
function widen(handles) {
  let [low, high] = [Infinity, -Infinity];
  for (let handle = 0; handle < handles.length / STRIDE; handle++) {
    const speed = speedOf(handles, handle);
    if (speed > 0) [low, high] = [Math.min(low, speed), Math.max(high, speed)];
  }
  if (!(high > 0)) return null;
  // A hair's breadth is not worth a colour.
  const wider = Math.max(0, 0.01 * high - (high - low) / 2);
  [low, high] = [low - wider, high + wider];
  const slowly = (old, now) => (range ? old + 0.05 * (now - old) : now);
  return { low: Math.min(low, slowly(range?.low, low)), high: Math.max(high, slowly(range?.high, high)) };
}

function pass() {
  requestAnimationFrame(pass);
  picture.passes++;
  fitCanvas();
  const now = performance.now(), { playback, stage, alert } = stream, { newest } = playback;
  picture.received = stream.received;
  updateText(now);
  if (!newest || !stage) return drawNothing();
  const shown = playback.at(now, places), { from, to } = shown;
  places = shown.handles;
  const reach = reachOf(stage, newest.handles);
  // Positions are rounded to 32 bits, which alone moves the outermost bench a little.
  if (pathRun !== newest.run || reach > 1.001 * camera.reach) {
    // A team that moves outward is given room ahead.
    camera.reach = pathRun === newest.run ? 1.1 * reach : reach;
    path = pathOf(stage, camera.reach);
    if (pathRun !== newest.run) range = null;
    pathRun = newest.run;
  }
  if (camera.follow) [camera.x, camera.y] = places;
  const widened = widen(newest.handles);
  range = widened ?? range;
  still = !widened;
  // Nothing is drawn twice: a show that stands still costs nothing.
  const all = [newest.run, newest.state, still, shown.time, from.epoch, camera.x, camera.y, camera.zoom, camera.reach, camera.width, camera.height, camera.ratio, range?.low, range?.high, alert?.level, alert?.event_x, alert?.bench_a, alert?.bench_b, chosen, palette.ground].join();
  if (all !== last) {
    draw(context, camera, palette, { stage, places, newest: newest.handles, range, ground, path, alert, chosen });
    last = all;
    picture.drawn++;
    if (stream.clock !== null && from !== to) {
      const part = (shown.time - from.time) / (to.time - from.time);
      picture.latency.push(performance.now() + stream.clock - (from.sent + (to.sent - from.sent) * part));
      if (picture.latency.length > 600) picture.latency.shift();
    }
  }
  const head = camera.toPixel(places[0], places[1]);
  Object.assign(picture, { state: newest.state, run: newest.run, sequence: newest.sequence, time: newest.time, head, shown });
}

function drawNothing() {
  const blank = [palette.ground, canvas.width, canvas.height].join();
  if (blank === last) return;
  last = blank;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.fillStyle = palette.ground;
  context.fillRect(0, 0, canvas.width, canvas.height);
  Object.assign(picture, { state: null, run: null, sequence: null, head: null, shown: null });
}

// The words.

/** Seconds as a person reads them off from afar. */
function remaining(seconds) {
  if (seconds < 100) return [seconds.toFixed(1), "s"];
  const whole = Math.floor(seconds), pad = (number) => String(number).padStart(2, "0");
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return hours ? [`${hours}:${pad(minutes)}:${pad(whole % 60)}`, "h"] : [`${minutes}:${pad(whole % 60)}`, "min"];
}

/** The server puts alerts and states into words; those of an alert's level that the frames have not reached, or have left, do not count. */
function sentence(state, alert) {
  const capital = (words) => words[0].toUpperCase() + words.slice(1);
  if (state.sentence) return `${capital(state.sentence)}.`;
  if (state.severity === "ok" || alert?.level !== state.name) return "";
  const words = `${capital(alert.sentence)}.`;
  return state.happened ? words : `${capital(state.name)}. ${words}`;
}

let spokenAt = Infinity;
function speak(seconds) {
  const mark = [10, 5, 3].findLast((mark) => seconds <= mark) ?? Infinity;
  if (mark < spokenAt) put("spoken", `${Math.ceil(seconds)} seconds`);
  spokenAt = mark;
}

function countdown(state, alert, now) {
  const { playback } = stream, { newest } = playback;
  const seconds = alert?.event_time != null ? (alert.event_time - playback.time(now)) / newest.scale : NaN;
  const ahead = !state.happened && seconds > -1, near = state.severity !== "ok";
  const [number, unit] = ahead ? remaining(Math.max(0, seconds)) : ["", ""];
  element("countdown").hidden = !ahead;
  put("until", ahead ? `${near ? "" : "next "}${alert.event} in` : "");
  if (element("left").dataset.text !== number + unit) {
    element("left").dataset.text = number + unit;
    // The number is made as large as the panel is wide.
    element("left").style.setProperty("--letters", number.length + 0.5 * unit.length);
    element("left").textContent = number;
    element("left").append(Object.assign(document.createElement("small"), { textContent: unit }));
  }
  speak(near && ahead ? seconds : Infinity);
}

function meter(stage, clearance) {
  const known = Number.isFinite(clearance), most = Math.max(stage.pitch - stage.width, 2 * stage.width);
  put("metres", !known ? "not computed" : clearance < -0.0005 ? `${(-clearance).toFixed(3)} m overlap` : `${Math.max(0, clearance).toFixed(3)} m`);
  const bar = element("meter"), share = known ? Math.min(1, Math.max(0, clearance / most)) : 0;
  bar.firstElementChild.style.width = `${(100 * share).toFixed(1)}%`;
  bar.setAttribute("aria-valuemax", most.toFixed(3));
  bar.setAttribute("aria-valuenow", (share * most).toFixed(3));
  bar.setAttribute("aria-valuetext", element("metres").textContent);
}

function detail(stage, handles) {
  const count = handles.length / STRIDE - 1;
  element("pick").max = count;
  const there = chosen >= 0 && chosen < count, k = STRIDE * chosen;
  element("bench").classList.toggle("chosen", there);
  if (!there) return put("bench", "Click a bench, or type its number.");
  const name = chosen === 0 ? ", the head" : chosen === count - 1 ? ", the tail" : "", speed = speedOf(handles, chosen);
  const degrees = ((handles[k + 2] * 180) / Math.PI).toFixed(1);
  put("bench", `Bench ${chosen + 1} of ${count}${name}: front handle at (${handles[k].toFixed(3)}, ${handles[k + 1].toFixed(3)}) m, ${Number.isNaN(speed) ? "speed not sent" : `${speed.toFixed(3)} m/s`}, heading ${degrees}°`);
}

let figuresAt = 0, counted = { at: 0, received: 0 }, perSecond = 0;
function updateText(now) {
  const { playback, stage, alert } = stream, { newest } = playback;
  const state = newest && stage ? stage.states[newest.state] ?? { ...WAITING, name: "unknown" } : WAITING;
  const { dataset } = document.body, before = dataset.level, calm = state.severity === "ok" && !state.happened;
  if (before !== state.name) Object.assign(dataset, { level: state.name, severity: state.severity, happened: state.happened });
  if (state === WAITING) {
    put("state", `○ ${stream.trouble ?? "waiting for the stage"}`);
    put("spoken", stream.trouble ?? "");
    for (const id of ["alert", "until", "left", "metres", "speeds", "time", "rate"]) put(id, "");
    element("left").dataset.text = "";
    element("countdown").hidden = true;
    put("bench", "");
    element("meter").firstElementChild.style.width = 0;
    return;
  }
  countdown(state, alert, now);
  const words = state.name.replaceAll("_", " "), silent = now - newest.at > Math.max(2000, 3 * playback.interval);
  put("state", silent ? `… no frames for ${Math.floor((now - newest.at) / 1000)} s` : `${SIGNS[state.severity]} ${words}`);
  put("alert", sentence(state, alert));
  if (calm && before !== state.name) put("spoken", before === WAITING.name ? "The dragon moves." : "Clear again.");
  // The rest changes too often to be read at every pass.
  if (now - figuresAt < 100) return;
  figuresAt = now;
  meter(stage, newest.clearance);
  put("speeds", Number.isNaN(newest.handles[3]) ? "not sent" : still ? "at rest" : range ? `${range.low.toFixed(2)}–${range.high.toFixed(2)}` : "");
  put("time", `t = ${playback.time(now).toFixed(1)} s${newest.scale === 1 ? "" : ` (× ${+newest.scale.toPrecision(3)})`}`);
  detail(stage, newest.handles);
  if (now - counted.at > 1000) {
    perSecond = ((stream.received - counted.received) * 1000) / (now - counted.at);
    counted = { at: now, received: stream.received };
    const late = picture.latency.slice(-60).sort((a, b) => a - b), behind = late.length ? `, ${late[late.length >> 1].toFixed(0)} ms behind the publisher` : "";
    put("rate", `${perSecond.toFixed(perSecond < 10 ? 1 : 0)} frames/s${behind}`);
  }
}

// The user's hand.

function showFollow() {
  element("follow").setAttribute("aria-pressed", camera.follow);
}
function follow() {
  camera.follow = !camera.follow;
  // Near enough to distinguish the benches, however large the stage is.
  const near = Math.max(2.5, camera.reach / (5 * (stream.stage?.head_length ?? camera.reach)));
  if (camera.follow && camera.zoom < near) camera.zoom = near;
  showFollow();
}
function whole() {
  camera.whole();
  if (stream.stage) camera.reach = reachOf(stream.stage, stream.playback.newest.handles);
  showFollow();
}
function pan(x, y) {
  camera.pan(x, y);
  showFollow();
}
function choose(bench) {
  chosen = bench;
  element("pick").value = bench >= 0 ? bench + 1 : "";
}
function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  palette = paletteOf(canvas);
}
function toggleTheme() {
  const theme = document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  setTheme(theme === "dark" ? "light" : "dark");
}
async function fill() {
  if (document.fullscreenElement) return document.exitFullscreen();
  await document.documentElement.requestFullscreen();
  // A projector must not go to sleep; a browser that cannot promise that still shows the picture.
  await navigator.wakeLock?.request("screen").catch(() => null);
}

const fingers = new Map();
let moved = 0;
canvas.onpointerdown = (event) => {
  canvas.setPointerCapture(event.pointerId);
  if (!fingers.size) moved = 0;
  fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
};
canvas.onpointermove = (event) => {
  const old = fingers.get(event.pointerId);
  if (!old) return;
  const now = { x: event.offsetX, y: event.offsetY }, x = now.x - old.x, y = now.y - old.y;
  moved += Math.hypot(x, y);
  const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
  if (other) {
    const apart = (one) => Math.hypot(one.x - other.x, one.y - other.y) || 1;
    camera.zoomAt(apart(now) / apart(old), (now.x + other.x) / 2, (now.y + other.y) / 2);
    if (!camera.follow) pan(x / 2, y / 2);
  } else if (moved > 6) pan(x, y);
  fingers.set(event.pointerId, now);
};
canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
canvas.onpointerup = (event) => {
  fingers.delete(event.pointerId);
  if (moved > 6 || fingers.size || !stream.stage || !places) return;
  choose(benchAt(stream.stage, places, ...camera.toStage(event.offsetX, event.offsetY), 16 / camera.scale));
};
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  camera.zoomAt(Math.exp(-event.deltaY / (event.deltaMode ? 20 : 500)), event.offsetX, event.offsetY);
}, { passive: false });
const keys = {
  "+": () => camera.zoomAt(1.25), "=": () => camera.zoomAt(1.25), "-": () => camera.zoomAt(0.8), 0: whole, Home: whole,
  f: follow, t: toggleTheme, p: fill, Escape: () => choose(-1),
  ArrowLeft: () => pan(60, 0), ArrowRight: () => pan(-60, 0), ArrowUp: () => pan(0, 60), ArrowDown: () => pan(0, -60),
};
onkeydown = (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target === element("pick")) return;
  keys[event.key.length === 1 ? event.key.toLowerCase() : event.key]?.();
};
element("pick").oninput = ({ target }) => (chosen = target.value === "" ? -1 : Math.floor(target.value) - 1);
Object.entries({ follow, whole, theme: toggleTheme, full: fill, nearer: keys["+"], farther: keys["-"] }).forEach(([id, act]) => (element(id).onclick = act));
matchMedia("(prefers-color-scheme: dark)").onchange = () => (palette = paletteOf(canvas));
// The address may set how the picture begins, for a screen without a keyboard: #dark, #light,follow and so on.
const begin = { dark: () => setTheme("dark"), light: () => setTheme("light"), follow };
location.hash.slice(1).split(",").forEach((word) => begin[word]?.());
conduct(stream);
pass();
