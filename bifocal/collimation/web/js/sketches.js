/** Words of the trade as small pictures: on hover and focus, beside what they name. */
import { Directive, directive, h, html, noChange, render, svg } from "./dom.js";
import { t } from "./words/words.js";

/** Lines as [class, path]: w wall, c camera, r ray, m what is meant; and where its letter stands. */
const WALL = ["w", "M150 8V112"];
const STEP = ["w", "M150 8V40H128V62H150V112"];
const CAMERAS = ["c", "M14 56l10-5v10zM62 56l10-5v10z"];
const SKETCHES = {
  nadir: [[WALL, ["c", "M20 34l10-5v10z"], ["r", "M30 34H150"], ["m", "M144 34a6 6 0 1 0 12 0a6 6 0 1 0-12 0"]], "N", [160, 30]],
  centre: [[WALL, ["c", "M14 40l10-5v10zM70 62l10-5v10z"], ["r", "M24 40L150 89"], ["m", "M144 89a6 6 0 1 0 12 0a6 6 0 1 0-12 0"]], "e", [160, 100]],
  s1: [[STEP, CAMERAS, ["r", "M24 56L150 26"], ["m", "M156 56V26M153 30l3-4 3 4"]], "s₁", [162, 44]],
  s2: [[STEP, CAMERAS, ["r", "M72 56L150 14"], ["m", "M156 56V14M153 18l3-4 3 4"]], "s₂", [162, 40]],
  delta_s: [[STEP, CAMERAS, ["r", "M24 56L150 26M72 56L150 14"], ["m", "M156 26V14"]], "Δs", [160, 22]],
  e1: [[STEP, ["c", "M14 56l10-5v10z"], ["r", "M24 56L150 34"], ["m", "M156 40V34"]], "e₁", [160, 40]],
  r: [[STEP, CAMERAS, ["m", "M128 70H150M132 67l-4 3 4 3M146 67l4 3-4 3"]], "r", [135, 84]],
  sigma: [[WALL, CAMERAS, ["r", "M24 50L150 34M24 62L150 46M72 50L150 30M72 62L150 52"], ["m", "M128 40L150 30L172 40L150 52Z"]], "σ", [176, 44]],
};

function sketched(node, name) {
  let shown = null;
  const hide = () => { shown?.remove(); shown = null; };
  const show = () => {
    if (shown) return;
    shown = h("div", { class: "sketch", role: "tooltip" });
    render(drawn(name), shown);
    document.body.append(shown);
    const { left, top, height } = node.getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: tall } = shown;
    shown.style.left = `${Math.max(6, Math.min(left, innerWidth - width - 6))}px`;
    shown.style.top = `${top + height + tall + 8 < innerHeight ? top + height + 4 : top - tall - 4}px`;
  };
  node.tabIndex = 0;
  node.classList.add("sketched");
  for (const [event, action] of [["pointerenter", show], ["focus", show], ["pointerleave", hide], ["blur", hide]]) {
    node.addEventListener(event, action);
  }
}

/** Its sketch for an element of a template, where there is one: shown while it is pointed at or has the focus. */
export const sketch = directive(class extends Directive {
  update({ element }, [name]) {
    if (!this.done && name in SKETCHES) sketched(element, name);
    this.done = true;
    return noChange;
  }
});

function drawn(name) {
  const [paths, letter, [x, y]] = SKETCHES[name];
  return html`<svg viewBox="0 0 200 120" aria-hidden="true">${paths.map(([kind, d]) => svg`<path class="sketch-${kind}" d=${d}></path>`)}<text x=${x}
    y=${y}>${letter}</text></svg><p>${t(`sketch.${name}`)}</p>`;
}
