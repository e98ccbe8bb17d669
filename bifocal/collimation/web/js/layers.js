/** The two photos over each other: opacity, blink, swipe, side by side, contrast of each. */
import { h, html, live, render } from "./dom.js";
import { t } from "./words/words.js";

export const MODES = ["overlay", "blink", "swipe", "split"];
const BLINK_MS = 400;
/** How much the opacity leans towards the photo that is picked next; at both ends not at all. */
const LEAN = 0.28;

export class Superposition extends EventTarget {
  /** `viewer`: the element that holds the panes; `tools`: what stands beside the sliders. */
  constructor(viewer, tools) {
    super();
    Object.assign(this, { viewer, tools, mode: "overlay", opacity: 0.5, swipe: 0.5, front: 2 });
    this.contrast = { 1: 1, 2: 1 };
    this.layers = { 1: null, 2: null };
    this.element = h("div", { class: "layer-bar", role: "toolbar", "aria-label": t("layer.bar") });
    this.handle = h("div", { class: "swipe-handle", hidden: true, role: "slider", tabindex: "0",
      "aria-label": t("layer.swipe"), "aria-valuemin": "0", "aria-valuemax": "100" });
    this.handle.addEventListener("pointerdown", (event) => this.#drag(event));
    this.handle.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      this.setSwipe(this.swipe + step);
    });
  }

  /** Paint the bar. */
  paint() {
    const percent = Math.round(100 * this.opacity);
    render(html`<div class="segments" role="group" aria-label=${t("layer.mode")}>${MODES.map((mode) => html`<button type="button" data-testid="layer-${mode}"
        title=${t(`layer.${mode}Hint`)} aria-pressed=${mode === this.mode} @click=${() => this.setMode(mode)}>${t(`layer.${mode}`)}</button>`)}</div>
      <span class="slider"><span class="ink-1" aria-hidden="true">1</span><label for="layer-opacity" class="unseen">${t("layer.opacity")}</label>
        <input type="range" min="0" max="100" step="1" id="layer-opacity" data-testid="layer-opacity" .value=${live(String(percent))}
          aria-valuetext=${t("layer.opacityValue", { percent })} @input=${({ target }) => this.setOpacity(target.value / 100)}>
        <span class="ink-2" aria-hidden="true">2</span><output for="layer-opacity">${percent} %</output></span>
      ${[1, 2].map((image) => html`<span class="slider small"><label for="contrast-${image}">${t("layer.contrast", { image })}</label>
        <input type="range" min="50" max="250" step="5" id="contrast-${image}" data-testid="contrast-${image}" class="range-${image}"
          .value=${live(String(Math.round(100 * this.contrast[image])))} @input=${({ target }) => this.setContrast(image, target.value / 100)}></span>`)}
      ${this.tools()}`, this.element);
  }

  /** Give it the layers of photo 1 and 2 once they exist. */
  use(layers) {
    this.layers = layers;
    this.#apply();
  }

  setMode(mode) {
    this.mode = this.mode === mode && mode !== "overlay" ? "overlay" : mode;
    this.#apply();
    this.dispatchEvent(new Event("mode"));
  }

  setOpacity(value) {
    this.opacity = Math.min(Math.max(value, 0), 1);
    this.#apply();
  }

  setSwipe(value) {
    this.swipe = Math.min(Math.max(value, 0), 1);
    this.#apply();
  }

  setContrast(image, value) {
    this.contrast[image] = value;
    this.#apply();
  }

  /** The images whose photo is to be seen, the upper one last. */
  get shown() {
    if (this.mode === "blink") return [this.front];
    if (this.mode === "overlay" && this.opacity === 0) return [1];
    if (this.mode === "overlay" && this.opacity === 1) return [2];
    return [1, 2];
  }

  #apply() {
    this.paint();
    this.handle.hidden = this.mode !== "swipe";
    this.handle.setAttribute("aria-valuenow", String(Math.round(100 * this.swipe)));
    const { style } = this.viewer;
    style.setProperty("--swipe", this.mode === "swipe" ? `${100 * this.swipe}%` : "0%");
    this.handle.style.left = `${100 * this.swipe}%`;
    for (const image of [1, 2]) {
      const value = this.contrast[image];
      style.setProperty(`--filter-${image}`, value === 1 ? "none" : `contrast(${value})`);
    }
    this.#blink();
    this.#visibility();
  }

  /** The photo that the next click belongs to comes forward, the other is a ghost. */
  lean(image) {
    if (this.leaning === image) return;
    this.leaning = image;
    this.#visibility();
  }

  #visibility() {
    if (!this.layers[1]) return;
    const room = this.leaning ? 4 * this.opacity * (1 - this.opacity) : 0;
    const opacity = this.opacity + LEAN * room * (this.leaning === 2 ? 1 : -1);
    this.layers[2].setOpacity(this.mode === "overlay" ? opacity : 1);
    for (const image of [1, 2]) this.layers[image].setVisible(this.shown.includes(image));
  }

  #blink() {
    const blinking = this.mode === "blink";
    if (!blinking && this.timer) {
      clearInterval(this.timer);
      this.timer = null;
      this.front = 2;
    } else if (blinking && !this.timer) {
      this.timer = setInterval(() => {
        this.front = 3 - this.front;
        this.#visibility();
        this.dispatchEvent(new Event("blink"));
      }, BLINK_MS);
    }
  }

  #drag(event) {
    event.preventDefault();
    this.handle.setPointerCapture(event.pointerId);
    const move = ({ clientX }) => {
      const { left, width } = this.viewer.getBoundingClientRect();
      this.setSwipe((clientX - left) / width);
    };
    this.handle.addEventListener("pointermove", move);
    this.handle.addEventListener("lostpointercapture", () =>
      this.handle.removeEventListener("pointermove", move), { once: true });
  }
}
