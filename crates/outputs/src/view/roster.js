// The list of several dragons beside the picture, with the name and the state of each. A publisher with one dragon also
// has the transport's sign, the countdown and the sentence. A single dragon has no list.

import { SIGNS, element } from "./panel.js";
import { capital, remaining, say, sentenceOf } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

/** A piece of the line around a dragon on the picture. */
function swatch({ colour, dashes }) {
  const svg = document.createElementNS(SVG, "svg"), line = document.createElementNS(SVG, "line");
  for (const [name, value] of Object.entries({ viewBox: "0 0 60 8", "aria-hidden": "true" })) svg.setAttribute(name,
      value);
  const look = { x1: 0, y1: 4, x2: 60, y2: 4, stroke: colour, "stroke-width": 5, "stroke-dasharray": dashes.join(" ") };
  for (const [name, value] of Object.entries(look)) line.setAttribute(name, value);
  svg.append(line);
  return svg;
}

/** An element with a class, and words in it. */
const made = (tag, name) => Object.assign(document.createElement(tag), { className: name });

export class Roster {
  /** `select` is called with the dragon of the pressed row, or with null if it was selected already. */
  constructor(select) {
    this.select = select;
    this.selected = null;
    this.rows = [];
  }

  /** Makes a row for each dragon; without dragons there is no list. */
  list(dragons) {
    this.rows = dragons.map((dragon) => {
      const [item, button, sign, name] = [made("li", ""), made("button", ""), made("span", "sign"), made("b", "whose")];
      const [state, sentence] = [made("span", "state"), made("p", "sentence")];
      name.textContent = dragon.name;
      button.append(swatch(dragon.identity), sign, name, state);
      button.onclick = () => this.select(this.selected === dragon ? null : dragon);
      item.append(button, sentence);
      return { dragon, item, button, sign, state, sentence };
    });
    element("dragons").replaceChildren(...this.rows.map(({ item }) => item));
    element("dragons").hidden = !this.rows.length;
  }

  /**
   * Shows the situation of each; `first` is the publisher of the header, which has its sentence there, `selected` the
   * dragon of the figures.
   */
  show(first, selected) {
    this.selected = selected;
    for (const { dragon, item, button, sign, state, sentence } of this.rows) {
      const { sight, publisher } = dragon, { transport } = publisher, isOnly = !dragon.part;
      const words = isOnly ? ofPublisher(publisher) : ofDragon(dragon);
      // Dragons of one show have one transport, in the header.
      const text = publisher === first || sight.stale || dragon !== publisher.dragons[0] ? ""
          : sentenceOf(sight.state, sight.alert, sight.stage);
      const ownSign = isOnly || publisher.several ? transport.sign : "";
      for (const [part, shown] of [[sign, ownSign], [state, words], [sentence, text]]) if (
          part.textContent !== shown) part.textContent = shown;
      item.dataset.transport = transport.kind;
      item.dataset.severity = sight.stale ? "lost" : isOnly || isConcerned(dragon) ? sight.state.severity : "ok";
      button.setAttribute("aria-pressed", dragon === selected);
    }
  }
}

/** The state of a publisher with its only dragon, and its countdown. */
function ofPublisher({ sight, transport }) {
  const stands = !["playing", "lost"].includes(transport.kind), { state, stale, seconds, ahead } = sight;
  const words = [stands || stale ? capital(transport.word.toLowerCase()) : "",
      stale ? "" : `${SIGNS[state.severity]} ${say(state.name)}`];
  const left = seconds > -1 ? `, ${say(ahead)} ${remaining(Math.max(0, seconds)).join(" ")}` : "";
  return words.filter(Boolean).join(" ") + left;
}

/** Returns true if the alert of a show is about this dragon. */
function isConcerned(dragon) {
  const { alert } = dragon.sight, numbers = alert?.event ? [alert.event_bench_a, alert.event_bench_b]
      : [alert?.bench_a, alert?.bench_b];
  return dragon.places !== null && numbers.some((number) => dragon.within(number) >= 0);
}

/** The state of one dragon of a show: what concerns it, or whether it moves. The header has the countdown. */
function ofDragon(dragon) {
  const { state, stale, trouble } = dragon.sight;
  if (stale) return say(trouble ?? "noFramesNow");
  const name = state.severity !== "ok" && isConcerned(dragon) ? state.name : dragon.stands ? "stands" : "moving";
  return `${SIGNS[name === state.name ? state.severity : "ok"]} ${say(name)}`;
}
