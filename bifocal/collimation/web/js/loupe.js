/**
 * Two windows of the original photos, pixel by pixel, each around its own place: what is picked,
 * not what the screen makes of it.
 */
import { h } from "./dom.js";
import { INK } from "./drawing.js";
import { TileStore } from "./tiles.js";
import { t } from "./words/words.js";

const POWERS = [4, 6, 8, 12, 16];

export class Loupe {
  constructor() {
    Object.assign(this, { power: 8, places: { 1: null, 2: null }, lines: { 1: null, 2: null }, tiles: {}, glasses: {}, captions: {} });
    const panes = [1, 2].map((image) => h("figure", {},
      this.glasses[image] = h("canvas", { class: "glass", role: "img", "aria-label": t("loupe.photo", { image }) }),
      this.captions[image] = h("figcaption", { class: `ink-${image}` })));
    this.powerButton = h("button", { class: "quiet", type: "button", onclick: () => this.next() });
    this.element = h("section", { class: "loupe" }, h("div", { class: "glasses" }, panes),
      h("div", { class: "row" }, h("p", { class: "hint" }, t("loupe.hint")), this.powerButton));
    this.#tell();
  }

  #tell() {
    this.powerButton.textContent = `${this.power}×`;
    this.powerButton.setAttribute("aria-label", `${t("loupe.power")} ${this.power}`);
  }

  /** Tiles of the photos: `info` of both, once known or when they change. */
  source(image, info) {
    this.tiles[image] = new TileStore(`tiles/photo/${image}`, info, () => this.paint());
    this.paint();
  }

  next() {
    this.power = POWERS[(POWERS.indexOf(this.power) + 1) % POWERS.length];
    this.#tell();
    this.paint();
  }

  /** Where to look in photo `image`: its pixel, or null; `line`: what to draw through it. */
  look(image, pixel, line = null) {
    this.places[image] = pixel;
    this.lines[image] = line;
    this.paint();
  }

  paint() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      for (const image of [1, 2]) this.#draw(image);
    });
  }

  #draw(image) {
    const canvas = this.glasses[image];
    const side = canvas.clientWidth;
    if (!side) return;
    const ratio = window.devicePixelRatio;
    if (canvas.width !== Math.round(side * ratio)) {
      canvas.width = canvas.height = Math.round(side * ratio);
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, side, side);
    const place = this.places[image];
    const digits = place ? place.map((value) => value.toFixed(2)).join(", ") : "–";
    this.captions[image].textContent = `${image} · ${digits}`;
    if (!place || !this.tiles[image]) return;
    this.#photo(context, image, side);
    this.#cross(context, image, side);
  }

  #photo(context, image, side) {
    const [column, row] = this.places[image];
    const { tile: size, max_level: level, width, height } = this.tiles[image].info;
    const wanted = [];
    const half = side / 2 / this.power;
    // A pixel spans half a pixel to each side of its whole number.
    const [left, top] = [column + 0.5 - half, row + 0.5 - half];
    context.imageSmoothingEnabled = false;
    const last = (start) => Math.floor((start + 2 * half) / size);
    for (let i = Math.floor(left / size); i <= last(left); i++) {
      for (let j = Math.floor(top / size); j <= last(top); j++) {
        if (i < 0 || j < 0 || i * size >= width || j * size >= height) continue;
        wanted.push([level, i, j]);
        const tile = this.tiles[image].get(level, i, j);
        if (!tile) continue;
        const [x, y] = [(i * size - left) * this.power, (j * size - top) * this.power];
        context.drawImage(tile, x, y, tile.width * this.power, tile.height * this.power);
      }
    }
    this.tiles[image].load(wanted);
  }

  #cross(context, image, side) {
    const middle = side / 2;
    const line = this.lines[image];
    if (line) {
      context.beginPath();
      line.forEach(([column, row], index) => {
        const x = middle + (column - this.places[image][0]) * this.power;
        const y = middle + (row - this.places[image][1]) * this.power;
        if (index) context.lineTo(x, y);
        else context.moveTo(x, y);
      });
      context.setLineDash([5, 4]);
      context.strokeStyle = "#ffffff";
      context.lineWidth = 1;
      context.stroke();
      context.setLineDash([]);
    }
    for (const [style, width] of [["rgba(0, 0, 0, 0.7)", 3], [INK[image], 1]]) {
      context.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        context.moveTo(middle + dx * 4, middle + dy * 4);
        context.lineTo(middle + dx * middle, middle + dy * middle);
      }
      context.strokeStyle = style;
      context.lineWidth = width;
      context.stroke();
    }
  }
}
