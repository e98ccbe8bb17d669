/**
 * Stage 2: control points and tape distances beside the two photos, what they say of the pair, and
 * what would help most next.
 */
import { h, keyedRows, number, parseNumber, setText } from "./dom.js";
import * as drawing from "./drawing.js";
import { button, fill, numberInput, textInput } from "./fields.js";
import { asTaken } from "./geometry.js";
import { Loupe } from "./loupe.js";
import { mediaWords } from "./media.js";
import { Picker } from "./picker.js";
import { sketched } from "./sketches.js";
import { photoMark } from "./tiles.js";
import { Pane, pixelView, spread, tileLayer } from "./viewer.js";
import { WallCard } from "./wallcard.js";
import { t } from "./words/words.js";

const COORDINATES = ["X", "Y", "r"];
/** Residuals are drawn so many times as long as they are. */
const STRETCHED = 40;

export class OrientationStage {
  constructor(app) {
    this.app = app;
    this.loupe = new Loupe();
    this.panes = [];
    this.picker = new Picker({ connection: app.connection, kind: "control", partner: false,
      items: () => app.state.control, panes: () => this.panes });
    app.listen(this.picker, () => this.refresh(), () => this.#look());
    this.wallCard = new WallCard(this);
    this.actions = { align: () => this.align.click(), accept: () => this.accept(), control: () => this.#fresh(),
      length: () => this.wallCard.arm("length") };
    this.targets = button(t("control.targets"), () => app.job("targets"), { class: "quiet", testid: "targets" });
    this.photos = h("div", { class: "viewer two" });
    this.body = h("tbody");
    this.tapes = h("tbody");
    this.advice = h("ul", { class: "advice" });
    this.further = h("ul", { class: "advice" });
    this.furtherCount = h("summary", {});
    this.furtherFold = h("details", { testid: "further" }, this.furtherCount, this.further);
    this.remarks = h("ul", { class: "remarks" });
    this.known = h("dl", { class: "values one", testid: "orientation-values" });
    this.align = button(t("align.run"), () => app.job("align"), { class: "primary", testid: "align" });
    this.acceptAlign = button(t("align.accept"), () => this.accept(), { testid: "align-accept" });
    this.good = h("p", { class: "good", role: "status", testid: "how-good" });
    this.target = h("p", { class: "target", role: "status" });
    this.exchangePlace = h("div", { class: "row" });
    this.element = h("div", { class: "stage work", id: "stage-orientation" }, this.photos,
      h("aside", { class: "side" }, h("div", { class: "panel" }, this.target, this.wallCard.element, this.loupe.element,
        this.#controlTable(), this.#tapeTable(), this.#tellResult(), this.exchangePlace), this.#result()));
  }

  #controlButtons() {
    const { picker } = this;
    return h("div", { class: "buttons" },
      button(t("control.new"), () => this.#fresh(), { class: "quiet", testid: "control-new" }),
      button(t("pick.snap"), () => picker.snap(), { class: "quiet", testid: "control-snap" }),
      button(t("control.paste"), () => this.#paste(), { class: "quiet", testid: "control-paste" }),
      this.targets);
  }

  #fresh() {
    this.wallCard.dismiss();
    this.picker.fresh(1);
  }

  #controlTable() {
    const heads = ["control.name", "control.X", "control.Y", "control.r", "control.seen", "control.residual"];
    this.table = h("table", { class: "grid", testid: "control-table" },
      h("thead", {}, h("tr", {}, heads.map((key) => h("th", { scope: "col" }, t(key))),
        h("th", {}, h("span", { class: "unseen" }, t("list.delete"))))), this.body);
    return h("section", { class: "card", onpaste: (event) => this.#pasted(event) }, h("h2", {}, t("control.title")),
      this.#controlButtons(), this.app.jobBox("targets"), h("p", { class: "hint" }, t("control.hint")), this.table);
  }

  #tapeTable() {
    const heads = ["tape.from", "tape.to", "tape.length", "tape.sigma"];
    const inputs = heads.map((key, index) => h("input", { type: "text", "aria-label": t(key),
      placeholder: t(key).replace(/ ?\[.*/, ""), inputmode: index > 1 ? "decimal" : "text", testid: `tape-${index}` }));
    const add = async () => {
      const typed = inputs.map(({ value }) => value);
      const [from, to, ...numbers] = typed.map((value) => value.trim());
      const length = parseNumber(numbers[0]);
      if (!from || !to || !(length > 0)) return this.app.say(t("tape.incomplete"), "warning");
      const accepted = await this.app.send("tape.set", { from, to, length, sigma: numbers[1] || null });
      // A refused tape stays to be mended; so does one typed meanwhile.
      if (!accepted || inputs.some(({ value }, index) => value !== typed[index])) return undefined;
      for (const input of inputs) input.value = "";
      return inputs[0].focus();
    };
    this.tapeTable = h("table", { class: "grid" }, h("thead", {}, h("tr", {},
      heads.map((key) => h("th", { scope: "col" }, t(key))), h("th", {}, h("span", { class: "unseen" }, t("list.delete"))))), this.tapes);
    return h("section", { class: "card" }, h("h2", {}, t("tape.title")), this.tapeTable,
      h("form", { class: "row add", onsubmit: (event) => { event.preventDefault(); add(); } },
        inputs, h("button", { type: "submit", class: "quiet", testid: "tape-add" }, t("tape.add"))));
  }

  #tellResult() {
    this.remarkCount = h("summary", {});
    this.fold = h("details", { testid: "align-remarks" }, this.remarkCount, this.remarks);
    this.tell = h("section", { class: "card" }, h("h2", {}, t("known.title")), this.known, this.fold);
    return this.tell;
  }

  /** What is to be done next stays in sight below the panel, however long the table. */
  #result() {
    return h("section", { class: "card next" }, h("h2", {}, t("align.title")), this.advice, this.good,
      h("div", { class: "row" }, this.align, this.acceptAlign), this.app.jobBox("align"), this.furtherFold);
  }

  /** What is accepted is done: the points come next. */
  async accept() {
    const accepted = await this.app.send("align.accept");
    if (accepted && this.app.current === "orientation") this.app.open("points");
    return accepted;
  }

  /** Let go of the tool in hand. */
  leave() {
    return this.wallCard.dismiss();
  }

  /** A click in a photo: for the tool in hand, else a control point. */
  click(pane, pixel) {
    const photo = pane.photo(pane.image, pixel);
    if (!this.wallCard.click(pane.image, photo)) return this.picker.click(pane, pixel);
    this.picker.cursor = null;
    return undefined;
  }

  #pasted(event) {
    const text = event.clipboardData.getData("text/plain");
    if (!/[\t\n;]/.test(text.trim())) return;
    event.preventDefault();
    this.app.send("control.paste", { text });
  }

  #paste() {
    const area = h("textarea", { rows: "8", "aria-label": t("control.pasteArea"),
      placeholder: t("control.pasteArea"), testid: "paste-area" });
    this.app.dialog(t("control.paste"), [h("p", { class: "hint" }, t("control.pasteHint")), area],
      t("control.pasteTake"), () => this.app.connection.send("control.paste", { text: area.value }));
  }

  async prepare(state) {
    const mark = photoMark(state);
    if (state.photos.length < 2 || this.mark === mark) return;
    this.mark = mark;
    this.picker.letGoOf(this.panes);
    for (const pane of this.panes) pane.dispose();
    this.panes = state.photos.map((photo) => this.#pane(photo));
    const [{ width, height }] = state.photos;
    this.spread?.disconnect();
    this.spread = new ResizeObserver(() => spread(this.photos, width, height));
    this.spread.observe(this.photos);
    spread(this.photos, width, height);
    this.photos.replaceChildren(...this.panes.map(({ element }) => element));
    for (const pane of this.panes) pane.mounted();
    const infos = await this.app.pyramids.both("photo", mark);
    if (this.mark !== mark) return;
    infos.forEach((info, index) => {
      const { image } = this.panes[index];
      this.panes[index].setLayers([tileLayer(`layer-${image}`, `tiles/photo/${image}`, info)]);
      this.loupe.source(image, info);
    });
  }

  #pane({ image, width, height }) {
    const view = pixelView(width, height);
    const role = t(image === 1 ? "photo.far" : "photo.near");
    const pane = new Pane({ label: t("pane.photo", { image, role }), view, frame: asTaken,
      painter: (context, self) => this.#draw(context, self) });
    Object.assign(pane, { image, images: [image] });
    this.app.follow(pane, this.picker, this);
    pane.element.append(h("span", { class: `badge ink-${image}` }, `${image} · ${role}`));
    return pane;
  }

  #draw(context, pane) {
    const { control, pair } = this.app.state;
    const { image } = pane;
    if (pair?.nadir?.[image - 1]) {
      drawing.centre(context, pane.screen(image, pair.nadir[image - 1]), t("draw.nadir"));
    }
    this.wallCard.draw(context, pane);
    drawing.picks(context, pane, { items: control.filter(({ use }) => use), images: [image],
      pick: (item, one) => this.picker.pick(item, one), selected: this.picker.selected });
    for (const item of control) {
      const [pixel, off] = [this.picker.pick(item, image), item.residual?.[image]];
      if (pixel && off) drawing.residual(context, pane.screen(image, pixel), off.map((one) => one * STRETCHED), drawing.DOUBT);
    }
    const { cursor } = this.picker;
    if (cursor?.pane === pane) drawing.cursor(context, pane, cursor.place, image);
  }

  update(state) {
    this.prepare(state).catch((error) => this.app.refuse(error));
    this.picker.settle();
    this.wallCard.update(state);
    this.targets.disabled = !state.pair;
    setText(this.good, state.good ?? "");
    this.good.hidden = !state.good;
    keyedRows(this.body, state.control, { key: ({ name }) => name,
      signature: (item) => JSON.stringify([item, item.name === this.picker.selected]),
      build: (item) => this.#controlRow(item) });
    keyedRows(this.tapes, state.tapes, { key: ({ from, to }) => `${from}\t${to}`,
      signature: JSON.stringify, build: (tape) => this.#tapeRow(tape) });
    // What is grave and what comes next stand there; the rest is folded.
    const { text: sentence } = state.steps.orientation;
    const ahead = state.advice.filter((text, index) => text === sentence || (!index && state.levels[text]));
    const further = state.advice.filter((text) => !ahead.includes(text));
    setText(this.furtherCount, t("advice.further", { count: further.length }));
    this.furtherFold.hidden = !further.length;
    for (const [list, lines] of [[this.advice, ahead], [this.further, further], [this.remarks, state.pair?.remarks ?? []]]) {
      keyedRows(list, lines, { key: (text) => text, signature: (text) => `${state.levels[text]} ${text}`,
        build: (text) => h("li", { "data-level": state.levels[text] }, text) });
    }
    const remarks = state.pair?.remarks?.length ?? 0;
    this.fold.hidden = !remarks;
    setText(this.remarkCount, t("known.remarks", { count: remarks }));
    this.#tellKnown(state);
    this.tell.hidden = !remarks && !this.known.children.length;
    this.table.hidden = !state.control.length;
    this.tapeTable.hidden = !state.tapes.length;
    this.acceptAlign.hidden = !state.pair || state.pair.accepted !== false;
    this.acceptAlign.disabled = !state.pair || state.pair.accepted !== false || !state.pair.scaled;
    setText(this.align, t(state.pair?.report?.free_scale ? "align.refine" : "align.run"));
    this.align.classList.toggle("primary", !state.pair?.current);
    // What the program is about asks for no click.
    const busy = Boolean(state.looking) && !state.pair && !state.control.length;
    this.align.hidden = this.target.hidden = busy;
    // The next step stands out.
    const current = !this.acceptAlign.disabled && state.pair.current;
    this.acceptAlign.classList.toggle("primary", current);
    this.refresh();
  }

  /** Distances and nadirs with their sigmas: of the proposal, else of the control points alone. */
  #tellKnown({ pair, live }) {
    const facts = JSON.stringify([pair?.images.map(({ distance, media }) => [distance, media]), pair?.report?.standard_deviations, live]);
    if (facts === this.facts) return;
    this.facts = facts;
    const distances = pair?.images.map(({ distance }) => distance) ?? live?.distances ?? [];
    const sigmas = pair?.report?.standard_deviations ?? live?.deviations ?? {};
    const rows = distances.flatMap((distance, index) => [
      [t("known.distance", { image: index + 1 }), distance, sigmas[`distance${index + 1}`]],
      [t("known.nadir", { image: index + 1 }), null, sigmas[`nadir${index + 1}`]]]);
    this.known.replaceChildren(...rows.filter(([, value, sigma]) => value !== null || Number.isFinite(sigma))
      .map(([name, value, sigma]) => h("div", {}, value === null ? sketched(h("dt", {}, name), "nadir") : h("dt", {}, name), h("dd", {},
        `${value === null ? "" : number(value, 3)}${Number.isFinite(sigma) ? ` ± ${number(sigma, 3)}` : ""} m`.trim()))));
    this.#tellMedia(pair?.images.map(({ media }) => media) ?? [], sigmas);
  }

  /** What the pair looks through, and where that begins. */
  #tellMedia(seen, sigmas) {
    if (!seen[0]) return;
    const rows = [[t("known.media"), mediaWords(seen[0], sigmas)],
      ...seen.map(({ z0 }, index) => [t("known.interface", { image: index + 1 }), `${number(z0, 3)} m`])];
    this.known.append(...rows.map(([name, text]) => h("div", {}, h("dt", {}, name), h("dd", {}, text))));
  }

  #controlRow(item) {
    const { name } = item;
    const save = (key) => (value) => this.app.send("control.set", { name, [key]: value });
    const inputs = COORDINATES.map((key) => {
      const input = numberInput({ label: `${key} ${name}`, save: save(key), size: "6" });
      fill(input, item[key]);
      return h("td", {}, input);
    });
    const label = textInput({ label: t("control.name"), size: "5",
      save: (text) => this.app.send("control.rename", { name, new: text }) });
    fill(label, name);
    const seen = [1, 2].map((image) => h("button", { type: "button",
      class: `chip ink-${image}${item.picks[image] ? " on" : ""}`,
      "aria-label": t(item.picks[image] ? "control.again" : "control.pickIn", { name, image }),
      onclick: () => { this.wallCard.dismiss(); this.picker.select(name); this.picker.aim(image); this.#fly(item, image); } },
    item.picks[image] ? `${image} ✓` : `${image}`));
    const worst = Math.max(...[1, 2].map((image) => Math.hypot(...(item.residual?.[image] ?? [NaN]))).filter(Number.isFinite), -1);
    const use = h("input", { type: "checkbox", checked: item.use, "aria-label": t("control.use", { name }),
      title: t("control.use", { name }), onchange: () => this.app.send("control.use", { name, use: use.checked }) });
    const remove = button("×", () => this.app.send("control.delete", { name }),
      { class: "icon", "aria-label": t("list.deleteOf", { name }) });
    const row = h("tr", { "aria-selected": String(name === this.picker.selected),
      onfocusin: () => { if (this.picker.selected !== name) this.picker.select(name); } },
    h("td", {}, label), inputs, h("td", { class: "seen" }, seen),
    h("td", { class: "number" }, worst < 0 ? "–" : number(worst, 2)), h("td", { class: "seen" }, use, remove));
    return row;
  }

  #tapeRow(tape) {
    const { from, to } = tape;
    return h("tr", {}, h("td", {}, from), h("td", {}, to),
      h("td", { class: "number" }, number(tape.length, 3)),
      h("td", { class: "number" }, number(tape.sigma, 3)),
      h("td", {}, button("×", () => this.app.send("tape.delete", { from, to }),
        { class: "icon", "aria-label": t("list.deleteOf", { name: `${from}–${to}` }) })));
  }

  #fly(item, image) {
    const pixel = this.picker.pick(item, image);
    if (pixel) this.panes[image - 1]?.flyTo(pixel);
  }

  flyTo(name) {
    const item = this.app.state.control.find((one) => one.name === name);
    if (!item) return false;
    this.picker.select(name);
    for (const image of [1, 2]) this.#fly(item, image);
    return true;
  }

  get activePane() {
    return this.panes.find(({ element }) => element === document.activeElement) ??
      this.panes[this.picker.target.image - 1];
  }

  refresh() {
    const { target, picking } = this.picker;
    const words = { name: target.name ?? t("control.newName"), image: target.image };
    setText(this.target, this.wallCard.asks || (picking ? t("pick.next", words) : t("pick.off")));
    this.target.classList.toggle("asked", Boolean(this.wallCard.asks));
    for (const row of this.body.children) {
      row.setAttribute("aria-selected", String(row.dataset.key === this.picker.selected));
    }
    for (const pane of this.panes) pane.paint();
    this.#look();
  }

  #look() {
    for (const image of [1, 2]) this.loupe.look(image, this.picker.sight(image) ?? this.panes[image - 1]?.middle(image));
  }

  /** Page coordinates of a photo pixel and back, for those who drive the page from outside. */
  paneOf(image) {
    return this.panes[image - 1];
  }
}
