/** What of a pixel grid is shown, by one pane or by two: the pixel in the middle and the zoom. */

const FINEST = 32;
/** The middle stays within the grid and half of it around. */
const BEYOND = 0.5;
const ZOOM_MS = 120;
/** A drag that ends in motion coasts: what is left of its speed after a millisecond, and its least. */
const SLOWING = 0.005;
const SLOWEST = 0.05;

const between = (low, value, high) => Math.min(Math.max(value, low), high);
const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

export class View extends EventTarget {
  constructor(width, height) {
    super();
    this.size = [width, height];
    this.centre = this.size.map((extent) => (extent - 1) / 2);
    this.zoom = 1000 / width;
    this.coarsest = 160 / Math.max(width, height);
  }

  /** Show a pixel in the middle, at screen pixels a pixel, as far as the limits allow. */
  show(centre, zoom = this.zoom) {
    this.zoom = this.#limited(zoom);
    this.centre = centre.map((place, axis) =>
      between(-BEYOND * this.size[axis] - 0.5, place, (1 + BEYOND) * this.size[axis] - 0.5));
    this.dispatchEvent(new Event("change"));
  }

  #limited(zoom) {
    return between(this.coarsest, zoom, FINEST);
  }

  /** Move what is shown by CSS pixels. */
  pan(dx, dy) {
    this.show([this.centre[0] - dx / this.zoom, this.centre[1] - dy / this.zoom]);
  }

  /** Zoom; the pixel at `offset` from the pane's middle [CSS px] stays where it is. */
  zoomAbout(offset, zoom) {
    const by = 1 / this.zoom - 1 / this.#limited(zoom);
    this.show(this.centre.map((place, axis) => place + offset[axis] * by), zoom);
  }

  /** Zoom by a factor about a place, within a moment; further calls add up. */
  zoomSoftly(offset, factor) {
    const goal = between(this.zoom / 4, this.#limited((this.goal ?? this.zoom) * factor), this.zoom * 4);
    const from = this.zoom;
    if (calm()) return this.zoomAbout(offset, goal);
    this.#animate((elapsed) => {
      const done = Math.min(1, elapsed / ZOOM_MS);
      this.zoomAbout(offset, from * (goal / from) ** (1 - (1 - done) ** 3));
      return done < 1;
    });
    this.goal = goal;
    return undefined;
  }

  /** Go on moving at a speed [CSS px a ms], ever slower. */
  coast([vx, vy]) {
    const speed = Math.hypot(vx, vy);
    if (speed < SLOWEST || calm()) return;
    let before = 0;
    this.#animate((elapsed) => {
      const way = (1 - Math.exp(-SLOWING * elapsed)) / SLOWING;
      this.pan(vx * (way - before), vy * (way - before));
      before = way;
      return speed * Math.exp(-SLOWING * elapsed) > SLOWEST;
    });
  }

  /** Stop where it is. */
  rest() {
    cancelAnimationFrame(this.frame);
    this.goal = null;
  }

  #animate(step) {
    this.rest();
    const start = performance.now();
    const next = () => {
      if (step(performance.now() - start)) this.frame = requestAnimationFrame(next);
      else this.goal = null;
    };
    this.frame = requestAnimationFrame(next);
  }
}

/** A view of a pixel grid: never turned, pixels up to 32 screen pixels large. */
export const pixelView = (width, height) => new View(width, height);

const CLICK_TOLERANCE = 4;
/** The wheel turned by so much zooms to double size; at most by that at once. */
const WHEEL = 300;
const LINE = 40;
/** Less than this at once comes from fingers on a pad, moves by itself smoothly. */
const PAD = 4;
/** A finger that rested so long before it let go does not throw. [ms] */
const RESTED = 100;

/**
 * Drag, throw, wheel and two fingers on an element move a view; `middle()`: the CSS pixel of the
 * element in its middle; a press without motion is a click.
 */
export function steer(element, view, middle, clicked) {
  const fingers = new Map();
  let [from, trail] = [null, []];
  const at = ({ clientX, clientY }) => {
    const { left, top } = element.getBoundingClientRect();
    return [clientX - left, clientY - top];
  };
  const offset = (place) => place.map((value, axis) => value - middle()[axis]);
  /** Where the fingers are on the whole, and how far apart. */
  const hand = () => {
    const places = [...fingers.values()];
    const centre = [0, 1].map((axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length);
    return { centre, apart: Math.hypot(...centre.map((value, axis) => value - places[0][axis])) };
  };
  const down = (event) => {
    if (event.button) return;
    view.rest();
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    from = fingers.size === 1 ? at(event) : null;
    trail = [];
  };
  const move = (event) => {
    if (!fingers.has(event.pointerId)) return;
    const place = at(event);
    if (from && place.every((value, axis) => Math.abs(value - from[axis]) <= CLICK_TOLERANCE)) return;
    from = null;
    const before = hand();
    fingers.set(event.pointerId, place);
    const after = hand();
    if (before.apart && after.apart) view.zoomAbout(offset(before.centre), view.zoom * after.apart / before.apart);
    view.pan(...after.centre.map((value, axis) => value - before.centre[axis]));
    trail = [...trail, { time: event.timeStamp, place: after.centre }].filter(({ time }) => event.timeStamp - time < RESTED);
  };
  const up = (event) => {
    if (!fingers.delete(event.pointerId) || fingers.size) {
      trail = [];
      return;
    }
    if (from && event.type === "pointerup") clicked(at(event));
    const { time, place } = trail[0] ?? {};
    const last = trail.at(-1);
    if (last?.time > time && event.timeStamp - last.time < RESTED) {
      view.coast(last.place.map((value, axis) => (value - place[axis]) / (event.timeStamp - time)));
    }
    from = null;
  };
  const wheel = (event) => {
    event.preventDefault();
    const turned = event.deltaY * (event.deltaMode ? LINE : 1);
    const factor = 2 ** between(-1, -turned / WHEEL, 1);
    if (Math.abs(turned) >= PAD) return view.zoomSoftly(offset(at(event)), factor);
    view.rest();
    return view.zoomAbout(offset(at(event)), view.zoom * factor);
  };
  for (const [type, act] of Object.entries({ pointerdown: down, pointermove: move, pointerup: up, lostpointercapture: up })) {
    element.addEventListener(type, act);
  }
  element.addEventListener("wheel", wheel, { passive: false });
}
