/** What is drawn above the photos. Each image has a colour and a shape of its own. */

export const INK = { 1: "#63c7ff", 2: "#ffb454" };
const HATCH = 9;
const sprites = new Map();
const DARK = "rgba(0, 0, 0, 0.75)";
/** Room for a text's rim, and texts and markers that are kept. */
const [RIM, MOST] = [3, 4000];
/** Letters of a name beside its mark, at most. */
const LONGEST = 18;
/** Of what does not fit. */
export const DOUBT = "#ff6b6b";

/** What is drawn grows with the page's letters, as on a screen of 4K. */
let unit = 1;
const measureUnit = () => {
  unit = parseFloat(getComputedStyle(document.documentElement).fontSize) / 14;
  sprites.clear();
};
window.addEventListener("resize", measureUnit);
measureUnit();

const FONT = () => `500 ${12 * unit}px system-ui, sans-serif`;

function stroke(context, style, width, path) {
  context.beginPath();
  path(context);
  context.lineCap = "round";
  context.strokeStyle = DARK;
  context.lineWidth = width + 2;
  context.stroke();
  context.strokeStyle = style;
  context.lineWidth = width;
  context.stroke();
}

/** A cross that leaves its centre free: round for photo 1, square for photo 2. */
export function marker(context, image, [x, y], { selected = false, proposed = false, ink = INK[image] } = {}) {
  const size = (selected ? 11 : 7) * unit;
  if (proposed) context.setLineDash([3, 3]);
  stroke(context, ink, selected ? 2 : 1.5, (path) => {
    if (image === 1) path.arc(x, y, size, 0, 2 * Math.PI);
    else path.rect(x - size, y - size, 2 * size, 2 * size);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      path.moveTo(x + dx * size, y + dy * size);
      path.lineTo(x + dx * 2.5, y + dy * 2.5);
    }
  });
  context.setLineDash([]);
}

const SPRITE = 18;

/** A small marker, drawn once for each image, ink and screen. */
function sprite(image, ink) {
  const ratio = window.devicePixelRatio;
  const key = `${image}/${ink}/${ratio}`;
  let canvas = sprites.get(key);
  if (!canvas) {
    canvas = document.createElement("canvas");
    canvas.width = canvas.height = Math.ceil(SPRITE * unit * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio * unit, ratio * unit);
    const middle = SPRITE / 2;
    stroke(context, ink, 1.3, (path) => {
      if (image === 1) path.arc(middle, middle, 5, 0, 2 * Math.PI);
      else path.rect(middle - 5, middle - 5, 10, 10);
    });
    sprites.set(key, canvas);
  }
  return canvas;
}

/** Many markers at once: a thousand in every frame. */
export function markers(context, image, places, ink = INK[image]) {
  const canvas = sprite(image, ink);
  for (const [x, y] of places) {
    const side = SPRITE * unit;
    context.drawImage(canvas, x - side / 2, y - side / 2, side, side);
  }
}

export function polyline(context, style, places, { width = 2, dash = [], closed = false } = {}) {
  if (places.length < 2) return;
  context.setLineDash(dash);
  stroke(context, style, width, (path) => {
    places.forEach(([x, y], index) => (index ? path.lineTo(x, y) : path.moveTo(x, y)));
    if (closed) path.closePath();
  });
  context.setLineDash([]);
}

/** A text with its dark rim, drawn once: a thousand names in every frame. */
function lettering(text, style) {
  const ratio = window.devicePixelRatio;
  const key = `${ratio}/${style}/${text}`;
  let canvas = sprites.get(key);
  if (!canvas) {
    if (sprites.size > MOST) sprites.clear();
    canvas = document.createElement("canvas");
    const context = canvas.getContext("2d");
    context.font = FONT();
    canvas.wide = context.measureText(text).width;
    canvas.width = Math.ceil((canvas.wide + 2 * RIM) * ratio);
    canvas.height = Math.ceil(20 * unit * ratio);
    context.scale(ratio, ratio);
    Object.assign(context, { font: FONT(), lineJoin: "round", lineWidth: 3, strokeStyle: DARK, fillStyle: style });
    context.strokeText(text, RIM, 14 * unit);
    context.fillText(text, RIM, 14 * unit);
    sprites.set(key, canvas);
  }
  return canvas;
}

export function label(context, text, [x, y], style = "#ffffff") {
  const canvas = lettering(text, style);
  const ratio = window.devicePixelRatio;
  const [left, top] = [x - RIM, y - 14 * unit].map((value) => Math.round(value * ratio) / ratio);
  context.drawImage(canvas, left, top, canvas.width / ratio, canvas.height / ratio);
}

/** A line of equal precision, thin at every zoom, its number where it is seen. */
export function contour(context, pane, places, text) {
  polyline(context, "#f4f4f4", places, { width: 1 });
  const seen = places.filter((place) => inside(pane, place));
  if (seen.length) label(context, text, seen[Math.floor(seen.length / 3)].map((value) => value + 4));
}

/** Full cross through the keyboard's cursor. */
export function cursor(context, pane, [x, y], image) {
  stroke(context, INK[image], 1, (path) => {
    path.moveTo(0, y);
    path.lineTo(x - 6, y);
    path.moveTo(x + 6, y);
    path.lineTo(pane.width, y);
    path.moveTo(x, 0);
    path.lineTo(x, y - 6);
    path.moveTo(x, y + 6);
    path.lineTo(x, pane.height);
  });
}

/** The zoom centre or nadir: where relief moves nothing. */
export function centre(context, [x, y], text) {
  stroke(context, "#f2f2f2", 1.5, (path) => {
    path.arc(x, y, 4, 0, 2 * Math.PI);
    path.moveTo(x - 12, y);
    path.lineTo(x + 12, y);
    path.moveTo(x, y - 12);
    path.lineTo(x, y + 12);
  });
  beside(context, text, [x, y], 10, "#ffffff", true);
}

/**
 * All picks of `items` in the images a pane shows; the chosen one stands out, names appear where
 * there is room, what `doubtful(item)` in another colour. `pick(item, image)` says where one is, or null.
 */
export function picks(context, pane, { items, images, pick, selected, doubtful = () => false }) {
  const seen = [];
  for (const item of items) {
    const places = images.map((image) => {
      const pixel = pick(item, image);
      return pixel && pane.screen(image, pixel);
    });
    if (places.some((place) => place && inside(pane, place))) seen.push([item, places]);
  }
  shifts(context, seen);
  const inkOf = (item, image) => (doubtful(item) ? DOUBT : INK[image]);
  images.forEach((image, index) => {
    const shown = seen.filter(([item, places]) => places[index] && item.name !== selected);
    for (const ink of [INK[image], DOUBT]) {
      markers(context, image, shown.filter(([item]) => inkOf(item, image) === ink)
        .map(([, places]) => places[index]), ink);
    }
  });
  const last = seen.findLast(([item]) => item.name === selected);
  if (last) {
    images.forEach((image, index) => {
      if (last[1][index]) marker(context, image, last[1][index], { selected: true, ink: inkOf(last[0], image) });
    });
  }
  for (const [{ name }, places] of last ? [last, ...seen.filter((one) => one !== last)] : seen) {
    beside(context, name, places.find(Boolean), name === selected ? 15 : 9);
  }
}

/**
 * A text beside its mark, on whichever side is free: within the picture, over no other; on none
 * unless it is `needed`. Long ones go without their middle.
 */
export function beside(context, name, [x, y], gap, style = "#ffffff", needed = false) {
  const text = name.length > LONGEST ? `${name.slice(0, LONGEST / 2)}…${name.slice(1 - LONGEST / 2)}` : name;
  const { wide: width } = lettering(text, style);
  const height = 14 * unit;
  const room = context.canvas.width / window.devicePixelRatio;
  const sides = [[gap, -8], [gap, 17], [-gap, -8], [-gap, 17]].map(([dx, dy]) =>
    [x + dx * unit - (dx < 0 ? width : 0), y + dy * unit].map(Math.round)).filter(([left]) => left >= 0 && left + width <= room);
  const free = sides.find(([left, base]) => [-1, 0, 1].every((near) =>
    (context.texts.get(Math.round(base / height) + near) ?? []).every(([from, to, at]) =>
      to < left || from > left + width || Math.abs(at - base) >= height))) ?? (needed && sides[0]);
  if (!free) return;
  label(context, text, free, style);
  const row = Math.round(free[1] / height);
  if (!context.texts.has(row)) context.texts.set(row, []);
  context.texts.get(row).push([free[0], free[0] + width, free[1]]);
}

const inside = (pane, [x, y]) => x > -20 && y > -20 && x < pane.width + 20 && y < pane.height + 20;

/** From each pick to its partner, where both are shown. */
function shifts(context, seen) {
  context.beginPath();
  for (const [, [from, to]] of seen) {
    if (!from || !to) continue;
    context.moveTo(...from);
    context.lineTo(...to);
  }
  context.strokeStyle = "rgba(255, 255, 255, 0.6)";
  context.lineWidth = 1;
  context.stroke();
}

/** Lines of a grid within a frame, and hatching within outlines (holes left open); all in pixels of the pane's photo. */
export function sheet(context, pane, { frame, lines, outlines }, ink) {
  const trace = (pixels) => pixels.forEach((pixel, index) => {
    context[index ? "lineTo" : "moveTo"](...pane.screen(pane.image, pixel));
  });
  context.save();
  context.strokeStyle = ink;
  context.lineWidth = 1;
  context.globalAlpha = 0.75;
  context.beginPath();
  trace(frame);
  context.clip();
  context.beginPath();
  lines.forEach(trace);
  context.stroke();
  context.beginPath();
  for (const outline of outlines) {
    trace(outline);
    context.closePath();
  }
  context.clip("evenodd");
  context.beginPath();
  const { width, height } = context.canvas;
  for (let start = -height; start < width; start += HATCH) {
    context.moveTo(start, 0);
    context.lineTo(start + height, height);
  }
  context.globalAlpha = 0.5;
  context.stroke();
  context.restore();
}

/** How far a point is off, drawn many times as long. */
export function residual(context, [x, y], [dx, dy], ink) {
  stroke(context, ink, 1.6, (path) => {
    path.moveTo(x, y);
    path.lineTo(x + dx, y + dy);
    const angle = Math.atan2(dy, dx);
    for (const turn of [2.6, -2.6]) {
      path.moveTo(x + dx, y + dy);
      path.lineTo(x + dx + 6 * Math.cos(angle + turn), y + dy + 6 * Math.sin(angle + turn));
    }
  });
}
