/** A pane: pictures on one pixel grid, with a canvas above them for what is drawn. */
import { h } from "./dom.js";
import { steer } from "./view.js";

export { pictureLayer, tileLayer } from "./painting.js";
export { pixelView } from "./view.js";

const SETTLED_MS = 100;

/** Two panes in a viewer beside each other, or above where pictures come out clearly larger. */
export function spread(viewer, width, height) {
  const { clientWidth: w, clientHeight: h } = viewer;
  const beside = Math.min(w / 2 / width, h / height);
  const above = Math.min(w / width, h / 2 / height);
  viewer.classList.toggle("stacked", above > 1.15 * beside);
}

export class Pane extends EventTarget {
  /** `painter(context, pane)` draws what lies above the photos. */
  constructor({ label, view, frame, painter }) {
    super();
    Object.assign(this, { view, frame, painter, width: 0, height: 0, shift: [0, 0], layers: [] });
    this.whole = [-0.5, -0.5, ...view.size.map((extent) => extent - 0.5)];
    this.extent = this.whole;
    this.canvas = h("canvas", { class: "drawing", "aria-hidden": "true" });
    // Of whole pixels: the browser stretches what is drawn over fractions of one.
    this.ground = h("div", { class: "ground" }, this.canvas);
    this.element = h("div", { class: "pane", tabindex: "0", role: "application" }, this.ground);
    this.element.setAttribute("aria-label", label);
    steer(this.ground, view, () => [this.width / 2, this.height / 2], (pixel) => this.#tell("pick", pixel));
    this.element.addEventListener("pointermove", ({ clientX, clientY }) => {
      const { left, top } = this.ground.getBoundingClientRect();
      this.#tell("hover", [clientX - left, clientY - top]);
    });
    this.element.addEventListener("pointerleave", () => this.#tell("hover", null));
    this.moved = () => this.#move();
    view.addEventListener("change", this.moved);
    this.resized = new ResizeObserver(() => this.#resize());
    this.resized.observe(this.element);
  }

  /** Screen pixels that one pixel of the grid takes. */
  get zoom() {
    return this.view.zoom;
  }

  /** Photo pixel -> pixel of the shown grid. */
  grid(image, pixel) {
    return this.frame.fromPhoto(image, pixel);
  }

  /** Pixel of the grid -> CSS pixel within the pane. */
  place([column, row]) {
    const { centre, zoom } = this.view;
    return [this.width / 2 + (column - centre[0]) * zoom, this.height / 2 + (row - centre[1]) * zoom];
  }

  /** CSS pixel within the pane -> pixel of the grid. */
  unplace([x, y]) {
    const { centre, zoom } = this.view;
    return [centre[0] + (x - this.width / 2) / zoom, centre[1] + (y - this.height / 2) / zoom];
  }

  /** Photo pixel -> CSS pixel within the pane. */
  screen(image, pixel) {
    return this.place(this.grid(image, pixel));
  }

  /** CSS pixel within the pane -> photo pixel. */
  photo(image, pixel) {
    return this.frame.toPhoto(image, this.unplace(pixel));
  }

  /** The photo pixel in the middle of what is shown, within a photo of the survey; null before. */
  middle(image) {
    if (!this.width) return null;
    const pixel = this.photo(image, [this.width / 2, this.height / 2]);
    return pixel.every(Number.isFinite) ? pixel : null;
  }

  /** The pictures to be seen, the upper one last. */
  setLayers(layers) {
    for (const layer of this.layers) layer.pane = null;
    for (const layer of layers) layer.pane = this;
    this.layers = layers;
    this.ground.replaceChildren(...layers.map(({ canvas }) => canvas), this.canvas);
    this.repaint();
  }

  /** Give back the layers and what they hold: another pane takes this one's place. */
  dispose() {
    this.resized.disconnect();
    this.view.removeEventListener("change", this.moved);
    clearTimeout(this.settling);
    this.view.rest();
    const { layers } = this;
    this.setLayers([]);
    for (const layer of layers) layer.dispose();
    cancelAnimationFrame(this.waiting);
  }

  /** Show these pixels of the grid where all is to be shown: the rest is empty. */
  frameTo(frame) {
    if (!frame.length) return;
    const [columns, rows] = [0, 1].map((axis) => frame.map((pixel) => pixel[axis]));
    const [left, top, right, bottom] = this.whole;
    this.extent = [Math.max(Math.min(...columns), left), Math.max(Math.min(...rows), top),
      Math.min(Math.max(...columns), right), Math.min(Math.max(...rows), bottom)];
  }

  /** Show the whole grid. */
  fit() {
    const [left, top, right, bottom] = this.extent;
    const zoom = Math.min((this.width || 800) / (right - left), (this.height || 600) / (bottom - top)) / 1.04;
    this.view.rest();
    this.view.show([(left + right) / 2, (top + bottom) / 2], zoom);
  }

  /** Bring a pixel of the grid to the middle, at least at `zoom`. */
  flyTo(pixel, zoom = 2) {
    this.view.rest();
    this.view.show(pixel, Math.max(this.zoom, zoom));
  }

  zoomBy(factor) {
    this.view.rest();
    this.view.zoomAbout([0, 0], this.zoom * factor);
  }

  panBy(dx, dy) {
    this.view.pan(-dx, -dy);
  }

  /** Draw what lies above the photos anew before the next frame. */
  paint() {
    this.waiting ||= requestAnimationFrame(() => this.#draw());
  }

  /** Draw the photos, too. */
  repaint() {
    this.stale = true;
    this.paint();
  }

  /** Draw fast as long as the view moves, and well as soon as it rests. */
  #move() {
    this.moving = true;
    clearTimeout(this.settling);
    this.settling = setTimeout(() => {
      this.moving = false;
      this.repaint();
    }, SETTLED_MS);
    this.repaint();
  }

  #tell(type, pixel) {
    this.dispatchEvent(new CustomEvent(type, { detail: { pixel, pane: this } }));
  }

  /** Take the size of the place it was just put in. */
  mounted() {
    this.#resize();
  }

  #resize() {
    const { left, top, width, height } = this.element.getBoundingClientRect();
    const ratio = window.devicePixelRatio;
    [this.width, this.height] = [Math.ceil(width), Math.ceil(height)];
    [this.ground.style.width, this.ground.style.height] = [`${this.width}px`, `${this.height}px`];
    // From a whole device pixel on, too.
    const origin = [left - this.shift[0], top - this.shift[1]];
    this.shift = origin.map((edge) => Math.round(edge * ratio) / ratio - edge);
    [this.element.style.left, this.element.style.top] = this.shift.map((by) => `${by}px`);
    if (this.width && !this.view.fitted) {
      this.view.fitted = true;
      this.fit();
    }
    this.stale = true;
    this.#draw();
  }

  #draw() {
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    if (!this.width) return;
    const ratio = window.devicePixelRatio;
    for (const layer of this.stale ? this.layers : []) {
      layer.canvas.hidden = !layer.visible;
      if (!layer.visible) continue;
      const context = this.#cleared(layer.canvas, ratio);
      context.save();
      layer.paint(context, this, ratio);
      context.restore();
    }
    this.stale = false;
    const context = this.#cleared(this.canvas, ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.texts = new Map();
    this.painter(context, this);
  }

  /** Empty a canvas in the screen's pixels, and size it as the pane where that has changed. */
  #cleared(canvas, ratio) {
    const size = [this.width, this.height].map((extent) => Math.round(extent * ratio));
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    if (canvas.width === size[0] && canvas.height === size[1]) context.clearRect(0, 0, ...size);
    else [canvas.width, canvas.height] = size;
    [canvas.style.width, canvas.style.height] = size.map((extent) => `${extent / ratio}px`);
    return context;
  }
}
