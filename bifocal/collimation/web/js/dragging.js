/** Things drawn on a pane that are dragged: marks of the point in hand, corners of what is drawn. */

/** A press that moves less is a click. [CSS px] */
const STILL = 3;

/**
 * `find(place)`: what may be dragged at a CSS pixel of the pane, or null; `move(what, place)`: it is
 * dragged there; `drop(what, place)`: it is left there.
 */
export function draggable(pane, { find, move, drop }) {
  const { element } = pane;
  element.addEventListener("pointerdown", (down) => {
    const { left, top } = pane.ground.getBoundingClientRect();
    const at = ({ clientX, clientY }) => [clientX - left, clientY - top];
    const from = at(down);
    const what = down.button ? null : find(from);
    if (!what) return;
    // The photo under it stays.
    down.stopPropagation();
    element.setPointerCapture(down.pointerId);
    const listening = new AbortController();
    const { signal } = listening;
    let moving = false;
    const on = (type, act) => element.addEventListener(type, act, { signal, capture: true });
    on("pointermove", (event) => {
      const to = at(event);
      moving ||= Math.hypot(to[0] - from[0], to[1] - from[1]) > STILL;
      if (!moving) return;
      event.stopPropagation();
      move(what, to);
    });
    on("pointerup", (event) => {
      listening.abort();
      event.stopPropagation();
      if (moving) drop(what, at(event));
      else pane.dispatchEvent(new CustomEvent("pick", { detail: { pixel: from, pane } }));
    });
    on("pointercancel", () => listening.abort());
  }, { capture: true });
}

/** The nearest of some `{ place, ... }` within `reach` CSS pixels of a place, or null. */
export function nearest(marks, [x, y], reach) {
  const far = ({ place: [u, v] }) => Math.hypot(u - x, v - y);
  const [best] = marks.filter((mark) => far(mark) <= reach).sort((a, b) => far(a) - far(b));
  return best ?? null;
}
