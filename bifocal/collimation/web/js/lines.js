/** Polylines with layers, and distances, heights and angles between points in space. */
import { h, html, number, render, repeat } from "./dom.js";
import { cross, textField } from "./fields.js";
import { t } from "./words/words.js";

export class Lines {
  constructor(app, picker) {
    Object.assign(this, { app, picker, current: null, first: null, layers: t("line.layers").split(", ") });
    this.element = h("section", { class: "card" });
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
    const layer = line?.layer ?? (this.element.querySelector("#line-layer").value || this.layers[0]);
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
    const inHand = this.#line?.points.join(" – ") ?? this.first ?? "";
    render(html`<h2>${t("line.title")}</h2><datalist id="layer-names">${this.layers.map((name) => html`<option value=${name}></option>`)}</datalist>
      <div class="row"><label for="line-layer">${t("line.layer")}</label><input type="text" value=${this.layers[0]} list="layer-names" id="line-layer">
        <button type="button" class="quiet" data-testid="line-new" @click=${() => this.begin()}>${t("line.new")}</button>
        <button type="button" class="quiet" data-testid="line-add" @click=${() => this.add()}>${t("line.add")}</button></div>
      <p class="hint" role="status">${this.current ? t("line.inHand", { name: this.current, corners: inHand }) : t("line.hint")}</p>
      <table class="grid"><tbody>${repeat(this.app.state.lines, ({ name }) => name, (line) => this.#row(line))}</tbody></table>`, this.element);
  }

  #row({ name, points, closed, layer }) {
    const set = (changes) => this.app.send("line.set", { name, ...changes });
    return html`<tr aria-selected=${name === this.current}>
      <th scope="row"><button type="button" class="link" @click=${() => { this.current = name; this.update(); }}>${name}</button></th>
      <td>${textField({ label: t("line.layerOf", { name }), size: 9, value: layer, save: (text) => set({ layer: text }) })}</td>
      <td>${points.join(" – ")}</td>
      <td><input type="checkbox" .checked=${closed} aria-label=${t("line.closed", { name })} @change=${({ target }) => set({ closed: target.checked })}></td>
      <td>${cross(name, () => this.app.send("line.delete", { name }))}</td></tr>`;
  }
}

const MEASURES = [["distance", "m", 4, "sigma"], ["horizontal", "m", 4], ["vertical", "m", 4], ["angle", "°", 3]];

export class Measure {
  constructor(app, picker) {
    Object.assign(this, { app, picker, names: [] });
    this.element = h("section", { class: "card" });
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
    const spread = (key, digits) => (key && Number.isFinite(result[key]) ? ` ± ${number(result[key], digits)}` : "");
    render(html`<h2>${t("measure.title")}</h2><div class="row">
        <button type="button" class="quiet" data-testid="measure-add" @click=${() => this.add()}>${t("measure.add")}</button>
        <button type="button" class="quiet" @click=${() => this.clear()}>${t("measure.clear")}</button></div>
      <p class="hint" role="status">${this.names.join(" → ") || t("measure.hint")}</p>
      <dl class="values" data-testid="measures">${MEASURES.filter(([key]) => Number.isFinite(result?.[key])).map(([key, unit, digits, sigma]) => html`<div>
        <dt>${t(`measure.${key}`)}</dt><dd>${number(result[key], digits)}${spread(sigma, digits)} ${unit}</dd></div>`)}</dl>`, this.element);
  }
}
