/** What is drawn above the photos. Each image has a colour and a shape of its own. */

export const INK = { 1: "#63c7ff", 2: "#ffb454" };
const DARK = "rgba(0, 0, 0, 0.75)";
const LABELS_FROM = 60;

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
export function marker(context, image, [x, y], { selected = false, proposed = false } = {}) {
  const size = selected ? 11 : 7;
  if (proposed) context.setLineDash([3, 3]);
  stroke(context, INK[image], selected ? 2 : 1.5, (path) => {
    if (image === 1) path.arc(x, y, size, 0, 2 * Math.PI);
    else path.rect(x - size, y - size, 2 * size, 2 * size);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      path.moveTo(x + dx * size, y + dy * size);
      path.lineTo(x + dx * 2.5, y + dy * 2.5);
    }
  });
  context.setLineDash([]);
}

/** Many markers at once: one path a colour, so that a thousand cost one stroke. */
export function markers(context, image, places) {
  stroke(context, INK[image], 1.2, (path) => {
    for (const [x, y] of places) {
      if (image === 1) {
        path.moveTo(x + 5, y);
        path.arc(x, y, 5, 0, 2 * Math.PI);
      } else {
        path.rect(x - 5, y - 5, 10, 10);
      }
    }
  });
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

export function label(context, text, [x, y], style = "#ffffff") {
  context.font = "500 12px system-ui, sans-serif";
  context.lineJoin = "round";
  context.lineWidth = 3;
  context.strokeStyle = DARK;
  context.strokeText(text, x, y);
  context.fillStyle = style;
  context.fillText(text, x, y);
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
  label(context, text, [x + 10, y - 10]);
}

/**
 * All picks of `items` in the images a pane shows; the chosen one stands out, names appear where
 * there is room. `pick(item, image)` says where one is, or null.
 */
export function picks(context, pane, { items, images, pick, selected }) {
  const seen = [];
  const named = new Set();
  const inside = ([x, y]) => x > -20 && y > -20 && x < pane.width + 20 && y < pane.height + 20;
  for (const image of images) {
    const places = [];
    for (const item of items) {
      const pixel = pick(item, image);
      if (!pixel) continue;
      const place = pane.screen(image, pixel);
      if (!inside(place)) continue;
      seen.push([item, place]);
      if (item.name !== selected) places.push(place);
    }
    markers(context, image, places);
  }
  shifts(context, pane, images, seen, selected, pick);
  const crowded = seen.length > LABELS_FROM && pane.zoom < 1;
  for (const [item, [x, y]] of seen) {
    const chosen = item.name === selected;
    if (named.has(item.name)) continue;
    named.add(item.name);
    if (!crowded || chosen) label(context, item.name, [x + (chosen ? 15 : 9), y - 8]);
  }
}

function shifts(context, pane, images, seen, selected, pick) {
  for (const [item] of seen) {
    if (images.length === 2 && images.every((image) => pick(item, image))) {
      const ends = images.map((image) => pane.screen(image, pick(item, image)));
      context.beginPath();
      context.moveTo(...ends[0]);
      context.lineTo(...ends[1]);
      context.strokeStyle = "rgba(255, 255, 255, 0.6)";
      context.lineWidth = 1;
      context.stroke();
    }
    if (item.name !== selected) continue;
    for (const image of images) {
      const pixel = pick(item, image);
      if (pixel) marker(context, image, pane.screen(image, pixel), { selected: true });
    }
  }
}
