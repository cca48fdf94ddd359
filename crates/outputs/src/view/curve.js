// The clearance over the whole show as a curve, with its least place and the present time. In: the facts of a stream.
// Out: an element for the page; words for those who do not see it.

import { benchesIn, say } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";
/**
 * The size of the drawing, which is stretched; the clearances at its lower and upper edge, m. The scale is logarithmic.
 */
const WIDE = 1000, HIGH = 100, LEAST = 0.001, MOST = 1;

const heightOf = (metres) => (HIGH * Math.log(Math.min(MOST, Math.max(LEAST, metres)) / LEAST)) / Math.log(
    MOST / LEAST);

export class Curve {
  constructor(element) {
    this.element = element;
    this.shown = null;
    this.line = document.createElementNS(SVG, "path");
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", `0 0 ${WIDE} ${HIGH}`);
    svg.setAttribute("preserveAspectRatio", "none");
    svg.append(this.line);
    [this.now, this.least, this.text] = ["i", "b", "span"].map((tag) => document.createElement(tag));
    element.replaceChildren(svg, this.now, this.least, this.text);
  }

  /** Shows the facts of a stream, or nothing without any, up to the end of the show of a stage. */
  show(facts, stage, time) {
    const end = stage?.freeze_time, curve = facts?.clearance ?? null;
    this.element.hidden = !curve;
    if (!curve) return;
    this.now.style.setProperty("--share", time / end);
    if (this.shown === curve && this.end === end) return;
    Object.assign(this, { shown: curve, end });
    const points = curve.points.map(
        ([at, metres]) => `${((WIDE * at) / end).toFixed(2)} ${(HIGH - heightOf(metres)).toFixed(2)}`);
    const last = ((WIDE * curve.points.at(-1)[0]) / end).toFixed(2);
    this.line.setAttribute("d", `M0 ${HIGH}L${points.join("L")}L${last} ${HIGH}Z`);
    const { time: at, clearance, bench_a, bench_b } = curve.least;
    const values = { metres: Math.max(0, clearance).toFixed(3), time: at.toFixed(1),
        benches: benchesIn(stage, [bench_a, bench_b]) };
    const words = say("leastClearance", values);
    this.least.style.setProperty("--share", at / end);
    this.least.style.setProperty("--height", heightOf(clearance) / HIGH);
    this.text.textContent = words;
    this.element.setAttribute("aria-label", `${say("curve")}. ${words}`);
    this.element.title = words;
  }
}
