// The panel beside the picture: the state, the countdown, the sentence, the figures. Draws nothing.

import { STRIDE, speedOf } from "./hermite.js";
import { capital, chaseOf, proofOf, remaining, say, sentenceOf } from "./words.js";

/** By severity; the list of the states, with the severity of each, comes with the stage. */
export const SIGNS = { ok: "○", warning: "△", error: "✖" };
/** The clearance bar is logarithmic from the least to the most metres, so that it has something to show near zero. */
const LEAST_CLEARANCE = 0.001, MOST_CLEARANCE = 1;

export const element = (id) => document.getElementById(id);

export function put(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}

/** The last spoken state and countdown mark of each publisher that the header has shown. */
const spokenOf = new Map();

/**
 * The state, the sentence and the countdown of a situation. `trouble` is the reason why nothing comes, or null, and
 * `silent` the seconds without a frame, or null. `stale` is true if the whole picture is stale. `of` is the name of
 * the publisher of the situation, or null for a single publisher. `seconds` are the seconds until the event `ahead`
 * (NaN without a countdown). `stands` is true if the show stands still, and `now` is the present state in words.
 */
export function showSituation({ state, alert, trouble, silent, stale, of, seconds, ahead, stands, stage, now }) {
  const { dataset } = document.body, calm = state.severity === "ok" && !state.happened;
  const changed = dataset.level !== state.name;
  if (changed) Object.assign(dataset, { level: state.name, severity: state.severity, happened: state.happened });
  dataset.stale = String(stale);
  // The motion of a picture that no frame confirms, or of a show that stands, is not stated.
  element("state").hidden = Boolean(trouble) || silent !== null || (calm && stands);
  put("state", `${SIGNS[state.severity]} ${capital(say(state.name))}`);
  const sentence = trouble ? "" : sentenceOf(state, alert, stage);
  put("alert", of && sentence ? `${of}: ${sentence}` : sentence);
  put("now", capital(now));
  element("now").hidden = !now;
  if (!spokenOf.has(of)) spokenOf.set(of, { state: null, mark: Infinity });
  const last = spokenOf.get(of), isNews = last.state !== state.name, own = (words) => (of ? `${of}: ${words}` : words);
  countdown({ state, seconds, ahead, stands }, last, own);
  if (trouble) last.mark = Infinity;
  else if (isNews && calm) put("spoken", own(say(last.state === null ? "dragonMoves" : "clearAgain")));
  else if (isNews && !state.happened) put("spoken", own(`${capital(say(state.name))}.`));
  last.state = trouble ? null : state.name;
}

/** The last spoken transport state of each publisher that the header has shown. */
const spokenTransport = new Map();

/**
 * The transport state at a moment: its sign and word, and its detail, with the way in which commands are given (`keys`).
 * Each change is spoken once; a hold, at once.
 */
export function showTransport(transport, { now, of, keys }) {
  document.body.dataset.transport = transport.kind;
  put("playback", `${transport.sign} ${transport.word}`);
  put("playback-detail", transport.detail(now, keys));
  const last = spokenTransport.get(of);
  if (last === transport.key) return;
  spokenTransport.set(of, transport.key);
  // Frames of a show that plays are announced by the motion's sentence.
  if (transport.kind === "playing" && (last === undefined || last.startsWith("lost"))) return;
  put(transport.kind === "held" ? "spoken-at-once" : "spoken", of ? `${of}: ${transport.sentence}`
      : transport.sentence);
  if (transport.kind !== "held") put("spoken-at-once", "");
}

/**
 * Shows the countdown, and speaks it at its marks while the show plays. `last` has this publisher's last spoken words,
 * `own` adds the publisher's name to words.
 */
function countdown({ state, seconds, ahead, stands }, last, own) {
  const counting = seconds > -1, near = counting && (state.severity !== "ok" || seconds < 10);
  const [number, unit] = counting ? remaining(Math.max(0, seconds)) : ["", ""];
  element("countdown").hidden = !counting;
  document.body.dataset.near = String(near);
  document.body.dataset.stands = String(counting && stands);
  put("until", counting ? capital(say(stands ? "eventAhead" : near ? "in" : "next", { kind: say(ahead) })) : "");
  if (element("left").dataset.text !== number + unit) {
    element("left").dataset.text = number + unit;
    // The number is made as large as the panel is wide.
    element("left").style.setProperty("--letters", number.length + 0.5 * unit.length);
    element("left").textContent = number;
    element("left").append(Object.assign(document.createElement("small"), { textContent: unit }));
  }
  const mark = near ? ([10, 5, 3].findLast((mark) => seconds <= mark) ?? Infinity) : Infinity;
  if (mark < last.mark && state.severity !== "ok" && !stands) put("spoken",
      own(say("seconds", { seconds: Math.ceil(seconds) })));
  last.mark = mark;
}

/** The time without a status after which a chase counts as dead (ms). A chase sends five statuses a second. */
const CHASE_SILENCE = 2000;

/** The chase of the publisher of the header, while one runs; `of` is its name, or null for a single publisher. */
export function showChase(chase, now, of) {
  const { dataset } = document.body, runs = Boolean(chase) && chase.state !== "ended",
      hasDied = runs && now - chase.at > CHASE_SILENCE;
  element("chase").hidden = !runs;
  if (!runs) return (dataset.chase = "");
  const words = hasDied ? say("chaseDied") : chaseOf(chase), state = hasDied ? "died" : chase.state;
  put("chase", of ? `${of}: ${words}` : words);
  if (dataset.chase !== state) put("spoken", element("chase").textContent);
  dataset.chase = state;
}

/** Clearance, speeds and time; empty without frames. */
export function showFigures({ clearance, colours, time, scale }) {
  const known = Number.isFinite(clearance), metres = Math.max(0, clearance);
  put("metres", !known ? say("notComputed") : clearance < -0.0005 ? say("overlap", { metres: (-clearance).toFixed(3) })
      : `${metres.toFixed(3)} m`);
  const within = Math.min(MOST_CLEARANCE, Math.max(LEAST_CLEARANCE, known ? metres : 0));
  const share = Math.log(within / LEAST_CLEARANCE) / Math.log(MOST_CLEARANCE / LEAST_CLEARANCE), bar = element("meter");
  bar.firstElementChild.style.width = `${(100 * share).toFixed(1)}%`;
  bar.setAttribute("aria-valuemax", MOST_CLEARANCE);
  bar.setAttribute("aria-valuenow", Math.min(MOST_CLEARANCE, known ? metres : 0).toFixed(3));
  bar.setAttribute("aria-valuetext", element("metres").textContent);
  put("speeds", colours.unsent ? say("notSent") : colours.resting ? say("rest") : "");
  showScale(colours);
  const rate = scale === 1 || scale === 0 ? "" : say("rate", { rate: +scale.toPrecision(3) });
  put("time", say("time", { time: time.toFixed(1), rate }));
}

let provedStage = null;
/**
 * The proofs of the events of a stage, a line for each; events that the show cannot reach are separate. Empty without a
 * certificate.
 */
export function showProofs(stage) {
  if (provedStage === stage) return;
  provedStage = stage;
  const lines = (stage?.proved ?? []).map((outcome) => proofOf(outcome, stage.freeze_time)).filter(({ text }) => text);
  for (const id of ["proofs", "beyond"]) {
    const own = lines.filter(({ canCome }) => canCome === (id === "proofs"));
    element(id).hidden = !own.length;
    element(id).replaceChildren(
        ...own.map(({ text }) => Object.assign(document.createElement("li"), { textContent: text })));
  }
}

let scaleShown = "";
/** The speeds under the colours; for a show at rest so far, the meaning of each colour. */
function showScale({ ticks, width, unseen }) {
  const digits = Math.max(2, Math.ceil(-Math.log10(width / 10)));
  const parts = ["tail", "body", "head"].map((part, k) => ({ at: (50 * k).toFixed(1), text: say(part).toLowerCase() }));
  const shown = unseen ? parts
      : ticks.map(({ at, speed }) => ({ at: (100 * at).toFixed(1), text: String(+speed.toPrecision(digits + 1)) })),
      key = JSON.stringify(shown);
  if (key === scaleShown) return;
  scaleShown = key;
  const spans = shown.map(({ at, text }) => {
    const span = Object.assign(document.createElement("span"), { textContent: text });
    span.style.left = `${at}%`;
    return span;
  });
  element("scale").replaceChildren(...spans);
}

/** The number, place and speed of the bench that is chosen; `dragon` is the name of one of several, or empty. */
export function showBench(chosen, handles, dragon) {
  const count = handles.length / STRIDE - 1;
  element("pick").max = count;
  const there = chosen >= 0 && chosen < count, k = STRIDE * chosen;
  element("bench").classList.toggle("chosen", there);
  if (!there) return put("bench", say("pick"));
  const speed = speedOf(handles, chosen);
  const values = {
    number: chosen + 1,
    count,
    of: dragon && say("ofThem", { dragon }),
    name: chosen === 0 ? say("theHead") : chosen === count - 1 ? say("theTail") : "",
    x: handles[k].toFixed(3),
    y: handles[k + 1].toFixed(3),
    speed: Number.isNaN(speed) ? say("speedNotSent") : say("perSecond", { speed: speed.toFixed(3) }),
    degrees: ((handles[k + 2] * 180) / Math.PI).toFixed(1),
  };
  put("bench", say("detail", values));
}

/**
 * The show's name, on the page and in the title; with `several`, the title has the names of all publishers. `sign` is
 * the sign of a show that does not play, or empty.
 */
export function showNames({ scene, publisher }, several, sign) {
  const name = several ? say("titleSeveral", { publishers: several.join(", ") }) : scene
      ? say("title", { scene, publisher }) : say("stage");
  const title = [sign, name].filter(Boolean).join(" ");
  if (document.title !== title) document.title = title;
  put("name", [scene, publisher].filter(Boolean).join(" · "));
}
