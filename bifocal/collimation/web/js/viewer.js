/**
 * A pane: tiled photos on one pixel grid, with a canvas above them for what is drawn. OpenLayers
 * does the tiles, the gestures and the zoom; its y runs up and its pixel i spans [i, i + 1), so
 * pixel (column, row) lies at (column + 0.5, -row - 0.5): in `toMap` and `fromMap` alone.
 */
import { h } from "./dom.js";

const { Map: TileMap, View } = ol;
const TILE = 512;
const CLICK_TOLERANCE = 4;

const toMap = ([column, row]) => [column + 0.5, -row - 0.5];
const fromMap = ([x, y]) => [x - 0.5, -y - 0.5];

/** A view of a pixel grid: zoom 1/32 to 32 screen pixels a pixel, never turned. */
export function pixelView(width, height) {
  const projection = new ol.proj.Projection({
    code: `pixels-${width}x${height}`,
    units: "pixels",
    extent: [0, -height, width, 0],
  });
  return new View({
    projection,
    center: [width / 2, -height / 2],
    extent: [-width / 2, -1.5 * height, 1.5 * width, height / 2],
    constrainOnlyCenter: true,
    smoothExtentConstraint: false,
    resolution: width / 1000,
    maxResolution: Math.max(width, height) / 160,
    minResolution: 1 / 32,
    constrainResolution: false,
    smoothResolutionConstraint: false,
    enableRotation: false,
  });
}

/** The tiles at the right and lower edge are smaller: padded, for the viewer would stretch them. */
async function loadTile(tile, address) {
  const image = new Image();
  image.src = address;
  try {
    await image.decode();
  } catch {
    return tile.setState(3); // OpenLayers' ERROR
  }
  if (image.naturalWidth === TILE && image.naturalHeight === TILE) return tile.setImage(image);
  const whole = h("canvas", { width: TILE, height: TILE });
  whole.getContext("2d").drawImage(image, 0, 0);
  return tile.setImage(whole);
}

/** Place on the map -> CSS pixel of a frame. */
const onScreen = ({ coordinateToPixelTransform: [a, b, c, d, e, f] }, [x, y]) => [a * x + c * y + e, b * x + d * y + f];

/** Show of a layer what lies within some frames alone: outside there is no photo, and no black. */
function clipped(layer, frames) {
  layer.on("prerender", (event) => {
    const { context } = event;
    context.save();
    context.beginPath();
    for (const frame of frames) {
      frame.forEach((pixel, index) => {
        const place = ol.render.getRenderPixel(event, onScreen(event.frameState, toMap(pixel)));
        if (index) context.lineTo(...place);
        else context.moveTo(...place);
      });
      context.closePath();
    }
    context.clip();
  });
  layer.on("postrender", ({ context }) => context.restore());
}

/** Layer of one tile pyramid; `info` is what the server says of it. `place`: where its grid lies. */
export function tileLayer(view, className, address, info, place = null, ...frames) {
  const [left, top, scale] = place ?? [0, 0, 1];
  const extent = [left, top - info.height * scale, left + info.width * scale, top];
  const resolutions = [];
  for (let level = 0; level <= info.max_level; level++) {
    resolutions.push(scale * 2 ** (info.max_level - level));
  }
  const source = new ol.source.TileImage({
    projection: view.getProjection(),
    tileGrid: new ol.tilegrid.TileGrid({
      extent,
      origin: [left, top],
      resolutions,
      tileSize: TILE,
    }),
    tileUrlFunction: ([level, column, row]) =>
      `${address}/${level}/${column}_${row}.jpg?v=${info.version}`,
    tileLoadFunction: loadTile,
    transition: 0,
  });
  // No `preload`: its timers outlive a layer's move to another map and end in an error. The coarse
  // tiles of the whole picture, loaded at the start, stand in for what is not there yet.
  const layer = new ol.layer.Tile({ className, extent, source });
  if (frames.length && frames.every((frame) => frame.length > 2)) clipped(layer, frames);
  return layer;
}

/** Layer of one picture that covers `extent` of the grid (columns and rows of its outer edges). */
export function pictureLayer(view, className, url, [left, top, right, bottom]) {
  const imageExtent = [left + 0.5, -bottom - 0.5, right + 0.5, -top - 0.5];
  const projection = view.getProjection();
  const source = new ol.source.ImageStatic({ url, projection, imageExtent });
  return new ol.layer.Image({ className, source });
}

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
    this.frame = frame;
    this.painter = painter;
    this.width = 0;
    this.height = 0;
    this.shift = [0, 0];
    this.canvas = h("canvas", { class: "drawing", "aria-hidden": "true" });
    // Of whole pixels: OpenLayers stretches the pointer's place, and the browser what is drawn, over
    // fractions of one, but not the photo.
    this.ground = h("div", { class: "ground" });
    this.element = h("div", { class: "pane", tabindex: "0", role: "application" }, this.ground);
    this.element.setAttribute("aria-label", label);
    this.map = new TileMap({
      target: this.ground,
      layers: [],
      controls: [],
      view,
      moveTolerance: CLICK_TOLERANCE,
      interactions: ol.interaction.defaults.defaults({
        altShiftDragRotate: false,
        doubleClickZoom: false,
        keyboard: false,
        pinchRotate: false,
        shiftDragZoom: false,
        zoomDuration: 120,
      }),
    });
    this.ground.append(this.canvas);
    this.map.on("postrender", () => this.#draw());
    this.map.on("click", (event) => this.#tell("pick", event.pixel));
    this.element.addEventListener("pointermove", (event) => {
      this.#tell("hover", this.map.getEventPixel(event));
    });
    this.element.addEventListener("pointerleave", () => this.#tell("hover", null));
    this.resized = new ResizeObserver(() => this.#resize());
    this.resized.observe(this.element);
  }

  get view() {
    return this.map.getView();
  }

  /** Screen pixels that one pixel of the grid takes. */
  get zoom() {
    return 1 / this.view.getResolution();
  }

  /** Photo pixel -> pixel of the shown grid. */
  grid(image, pixel) {
    return this.frame.fromPhoto(image, pixel);
  }

  /** Pixel of the grid -> CSS pixel within the pane. */
  place(pixel) {
    const [x, y] = toMap(pixel);
    const [cx, cy] = this.view.getCenter();
    return [this.width / 2 + (x - cx) * this.zoom, this.height / 2 - (y - cy) * this.zoom];
  }

  /** CSS pixel within the pane -> pixel of the grid. */
  unplace([x, y]) {
    const [cx, cy] = this.view.getCenter();
    return fromMap([cx + (x - this.width / 2) / this.zoom, cy - (y - this.height / 2) / this.zoom]);
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

  setLayers(layers) {
    this.map.setLayers(layers);
  }

  /** Give back the map, its layers and what they hold: another pane takes this one's place. */
  dispose() {
    this.resized.disconnect();
    cancelAnimationFrame(this.waiting);
    const layers = [...this.map.getLayers().getArray()];
    this.map.setLayers([]);
    for (const layer of layers) layer.dispose();
    this.map.setTarget(null);
    this.map.dispose();
  }

  /** Show these pixels of the grid where all is to be shown: the rest is empty. */
  frameTo(frame) {
    if (!frame.length) return;
    const places = frame.map(toMap);
    const [x, y] = [0, 1].map((axis) => places.map((place) => place[axis]));
    const [left, bottom, right, top] = this.view.getProjection().getExtent();
    this.extent = [Math.max(Math.min(...x), left), Math.max(Math.min(...y), bottom),
      Math.min(Math.max(...x), right), Math.min(Math.max(...y), top)];
  }

  /** Show the whole grid. */
  fit() {
    const [left, bottom, right, top] = this.extent ?? this.view.getProjection().getExtent();
    const [width, height] = [this.width || 800, this.height || 600];
    this.view.setCenter([(left + right) / 2, (bottom + top) / 2]);
    this.view.setResolution(1.04 * Math.max((right - left) / width, (top - bottom) / height));
  }

  /** Bring a pixel of the grid to the middle, at least at `zoom`. */
  flyTo(pixel, zoom = 2) {
    this.view.setCenter(toMap(pixel));
    if (this.zoom < zoom) this.view.setResolution(1 / zoom);
    this.map.renderSync();
  }

  zoomBy(factor) {
    this.view.setResolution(this.view.getConstrainedResolution(1 / (this.zoom * factor)));
  }

  panBy(dx, dy) {
    const [x, y] = this.view.getCenter();
    this.view.setCenter([x + dx / this.zoom, y - dy / this.zoom]);
  }

  /** Draw anew before the next frame. */
  paint() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => this.#draw());
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
    [this.canvas.width, this.canvas.height] = [this.width * ratio, this.height * ratio].map(Math.round);
    const sizes = [[this.ground, this.width, this.height],
      [this.canvas, this.canvas.width / ratio, this.canvas.height / ratio]];
    for (const [{ style }, across, down] of sizes) {
      [style.width, style.height] = [`${across}px`, `${down}px`];
    }
    // From a whole device pixel on, too.
    const origin = [left - this.shift[0], top - this.shift[1]];
    this.shift = origin.map((edge) => Math.round(edge * ratio) / ratio - edge);
    [this.element.style.left, this.element.style.top] = this.shift.map((by) => `${by}px`);
    this.map.updateSize();
    if (this.width && !this.seen) {
      this.seen = true;
      if (!this.view.get("fitted")) this.fit();
      this.view.set("fitted", true);
      this.dispatchEvent(new Event("seen"));
    }
    this.#draw();
  }

  #draw() {
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    if (!this.width) return;
    const ratio = window.devicePixelRatio;
    const context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    this.painter(context, this);
  }
}
