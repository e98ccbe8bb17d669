/** The colours of the relief: its histogram, and two handles that say which relief they span. */
import { h, number } from "./dom.js";
import { t } from "./words/words.js";

const STEPS = 200;
const SETTLE_MS = 180;

export class Range {
  /** `changed(low, high)`: other limits, once the hand rests. */
  constructor(changed) {
    this.changed = changed;
    this.canvas = h("canvas", { class: "bars", width: "220", height: "34", "aria-hidden": "true" });
    this.low = h("span", {});
    this.high = h("span", {});
    this.handles = ["low", "high"].map((key) => h("input", { type: "range", min: "0", max: String(STEPS), testid: `range-${key}`,
      "aria-label": t(`relief.range.${key}`), oninput: () => this.#moved() }));
    this.element = h("div", { class: "legend", hidden: true, testid: "relief-legend" },
      this.canvas, h("div", { class: "handles" }, this.handles), h("div", { class: "ends", role: "img" }, this.low, h("span", { class: "zero" }, t("relief.zero")), this.high));
  }

  /** Take the histogram, colours and range of a relief map; null: there is none. */
  show(facts) {
    const mark = JSON.stringify(facts);
    if (!facts || this.mark === mark) return;
    this.mark = mark;
    this.facts = facts;
    const { from, to } = facts.histogram;
    const at = (value) => String(Math.round((STEPS * (value - from)) / (to - from)));
    this.handles[0].value = at(Math.min(facts.range[0], 0));
    this.handles[1].value = at(Math.max(facts.range[1], 0));
    this.#tell();
  }

  get limits() {
    const { from, to } = this.facts.histogram;
    const [low, high] = this.handles.map(({ value }) => from + ((to - from) * value) / STEPS);
    return [Math.min(low, -1e-3), Math.max(high, 1e-3)];
  }

  #moved() {
    this.#tell();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.changed(...this.limits), SETTLE_MS);
  }

  #tell() {
    const [low, high] = this.limits;
    this.low.textContent = number(low, 2);
    this.high.textContent = `${number(high, 2)} m`;
    this.element.querySelector(".ends").setAttribute("aria-label", t("relief.legend", { low: number(low, 2), high: number(high, 2) }));
    const { counts, from, to } = this.facts.histogram;
    const { colours } = this.facts;
    const { width, height } = this.canvas;
    const context = this.canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    const most = Math.sqrt(Math.max(...counts, 1));
    counts.forEach((count, index) => {
      const r = from + ((index + 0.5) / counts.length) * (to - from);
      const share = r < 0 ? 0.5 - 0.5 * Math.min(r / low, 1) : 0.5 + 0.5 * Math.min(r / high, 1);
      context.fillStyle = colours[Math.round(share * (colours.length - 1))];
      const tall = Math.max((height * Math.sqrt(count)) / most, count ? 1 : 0);
      context.fillRect((index * width) / counts.length, height - tall, width / counts.length + 0.5, tall);
    });
  }
}
