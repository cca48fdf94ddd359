// The list of several dragons beside the picture: the transport's sign, name, state, countdown and sentence of each. A single
// dragon has no list.

import { identityOf } from "./palette.js";
import { SIGNS, element } from "./panel.js";
import { capital, remaining, say, sentenceOf } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

/** A piece of the line around a dragon on the picture. */
function swatch({ colour, dashes }) {
  const svg = document.createElementNS(SVG, "svg"), line = document.createElementNS(SVG, "line");
  for (const [name, value] of Object.entries({ viewBox: "0 0 60 8", "aria-hidden": "true" })) svg.setAttribute(name, value);
  const look = { x1: 0, y1: 4, x2: 60, y2: 4, stroke: colour, "stroke-width": 5, "stroke-dasharray": dashes.join(" ") };
  for (const [name, value] of Object.entries(look)) line.setAttribute(name, value);
  svg.append(line);
  return svg;
}

/** An element with a class, and words in it. */
const made = (tag, name) => Object.assign(document.createElement(tag), { className: name });

export class Roster {
  /** `select` is called with the dragon of the pressed row, or with null if it was selected already. */
  constructor(dragons, select) {
    this.selected = null;
    this.rows = dragons.map((dragon, place) => {
      const [item, button, sign, name, state, sentence] = [made("li", ""), made("button", ""), made("span", "sign"), made("b", "whose"), made("span", "state"), made("p", "sentence")];
      name.textContent = dragon.name;
      button.append(swatch(identityOf(place)), sign, name, state);
      button.onclick = () => select(this.selected === dragon ? null : dragon);
      item.append(button, sentence);
      return { dragon, item, button, sign, state, sentence };
    });
    element("dragons").replaceChildren(...this.rows.map(({ item }) => item));
    element("dragons").hidden = false;
  }

  /**
   * Shows the situation of each; `first` is the dragon of the header, which has its sentence there, `selected` that of
   * the figures.
   */
  show(first, selected) {
    this.selected = selected;
    for (const { dragon, item, button, sign, state, sentence } of this.rows) {
      const { sight, transport } = dragon, stands = !["playing", "lost"].includes(transport.kind);
      const words = [stands || sight.stale ? capital(transport.word.toLowerCase()) : "", sight.stale ? "" : `${SIGNS[sight.state.severity]} ${say(sight.state.name)}`].filter(Boolean).join(" ");
      if (sign.textContent !== transport.sign) sign.textContent = transport.sign;
      item.dataset.transport = transport.kind;
      const left = sight.seconds > -1 ? `, ${say(sight.ahead)} ${remaining(Math.max(0, sight.seconds)).join(" ")}` : "";
      const text = dragon === first || sight.stale ? "" : sentenceOf(sight.state, sight.alert, sight.benches, sight.obstacles);
      if (state.textContent !== words + left) state.textContent = words + left;
      if (sentence.textContent !== text) sentence.textContent = text;
      item.dataset.severity = sight.stale ? "lost" : sight.state.severity;
      button.setAttribute("aria-pressed", dragon === selected);
    }
  }
}
