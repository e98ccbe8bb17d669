/** Every key, in one table: what the help shows is what the page does. */

const typing = (node) => node.matches?.("input:not([type=range], [type=checkbox], [type=file]), textarea, select");

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const hand = (app) => app.stage.picker;
const layers = (app) => app.stage.layers;
const pane = (app) => app.stage.activePane;

/** Fine, plain and coarse step of the modifier keys. */
const step = (event, fine, plain, coarse) => (event.altKey ? fine : event.shiftKey ? coarse : plain);

function arrow(app, event) {
  const [x, y] = ARROWS[event.key];
  const picker = hand(app);
  if (picker?.cursor) {
    const by = step(event, 1, 10, 50);
    return picker.moveCursor(x * by, y * by);
  }
  const by = step(event, 0.01, 0.1, 1);
  if (picker?.nudge(x * by, y * by)) return undefined;
  return pane(app)?.panBy(40 * x, 40 * y);
}

const opacity = (by) => (app) => layers(app).setOpacity(layers(app).opacity + by);
const mode = (name) => (app) => layers(app).setMode(name);

/** [what it is in the help, the keys as shown, their `event.key`s, where it applies, what it does] */
export const KEYS = [
  ["help", "?  F1", ["?", "F1"], null, (app) => app.help()],
  ["stage", "PgUp  PgDn", ["PageUp", "PageDown"], null,
    (app, event) => app.turn(event.key === "PageUp" ? -1 : 1)],
  ["undo", "Ctrl+Z", ["Ctrl+z"], null, (app) => app.undo()],
  ["redo", "Ctrl+Y", ["Ctrl+y", "Ctrl+Z"], null, (app) => app.redo()],
  ["pick", "P", ["p"], hand, (app) => hand(app).begin()],
  ["new", "N", ["n"], hand, (app) => hand(app).fresh()],
  ["photo", "1  2", ["1", "2"], hand, (app, event) => hand(app).aim(Number(event.key))],
  ["cursor", "K", ["k"], hand, (app) => hand(app).toggleCursor(pane(app))],
  ["place", "Enter", ["Enter"], hand, (app) => app.enter()],
  ["nudge", "← ↑ → ↓", Object.keys(ARROWS), null, arrow],
  ["slide", ",  .", [",", ".", ";", ":", "<", ">"], hand,
    (app, event) => hand(app).slide((",;<".includes(event.key) ? -1 : 1) * (event.shiftKey ? 1 : 0.1))],
  ["suggest", "S", ["s"], hand, (app) => hand(app).suggest()],
  ["accept", "A", ["a"], hand, (app) => hand(app).accept()],
  ["snap", "C", ["c"], (app) => hand(app) ?? app.stage.shapes,
    (app) => (hand(app) ? hand(app).snap() : app.stage.shapes.toggleSnap())],
  ["leave", "Esc", ["Escape"], (app) => hand(app) || app.stage.leave,
    (app) => app.stage.leave?.() || hand(app)?.leave()],
  ["next", "J", ["j", "J"], (app) => app.stage.list, (app, event) => app.stage.list.step(event.shiftKey ? -1 : 1)],
  ["doubtful", "Y", ["y", "Y"], (app) => app.stage.list,
    ({ stage }, event) => stage.list.step(event.shiftKey ? -1 : 1, stage.list.doubtful)],
  ["fly", "F", ["f"], hand, (app) => hand(app).selected && app.stage.flyTo(hand(app).selected)],
  ["rename", "F2", ["F2"], (app) => app.stage.rename, (app) => app.stage.rename()],
  ["type", "T", ["t"], (app) => app.stage.cycleType, (app) => app.stage.cycleType()],
  ["remove", "Del  ⌫", ["Delete", "Backspace"], (app) => app.stage.remove, (app) => app.stage.remove()],
  ["overlay", "V", ["v"], layers, mode("overlay")],
  ["opacity", "Q  W", ["q", "w"], layers, (app, event) => opacity(event.key === "q" ? -0.1 : 0.1)(app)],
  ["blink", "B", ["b"], layers, mode("blink")],
  ["swipe", "X", ["x"], layers, mode("swipe")],
  ["split", "D", ["d"], layers, mode("split")],
  ["contrast", "G  H", ["g", "G", "h", "H"], layers, (app, event) => {
    const image = event.shiftKey ? 2 : 1;
    const by = event.key.toLowerCase() === "g" ? -0.1 : 0.1;
    layers(app).setContrast(image, Math.min(Math.max(layers(app).contrast[image] + by, 0.5), 2.5));
  }],
  ["area", "U", ["u"], (app) => app.stage.toggleArea, (app) => app.stage.toggleArea()],
  ["loupe", "L", ["l"], (app) => app.stage.loupe, (app) => app.stage.loupe.next()],
  ["zoom", "+  −", ["+", "=", "-", "_"], pane, (app, event) => pane(app).zoomBy("+=".includes(event.key) ? 1.5 : 1 / 1.5)],
  ["fit", "0", ["0"], pane, (app) => pane(app).fit()],
  ["line", "E", ["e", "E"], (app) => app.stage.lines,
    (app, event) => (event.shiftKey ? app.stage.lines.finish() : app.stage.lines.add())],
  ["measure", "M", ["m"], (app) => app.stage.measure, (app) => app.stage.measure.add()],
];

/** Give the page its keys; what is typed into a field stays there, but undo is always undo. */
export function listen(app) {
  const table = new Map(KEYS.flatMap((row) => row[2].map((key) => [key, row])));
  window.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || document.querySelector("dialog[open]")) return;
    const key = (event.ctrlKey || event.metaKey ? "Ctrl+" : "") + event.key;
    if (typing(event.target)) {
      // Within a form, Enter sends it.
      if (event.key === "Escape" || (event.key === "Enter" && !event.target.form)) event.target.blur();
      return;
    }
    const focused = event.target.matches?.("button, a, summary, input") && ["Enter", " "].includes(event.key);
    const slider = event.target.matches?.("input[type=range]") && event.key.startsWith("Arrow");
    const row = table.get(key);
    if (!row || focused || slider || (row[3] && !row[3](app))) return;
    event.preventDefault();
    row[4](app, event);
  });
}
