/**
 * The pictures under what is drawn on a pane, each on a canvas of its own in the screen's pixels.
 * Tiles are first put together, whole pixel by whole pixel, then drawn at once: no seams, and every
 * pixel where `Pane.place` says, to fractions of one.
 */
import { h } from "./dom.js";
import { TileStore } from "./tiles.js";

/** From so many screen pixels a pixel on, its edges are seen. */
const CRISP = 1.5;
/** What is put together reaches so far beyond the pane at most: not anew with every move. [px] */
const SLACK = 256;

class Layer {
  constructor(className) {
    this.canvas = h("canvas", { class: className, "aria-hidden": "true" });
    this.visible = true;
  }

  setOpacity(value) {
    this.canvas.style.opacity = String(value);
  }

  setVisible(visible) {
    if (this.visible === visible) return;
    this.visible = visible;
    this.changed();
  }

  changed() {
    this.pane?.repaint();
  }

  dispose() {}
}

class TileLayer extends Layer {
  constructor(className, address, info, [left, top, scale], frames) {
    super(className);
    const [right, bottom] = [left + info.width * scale, top + info.height * scale];
    const edges = [[left, top], [right, top], [right, bottom], [left, bottom]];
    const whole = frames.length > 0 && frames.every((frame) => frame.length > 2);
    Object.assign(this, { info, scale, corner: [left, top], frames: whole ? [edges, ...frames] : [edges] });
    this.store = new TileStore(address, info, () => this.changed());
    this.sheet = h("canvas");
  }

  dispose() {
    this.store.dispose();
  }

  paint(context, pane, ratio) {
    const { info } = this;
    const zoom = pane.zoom * ratio * this.scale;
    const level = Math.min(Math.max(info.max_level + Math.round(Math.log2(zoom)), 0), info.max_level);
    const factor = 2 ** (info.max_level - level);
    const across = zoom * factor;
    // Pixels of several screen pixels are enlarged by a whole number before they are drawn smoothly.
    const grain = level === info.max_level && across >= CRISP ? Math.round(across) : 1;
    const size = [info.width, info.height].map((extent) => Math.ceil(extent / factor));
    const corner = pane.place(this.corner).map((place) => place * ratio);
    const block = Math.max(1, Math.floor(SLACK / grain));
    const snapped = (place, round) => round(place / across / block) * block;
    const first = corner.map((place) => Math.max(0, snapped(-place, Math.floor)));
    const end = [context.canvas.width, context.canvas.height]
      .map((extent, axis) => Math.min(size[axis], snapped(extent - corner[axis], Math.ceil)));
    if (first.some((start, axis) => start >= end[axis])) return;
    this.#assemble(level, grain, first, end);
    for (const frames of [this.frames.slice(0, 1), this.frames.slice(1)]) clip(context, pane, ratio, frames);
    const [x, y, width, height] = [...corner.map((place, axis) => place + first[axis] * across),
      ...end.map((stop, axis) => (stop - first[axis]) * across)];
    // Chromium places what it smooths simply to 1/32 px only, and is six times slower at it well.
    context.imageSmoothingQuality = pane.moving ? "low" : "high";
    context.drawImage(this.sheet, x, y, width, height);
  }

  /** Put the pixels from `first` to before `end` of a level together, each `grain` pixels large. */
  #assemble(level, grain, first, end) {
    const { store, sheet, info } = this;
    const key = [level, grain, first, end, store.count].join();
    if (this.key === key) return;
    this.key = key;
    [sheet.width, sheet.height] = end.map((stop, axis) => (stop - first[axis]) * grain);
    const context = sheet.getContext("2d");
    const side = info.tile;
    const coarsest = Math.max(0, Math.min(level, info.max_level - Math.ceil(Math.log2(Math.max(info.width, info.height) / side))));
    const wanted = [[coarsest, 0, 0, -1]];
    const middle = end.map((stop, axis) => (stop + first[axis]) / 2 / side - 0.5);
    for (let row = Math.floor(first[1] / side); row * side < end[1]; row++) {
      for (let column = Math.floor(first[0] / side); column * side < end[0]; column++) {
        const from = [column, row].map((index, axis) => Math.max(index * side, first[axis]));
        const to = [column, row].map((index, axis) => Math.min((index + 1) * side, end[axis]));
        for (let up = 0; up <= level - coarsest; up++) {
          const shrink = 2 ** up;
          const place = [column, row].map((index) => Math.floor(index / shrink));
          const tile = store.get(level - up, ...place);
          if (!tile) continue;
          context.imageSmoothingEnabled = up > 0;
          context.drawImage(tile, ...from.map((start, axis) => start / shrink - place[axis] * side),
            ...to.map((stop, axis) => (stop - from[axis]) / shrink),
            ...from.map((start, axis) => (start - first[axis]) * grain), ...to.map((stop, axis) => (stop - from[axis]) * grain));
          break;
        }
        wanted.push([level, column, row, Math.hypot(column - middle[0], row - middle[1])]);
      }
    }
    store.load(wanted.sort((one, two) => one[3] - two[3]).map(([finer, column, row]) => [finer, column, row]));
  }
}

/** Draw from now on within some frames alone: outside there is no photo, and no black. */
function clip(context, pane, ratio, frames) {
  if (!frames.length) return;
  context.beginPath();
  for (const frame of frames) {
    for (const pixel of frame) context.lineTo(...pane.place(pixel).map((place) => place * ratio));
    context.closePath();
  }
  context.clip();
}

class PictureLayer extends Layer {
  constructor(className, url, extent) {
    super(className);
    this.extent = extent;
    this.image = h("img", { src: url });
    this.image.decode().then(() => this.changed(), () => {});
  }

  paint(context, pane, ratio) {
    if (!this.image.naturalWidth || !this.image.complete) return;
    const [left, top, right, bottom] = this.extent;
    const from = pane.place([left, top]).map((place) => place * ratio);
    const to = pane.place([right, bottom]).map((place) => place * ratio);
    context.imageSmoothingQuality = "medium";
    context.drawImage(this.image, ...from, to[0] - from[0], to[1] - from[1]);
  }
}

/**
 * Layer of one tile pyramid; `info` is what the server says of it. `place`: left and upper edge on
 * the grid, in columns and rows, and how many pixels of the grid one of its takes.
 */
export const tileLayer = (className, address, info, place = null, ...frames) =>
  new TileLayer(className, address, info, place ?? [-0.5, -0.5, 1], frames);

/** Layer of one picture that covers `extent` of the grid (columns and rows of its outer edges). */
export const pictureLayer = (className, url, extent) => new PictureLayer(className, url, extent);
