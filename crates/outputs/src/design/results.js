// The results beside the stage: what is required, events and least clearances. In: the lists of the server, as `events
// --json` and `check --json` print them. Out: the result that the user selects.

import { benchesIn, capital, say } from "../words.js";
import { made } from "./fields.js";

const element = (id) => document.getElementById(id);
const metres = (value) => (Number.isFinite(value) ? `${value.toFixed(3)} m` : "–");
const seconds = (value) => (Number.isFinite(value) ? `${value.toFixed(3)} s` : "–");

/** Returns the benches of a result, counted from 1; empty without a stage that knows them. */
function benchWords(stage, { bench, bench_a = bench, bench_b }) {
  const numbers = [bench_a, bench_b].filter((number) => Number.isFinite(number));
  return stage && numbers.length ? benchesIn(stage, numbers) : "";
}

/** Returns an event in words. */
function eventWords(stage, event) {
  const benches = benchWords(stage, event), what = event.obstacle ? `${event.obstacle}: ` : "";
  return [`${what}${capital(say(event.event))}`, seconds(event.time), benches];
}

/** Returns a least clearance, or something required, in words. */
function factWords(stage, fact) {
  const { check, what, obstacle, clearance, required, verdict, time } = fact;
  const of = obstacle ?? (check === "require" && what !== "obstacle" ? what : null) ?? "boards";
  const benches = benchWords(stage, fact);
  // The clearance of an obstacle is the distance beyond its keep-out.
  const beyond = check === "obstacle" ? " beyond keep-out" : "";
  if (check !== "require") return [`${capital(of)}: ${metres(clearance)}${beyond}`, seconds(time), benches];
  return [`${verdict.toUpperCase()}: ${of} ${metres(clearance)}`, `required ${metres(required)}`,
    Number.isFinite(time) ? `at ${seconds(time)}` : "", benches];
}

export class Results {
  /** `select` is called with a result, or with null when it is selected no longer. */
  constructor(select) {
    Object.assign(this, { select, selected: null, lists: { events: null, facts: null }, stage: null });
  }

  /** Greys the results of an earlier text. */
  computing() {
    for (const list of ["events", "facts"]) element(list).dataset.state = "computing";
    element("verdict").dataset.verdict = "computing";
  }

  show(kind, result, stage) {
    const list = element(kind);
    list.dataset.state = result.state;
    if (result.state === "computing") return;
    Object.assign(this.lists, { [kind]: result });
    this.stage = stage;
    const words = kind === "events" ? eventWords : factWords, isRequired = ({ check }) => check === "require";
    const all = (result.list ?? []).toSorted((a, b) => isRequired(b) - isRequired(a));
    list.replaceChildren(...all.map((one) => this.item(one, words(stage, one), kind)));
    const nothing = kind === "events" ? "No event: the team walks to the end of its path." : "No clearances.";
    if (result.sentence || !all.length) list.append(made("li", { className: "note",
      textContent: result.sentence ?? nothing }));
    if (kind === "facts") this.verdict(all);
  }

  item(one, [title, ...rest], kind) {
    const { event, time, bench, bench_a = bench, bench_b, check, verdict } = one;
    const button = made("button", { type: "button", title: one.sentence ?? "", onclick: () => this.select(one) },
        made("b", { textContent: title }), made("span", { textContent: rest.filter(Boolean).join(" · ") }));
    const item = made("li", {}, button), data = kind === "events" ? { event, time, a: bench_a, b: bench_b }
        : { check, time, a: bench_a, b: bench_b, clearance: one.clearance, verdict };
    for (const [key, value] of Object.entries(data)) if (value !== undefined) item.dataset[key] = value ?? "";
    return item;
  }

  /** Shows whether everything required is kept. */
  verdict(all) {
    const required = all.filter(({ check }) => check === "require"), box = element("verdict");
    const failed = required.filter(({ verdict }) => verdict !== "pass");
    box.dataset.verdict = !required.length ? "none" : failed.length ? "fail" : "pass";
    box.textContent = !required.length ? "Nothing is required" : failed.length
        ? `FAIL: ${failed.length} of ${required.length} required` : "PASS";
  }

  /** Keeps the present results in words beside later ones, with a pinned ghost. */
  pin(isPinned) {
    const box = element("pinned");
    box.hidden = !isPinned;
    if (isPinned) box.textContent = `Pinned: ${this.brief}`;
  }

  /** Returns the first event and the least clearance in one line, for the words beside a pointer. */
  get brief() {
    const { events, facts } = this.lists, first = events?.list?.[0];
    const least = facts?.list?.filter(({ clearance }) => Number.isFinite(clearance)).sort(
        (a, b) => a.clearance - b.clearance)[0];
    return [first ? `${say(first.event)} at ${first.time.toFixed(1)} s` : "no event",
      least ? `least ${metres(least.clearance)} at ${least.time?.toFixed(1)} s` : ""].filter(Boolean).join(", ");
  }
}
