/** Polylines with layers, and distances, heights and angles between points in space. */
import { h, keyedRows, number, setText } from "./dom.js";
import { button, fill, textInput } from "./fields.js";
import { t } from "./words/words.js";

const LAYERS = ["windows", "cornices", "doors", "edges"];

export class Lines {
  constructor(app, picker) {
    this.app = app;
    this.picker = picker;
    this.current = null;
    this.first = null;
    this.body = h("tbody");
    this.state = h("p", { class: "hint", role: "status" });
    this.layer = h("input", { type: "text", value: LAYERS[0], list: "layer-names", id: "line-layer" });
    this.element = h("section", { class: "card" }, h("h2", {}, t("line.title")),
      h("datalist", { id: "layer-names" }, LAYERS.map((name) => h("option", { value: name }))),
      h("div", { class: "row" }, h("label", { for: "line-layer" }, t("line.layer")), this.layer,
        button(t("line.new"), () => this.begin(), { class: "quiet", testid: "line-new" }),
        button(t("line.add"), () => this.add(), { class: "quiet", testid: "line-add" })),
      this.state, h("table", { class: "grid" }, this.body));
  }

  get #line() {
    return this.app.state.lines.find(({ name }) => name === this.current) ?? null;
  }

  begin() {
    const taken = new Set(this.app.state.lines.map(({ name }) => name));
    let index = 1;
    while (taken.has(`L${index}`)) index++;
    this.current = `L${index}`;
    this.first = null;
    this.update();
    this.app.say(t("line.begun", { name: this.current }));
  }

  /** The point in hand becomes the next corner of the line in hand. */
  add() {
    const { selected } = this.picker;
    if (!selected) return this.app.say(t("say.nothing"), "warning");
    if (!this.current) this.begin();
    const line = this.#line;
    const { points = this.first ? [this.first] : [], closed = false } = line ?? {};
    const layer = line?.layer ?? (this.layer.value || LAYERS[0]);
    if (points.at(-1) === selected) return undefined;
    if (points.length > 2 && points[0] === selected) return this.#set({ layer, points, closed: true });
    this.first = points.length ? null : selected;
    // A line is one from its second point on.
    if (this.first) return this.update();
    return this.#set({ layer, points: [...points, selected], closed });
  }

  finish() {
    this.current = null;
    this.update();
  }

  #set(changes) {
    return this.app.send("line.set", { name: this.current, ...changes });
  }

  update() {
    const { lines } = this.app.state;
    setText(this.state, this.current ? t("line.inHand", { name: this.current,
      corners: this.#line?.points.join(" – ") ?? this.first ?? "" }) : t("line.hint"));
    keyedRows(this.body, lines, { key: ({ name }) => name,
      signature: (line) => JSON.stringify([line, line.name === this.current]),
      build: (line) => this.#row(line) });
  }

  #row(line) {
    const { name, points, closed } = line;
    const layer = textInput({ label: t("line.layerOf", { name }), size: "9",
      save: (text) => this.app.send("line.set", { name, layer: text }) });
    fill(layer, line.layer);
    const close = h("input", { type: "checkbox", checked: closed, "aria-label": t("line.closed", { name }),
      onchange: () => this.app.send("line.set", { name, closed: close.checked }) });
    return h("tr", { "aria-selected": String(name === this.current) },
      h("th", { scope: "row" }, button(name, () => { this.current = name; this.update(); }, { class: "link" })),
      h("td", {}, layer), h("td", {}, points.join(" – ")), h("td", {}, close),
      h("td", {}, button("×", () => this.app.send("line.delete", { name }),
        { class: "icon", "aria-label": t("list.deleteOf", { name }) })));
  }
}

const MEASURES = [["distance", "m", 4, "sigma"], ["horizontal", "m", 4], ["vertical", "m", 4], ["angle", "°", 3]];

export class Measure {
  constructor(app, picker) {
    this.app = app;
    this.picker = picker;
    this.names = [];
    this.chosen = h("p", { class: "hint", role: "status" });
    this.values = h("dl", { class: "values", testid: "measures" });
    this.element = h("section", { class: "card" }, h("h2", {}, t("measure.title")),
      h("div", { class: "row" },
        button(t("measure.add"), () => this.add(), { class: "quiet", testid: "measure-add" }),
        button(t("measure.clear"), () => this.clear(), { class: "quiet" })),
      this.chosen, this.values);
    this.show(null);
  }

  clear() {
    this.names = [];
    this.question = null;
    this.show(null);
  }

  /** Measure to the point in hand: the second gives distances, the third an angle. */
  async add() {
    const { selected } = this.picker;
    if (!selected) return this.app.say(t("say.nothing"), "warning");
    if (this.names.at(-1) !== selected) this.names = [...this.names.slice(-2), selected];
    return this.update();
  }

  /** Points move, and so do the measures between them. */
  async update() {
    const known = new Set(this.app.points().map(({ name }) => name));
    const names = this.names.filter((name) => known.has(name));
    this.names = names;
    // Answers may come in another order than they were asked for: the last question counts.
    const question = {};
    this.question = question;
    if (names.length < 2) return this.show(null);
    try {
      const found = await this.app.connection.ask("api/measure", { points: names });
      if (this.question === question) this.show(found);
    } catch (error) {
      this.app.refuse(error);
    }
    return undefined;
  }

  show(result) {
    setText(this.chosen, this.names.length ? this.names.join(" → ") : t("measure.hint"));
    this.values.replaceChildren(...MEASURES.filter(([key]) => Number.isFinite(result?.[key])).map(
      ([key, unit, digits, sigma]) => h("div", {}, h("dt", {}, t(`measure.${key}`)), h("dd", {},
        `${number(result[key], digits)}${sigma && Number.isFinite(result[sigma])
          ? ` ± ${number(result[sigma], digits)}` : ""} ${unit}`))));
  }
}
