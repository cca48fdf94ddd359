// The page on which a scene is made. The text of the scene is the only state: fields, handles and time line send its
// changes to the server, and show what comes back. This file connects the parts.

// First, since it takes the token out of the address.
import { token } from "../conduct.js";
import { wordsOf } from "../address.js";
import { Measure } from "../measure.js";
import { attach } from "../pointer_input.js";
import { setLanguage } from "../words.js";
import { Fields, unitOf } from "./fields.js";
import { GroundPicture } from "./ground_picture.js";
import { Handles } from "./handles.js";
import { History } from "./history.js";
import { Picture } from "./picture.js";
import { Plans } from "./plans.js";
import { Results } from "./results.js";
import { Session } from "./session.js";
import { SceneText } from "./text.js";
import { TimeLine } from "./time_line.js";

const element = (id) => document.getElementById(id), root = document.documentElement;
/** The time without typing after which the next letter begins another step of undo (ms). */
const TYPING_PAUSE = 1000;
/** The time for which a sentence is shown (ms). */
const SENTENCE_TIME = 10_000;
/** Handles that say little about the extent of a scene: those of long streets. */
const FAR = ["boundary", "keep_out", "insert"];

setLanguage("en");
const words = wordsOf(location.hash);
if (words.dark || words.light) root.dataset.theme = words.dark ? "dark" : "light";

const history = new History(), canvas = element("stage");
/** The newest scene of the server; null before the first. */
let scene = null;
let hello = null, typedAt = -Infinity, typing = 0, sentenceAt = 0;
/** The name of the handle in use, or null. */
let used = null;
let isFitted = false, isConnected = false, isPinned = false, saving = Promise.resolve();

function tell(sentence) {
  element("status").textContent = sentence ?? "";
  sentenceAt = performance.now();
}

const measure = new Measure((said) => {
  if (said) tell(said);
  element("measure").setAttribute("aria-pressed", measure.on);
});
const picture = new Picture(canvas, measure, place);
const { camera } = picture;
const ground = new GroundPicture(camera, measure, tell);
const session = new Session({
  hello: greet, offer, allowed, frame, refused, lost,
  stage: (stage) => picture.take(stage),
  events: (events) => {
    results.show("events", events, picture.stage);
    if (events.state === "computing") return;
    line.showEvents(events);
    // The marked event, as it is now; or the first that happens on the way.
    const { event: marked } = picture, list = (picture.events = events.list ?? []);
    picture.mark(list.find(({ event, obstacle }) => event === marked?.event && obstacle === marked?.obstacle) ??
        list.find(({ event }) => event !== "path_end") ?? null);
  },
  facts: (facts) => {
    results.show("facts", facts, picture.stage);
    if (facts.state !== "computing") line.showFacts(facts, picture.stage);
    beside();
  },
  progress: (id, share) => plans.progress(id, share),
  plan: (id, plan, text, file) => plans.result(id, plan, text, file),
  cancelled: (id) => plans.cancelled(id),
});
const text = new SceneText(typed), results = new Results(select);
const line = new TimeLine({ at: (time) => session.at(time), drop: () => fields.end(),
  cue: (number, time, gesture) => change({ drag: { handle: `cues[${number}]`, to: [time, 0], free: true, alt: false } },
      gesture) });
const plans = new Plans(session, (planned) => replace(planned, null), keep);
const fields = new Fields(element("fields"), {
  set: (name, value, gesture) => change({ set: { [name]: value } }, gesture, name),
  remove: (item) => change({ remove: item }, null),
  show: (number) => text.show(number),
  focus: ({ line: number }) => text.show(number),
  vary: (names) => plans.vary(names),
});
const handles = new Handles(element("handles"), { camera, canvas,
  drag: (handle, to, how, gesture) => change({ drag: { handle: handle.name, to, ...how } }, gesture, handle.name),
  use,
  // Only what this gesture has changed.
  cancel: (gesture) => history.gesture === gesture ? undo(-1) : session.forget(),
  remove: (name) => change({ remove: name }, null),
  insert: (after, at) => change({ add: { what: "corner", after, at } }, null),
  show: (number) => text.show(number),
  isBusy: () => session.inFlight !== null,
});
window.design = { session, picture, history, handles, get scene() { return scene; } };

// Changes of the scene.

/**
 * Sends a change. Changes of one `gesture` are one step of undo; null is a gesture of its own. `about` is the field or
 * the handle that changes.
 */
function change(request, gesture, about = null) {
  const key = gesture ?? Symbol();
  session.change(request, key, (next, error) => {
    if (error) return refuse(error, about);
    // The user has typed since: that text follows.
    if (session.waiting.some(({ request }) => "text" in request)) return;
    text.set(next.text);
    history.take(next.text, line.time, gesture);
    show(next);
  });
}

/** Sends a whole text. */
function send(whole) {
  session.change({ text: whole }, "text", (next, error) => {
    if (error) return showError(error);
    if (next.text === text.value) show(next);
  });
}

/** Replaces the text by another one, as a gesture of its own. */
function replace(whole, time) {
  fields.end();
  text.set(whole);
  history.take(whole, time ?? line.time, null);
  send(whole);
}

function typed(whole, when, isOther) {
  if (isOther || when - typedAt > TYPING_PAUSE) typing++;
  typedAt = isOther ? -Infinity : when;
  history.take(whole, line.time, `typing ${typing}`);
  send(whole);
  note();
}

function undo(by) {
  const step = history.go(by);
  if (!step) return;
  session.forget();
  fields.end();
  text.set(step.text);
  send(step.text);
  line.go(step.time);
  note();
}

/** Shows a scene that the server has accepted. */
function show(next) {
  scene = next;
  root.dataset.stale = "false";
  text.error(null);
  plans.outdate(session.accepted);
  fields.enable(true);
  fields.show(scene);
  handles.show(scene);
  line.show(scene);
  results.computing();
  element("scene-name").textContent = scene.name;
  document.title = `${scene.name}: design`;
  beside();
  if ((scene.doubts ?? []).length) tell(scene.doubts.join(" "));
  if (!isFitted) fit();
  note();
}

/** The text has an error: the last good picture stays. */
function showError(error) {
  text.error(error);
  root.dataset.stale = "true";
  fields.enable(false);
  results.computing();
  if (error.field) fields.refuse(error.field, error.sentence);
  note();
}

/** A change was refused: the text stays as it is. */
function refuse(error, about) {
  tell(error.sentence);
  fields.refuse(error.field ?? about, error.sentence);
}

function refused(id, error) {
  if (!plans.refuse(id, error)) tell(error.sentence);
}

/** Shows the numbers of the handle in use, the first event and the least clearance beside it. */
function beside() {
  const handle = scene?.handles.find(({ name }) => name === used), box = element("note");
  box.hidden = !handle;
  if (!handle) return;
  const names = handle.fields ?? [handle.name], values = scene.fields.filter(({ name }) => names.includes(name)).map(
      ({ name, value, unit }) => `${name.split(/[.\]]/).findLast(Boolean)} ${value} ${unitOf(unit)}`);
  box.textContent = [values.join(", "), results.brief].filter(Boolean).join("\n");
  const [x, y] = camera.toPixel(handle.x, handle.y);
  box.style.transform = `translate(${Math.min(x + 18, camera.width - 220)}px, ${Math.max(4, y - 46)}px)`;
}

/** Names the handle in use, or null. */
function use(name) {
  used = name;
  beside();
}

// The server's messages.

function greet(greeting) {
  hello = greeting;
  isConnected = true;
  root.dataset.connection = "open";
  const list = element("template");
  list.replaceChildren(new Option("New from …", ""),
      ...greeting.templates.map(({ key, title }) => new Option(title, key)));
  element("save").hidden = !greeting.save;
  // The server is back: it gets the text again.
  if (greeting.token && token === null) allowed(false);
  else if (history.key !== null) send(text.value);
  note();
}

function allowed(isAllowed) {
  if (!isAllowed) tell("This server needs the token: open the address that it printed.");
}

/**
 * Takes the scene of the file, or of the first template. Returns true if the page shows it: a kept text has priority.
 */
function offer({ scene: offered, error }) {
  const given = offered?.text ?? error.text ?? "";
  if (history.key !== null) {
    // A save whose answer was lost.
    if (given === text.value) history.saved(given);
    if (hello.save && given !== history.base) tell(`${hello.file} has changed since this page read it. Load the page again to see the file; undo brings your text back.`);
    return false;
  }
  const kept = history.begin(hello?.file ?? "", given);
  line.time = kept.time;
  if (kept.text !== given) {
    text.set(kept.text);
    send(kept.text);
    session.at(kept.time);
    tell("Continued where you left off. Undo has the earlier texts.");
    return false;
  }
  text.set(given);
  offered ? show(offered) : showError(error);
  if (kept.time) session.at(kept.time);
  return true;
}

function frame(received) {
  if (!picture.frame(received)) return;
  session.note(session.accepted, "frame");
}

function lost() {
  if (isConnected) tell("The connection is broken. Your text is kept here, and is sent again.");
  isConnected = false;
  root.dataset.connection = "lost";
  plans.clear();
  note();
}

// The user's input.

/** Shows a result: its time, its benches, its line of text. */
function select(result) {
  line.play(false);
  if (Number.isFinite(result.time)) line.go(result.time);
  picture.mark(result.event ? result : null);
  if (!result.event && Number.isFinite(result.bench_a ?? result.bench)) choose(result.bench_a ?? result.bench);
  text.show(result.line);
}

function choose(number) {
  const dragon = picture.live.dragons.find(({ first, places }) => places && number >= first &&
      number < first + places.length / 5 - 1);
  picture.chosen = { dragon: dragon ?? null, bench: dragon ? number - dragon.first : -1 };
}

/** Shows the handles; a coil alone by its boards. The last piece and the boundary may be long streets. */
function fit() {
  isFitted = true;
  const { handles: all, pieces = [] } = scene, last = pieces.length > 2 ? `${pieces.at(-1).name}.` : null;
  const near = all.filter(({ name, kind }) => !FAR.includes(kind) && !(last && name.startsWith(last)));
  const isCoil = !pieces.length && !near.some(({ kind }) => kind === "centre");
  picture.fit(isCoil ? [] : near.map(({ x, y }) => [x, y]));
}

function note() {
  for (const [id, by] of [["undo", -1], ["redo", 1]]) element(id).disabled = !history.can(by);
  element("pin").setAttribute("aria-pressed", isPinned);
}

function download() {
  const name = hello?.file ?? `${(scene?.name ?? "scene").replaceAll(/[^\w\- ]/g, "_")}.toml`;
  keep({ name: name.split("/").at(-1), kind: "application/toml", text: text.value });
}

/** Downloads a file. */
function keep({ name, kind, text: content }) {
  const address = URL.createObjectURL(new Blob([content], { type: kind }));
  Object.assign(document.createElement("a"), { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/** The time after which a save is given up, so that the next one begins, ms. */
const SAVE_LIMIT = 10_000;
/** Writes the file, after an earlier save, which changes its base. */
const save = () => (saving = saving.then(write));
async function write() {
  const headers = token === null ? {} : { Authorization: `Bearer ${token}` }, { value } = text;
  const body = JSON.stringify({ base: history.base, text: value });
  try {
    const answer = await fetch(new URL("save", import.meta.url), { method: "POST", body, headers,
        signal: AbortSignal.timeout(SAVE_LIMIT) });
    if (answer.ok) history.saved(value);
    tell(answer.ok ? `Saved ${hello.file}.` : await answer.text());
  } catch {
    tell("Nothing was saved: the server does not answer.");
  }
}

function pin() {
  isPinned = picture.pin();
  results.pin(isPinned);
  note();
}

async function openGeojson({ target }) {
  const [file] = target.files;
  if (file) change({ geojson: await file.text() }, null);
  target.value = "";
}

const middle = () => camera.toStage(camera.width / 2, camera.height / 2).map((one) => Math.round(10 * one) / 10);
function add({ target }) {
  const [what, kind] = target.value.split(" ");
  target.value = "";
  if (what) change({ add: { what, kind, at: middle(), time: line.time } }, null);
}

element("template").onchange = ({ target }) => {
  const template = target.value;
  target.value = "";
  if (!template) return;
  isFitted = false;
  change({ template }, null);
};
element("add").onchange = add;
element("geojson").onchange = openGeojson;
Object.entries({ undo: () => undo(-1), redo: () => undo(1), pin, download, save, measure: () => measure.toggle(),
    whole: fit, nearer: () => camera.zoomAt(1.25), farther: () => camera.zoomAt(0.8) }).forEach(
    ([id, act]) => (element(id).onclick = act));

const onStage = (act) => (event) => event.target === canvas && act(event);
attach(canvas, {
  pan: (x, y) => (ground.isMoving ? ground.pan(x, y) : camera.pan(x, y)),
  zoomAt: (...to) => camera.zoomAt(...to),
  isFree: () => true,
  isWanted: ({ target }) => target === canvas,
  tap: (x, y) => {
    if (!measure.on) return picture.choose(x, y);
    measure.take(camera.toStage(x, y));
    ground.measured();
  },
  keys: { "+": () => camera.zoomAt(1.25), "=": () => camera.zoomAt(1.25), "-": () => camera.zoomAt(0.8), 0: () => fit(),
    m: () => measure.toggle(), " ": (event) => (event.preventDefault(), line.play(!line.playing)),
    Escape: () => measure.on && measure.toggle(false), Enter: onStage(() => {
      if (measure.on) measure.take(camera.toStage(camera.width / 2, camera.height / 2));
      ground.measured();
    }),
    ArrowLeft: onStage(() => camera.pan(60, 0)), ArrowRight: onStage(() => camera.pan(-60, 0)),
    ArrowUp: onStage(() => camera.pan(0, 60)), ArrowDown: onStage(() => camera.pan(0, -60)) },
});
addEventListener("keydown", (event) => {
  const { key, ctrlKey, metaKey, shiftKey, altKey } = event, letter = key.toLowerCase();
  if (!(ctrlKey || metaKey) || altKey || !["z", "y", "s"].includes(letter)) return;
  event.preventDefault();
  if (letter === "s") element("save").hidden ? download() : save();
  else undo(letter === "y" || shiftKey ? 1 : -1);
});
// The menu of the text area has an undo of its own, which does not know the other gestures.
element("scene-text").addEventListener("beforeinput", (event) => {
  const by = { historyUndo: -1, historyRedo: 1 }[event.inputType];
  if (!by) return;
  event.preventDefault();
  undo(by);
});

/** Moves what lies over and under the picture. Clicks that measure or move go through the handles. */
function place() {
  const isInert = measure.on || ground.isMoving;
  if (handles.root.inert !== isInert) handles.root.inert = isInert;
  handles.place();
  ground.place();
}

function pass() {
  requestAnimationFrame(pass);
  const now = performance.now();
  line.pass(now);
  picture.pass(now);
  // A frame has been drawn by the end of the pass after it came.
  if (session.times.get(session.accepted)?.frame) session.note(session.accepted, "drawn");
  place();
  if (now - sentenceAt > SENTENCE_TIME && element("status").textContent) element("status").textContent = "";
}
note();
pass();
