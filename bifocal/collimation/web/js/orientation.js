/**
 * Stage 2: control points and tape distances beside the two photos, what they say of the pair, and
 * what would help most next.
 */
import { h, html, nothing, number, parseNumber, render, repeat } from "./dom.js";
import * as drawing from "./drawing.js";
import { cross, numberField, textField } from "./fields.js";
import { asTaken } from "./geometry.js";
import { Loupe } from "./loupe.js";
import { mediaWords } from "./media.js";
import { Picker } from "./picker.js";
import { sketch } from "./sketches.js";
import { photoMark } from "./tiles.js";
import { Pane, pixelView, spread, tileLayer } from "./viewer.js";
import { WallCard } from "./wallcard.js";
import { t } from "./words/words.js";

const COORDINATES = ["X", "Y", "r"];
const CONTROL = ["control.name", "control.X", "control.Y", "control.r", "control.seen", "control.residual"];
const TAPE = ["tape.from", "tape.to", "tape.length", "tape.sigma"];
/** Residuals are drawn so many times as long as they are. */
const STRETCHED = 40;

const heads = (keys) => html`<thead><tr>${keys.map((key) => html`<th scope="col">${t(key)}</th>`)}<th><span
  class="unseen">${t("list.delete")}</span></th></tr></thead>`;

const levelled = (kind, lines, levels) => html`<ul class=${kind}>${lines.map((text) => html`<li
  data-level=${levels[text] ?? nothing}>${text}</li>`)}</ul>`;

export class OrientationStage {
  constructor(app) {
    this.app = app;
    this.loupe = new Loupe();
    this.panes = [];
    this.picker = new Picker({ connection: app.connection, kind: "control", partner: false,
      items: () => app.state.control, panes: () => this.panes });
    app.listen(this.picker, () => this.refresh(), () => this.#look());
    this.wallCard = new WallCard(this);
    this.actions = { align: () => app.job("align"), accept: () => this.accept(), control: () => this.#fresh(),
      length: () => this.wallCard.arm("length") };
    this.photos = h("div", { class: "viewer two" });
    this.exchangePlace = h("div", { class: "row" });
    this.side = h("aside", { class: "side" });
    this.element = h("div", { class: "stage work", id: "stage-orientation" }, this.photos, this.side);
  }

  #side(state) {
    const { target, picking } = this.picker;
    const { asks } = this.wallCard;
    // What the program is about asks for no click.
    const busy = Boolean(state.looking) && !state.pair && !state.control.length;
    const words = { name: target.name ?? t("control.newName"), image: target.image };
    return html`<div class="panel"><p class="target ${asks ? "asked" : ""}" role="status" ?hidden=${busy}>${asks || (picking ? t("pick.next", words) : t("pick.off"))}</p>
      ${this.wallCard.element}${this.wallCard.checkCard}${this.loupe.element}
      ${this.#control(state)}${this.#tapes(state)}${this.#known(state)}${this.exchangePlace}</div>${this.#next(state, busy)}`;
  }

  #fresh() {
    this.wallCard.dismiss();
    this.picker.fresh(1);
  }

  #control({ control, pair }) {
    return html`<section class="card" @paste=${(event) => this.#pasted(event)}><h2>${t("control.title")}</h2><div class="buttons">
        <button type="button" class="quiet" data-testid="control-new" @click=${() => this.#fresh()}>${t("control.new")}</button>
        <button type="button" class="quiet" data-testid="control-snap" @click=${() => this.picker.snap()}>${t("pick.snap")}</button>
        <button type="button" class="quiet" data-testid="control-paste" @click=${() => this.#paste()}>${t("control.paste")}</button>
        <button type="button" class="quiet" data-testid="targets" ?disabled=${!pair} @click=${() => this.app.job("targets")}>${t("control.targets")}</button></div>
      ${this.app.jobBox("targets")}<p class="hint">${t("control.hint")}</p>
      <table class="grid" data-testid="control-table" ?hidden=${!control.length}>${heads(CONTROL)}<tbody>${
        repeat(control, ({ name }) => name, (item) => this.#controlRow(item))}</tbody></table></section>`;
  }

  #tapes({ tapes }) {
    return html`<section class="card"><h2>${t("tape.title")}</h2>
      <table class="grid" ?hidden=${!tapes.length}>${heads(TAPE)}<tbody>${repeat(tapes, ({ from, to }) => `${from}\t${to}`, (tape) => this.#tapeRow(tape))}</tbody></table>
      <form class="row add" @submit=${(event) => { event.preventDefault(); this.#addTape(event.target); }}>${TAPE.map((key, index) => html`<input type="text"
        aria-label=${t(key)} placeholder=${t(key).replace(/ ?\[.*/, "")} inputmode=${index > 1 ? "decimal" : "text"} data-testid="tape-${index}">`)}
        <button type="submit" class="quiet" data-testid="tape-add">${t("tape.add")}</button></form></section>`;
  }

  async #addTape(form) {
    const inputs = [...form.querySelectorAll("input")];
    const typed = inputs.map(({ value }) => value);
    const [from, to, ...numbers] = typed.map((value) => value.trim());
    const length = parseNumber(numbers[0]);
    if (!from || !to || !(length > 0)) return this.app.say(t("tape.incomplete"), "warning");
    const accepted = await this.app.send("tape.set", { from, to, length, sigma: numbers[1] || null });
    // A refused tape stays to be mended; so does one typed meanwhile.
    if (!accepted || inputs.some(({ value }, index) => value !== typed[index])) return undefined;
    form.reset();
    return inputs[0].focus();
  }

  /** What is to be done next stays in sight below the panel, however long the table; the rest is folded. */
  #next({ pair, steps, advice, levels, good }, busy) {
    const proposed = pair?.accepted === false;
    const ahead = advice.filter((text, index) => text === steps.orientation.text || (!index && levels[text]));
    const further = advice.filter((text) => !ahead.includes(text));
    return html`<section class="card next"><h2>${t("align.title")}</h2>${levelled("advice", ahead, levels)}
      <p class="good" role="status" data-testid="how-good" ?hidden=${!good}>${good}</p>
      <div class="row"><button type="button" class=${pair?.current ? "" : "primary"} data-testid="align" ?hidden=${busy}
          @click=${this.actions.align}>${t(pair?.report?.free_scale ? "align.refine" : "align.run")}</button>
        <button type="button" class=${proposed && pair.scaled && pair.current ? "primary" : ""} data-testid="align-accept" ?hidden=${!proposed}
          ?disabled=${!pair?.scaled} @click=${this.actions.accept}>${t("align.accept")}</button></div>${this.app.jobBox("align")}
      <details data-testid="further" ?hidden=${!further.length}><summary>${t("advice.further", { count: further.length })}</summary>${
        levelled("advice", further, levels)}</details></section>`;
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
    // What is accepted needs no control points: a click makes one only where it is asked for.
    const done = Boolean(state.pair?.accepted) && !state.control.length;
    if (done && !this.done) this.picker.picking = false;
    this.done = done;
    this.refresh();
  }

  /** Distances, nadirs and media with their sigmas: of the proposal, else of the control points alone. */
  #known({ pair, live, levels }) {
    const remarks = pair?.remarks ?? [];
    const distances = pair?.images.map(({ distance }) => distance) ?? live?.distances ?? [];
    const sigmas = pair?.report?.standard_deviations ?? live?.deviations ?? {};
    const media = pair?.images.map((image) => image.media) ?? [];
    const spread = (sigma) => (Number.isFinite(sigma) ? `± ${number(sigma, 3)}` : "");
    const rows = distances.flatMap((distance, index) => [
      [t("known.distance", { image: index + 1 }), `${number(distance, 3)} ${spread(sigmas[`distance${index + 1}`])} m`],
      [t("known.nadir", { image: index + 1 }), spread(sigmas[`nadir${index + 1}`]) && `${spread(sigmas[`nadir${index + 1}`])} m`, "nadir"]]);
    if (media[0]) {
      rows.push([t("known.media"), mediaWords(media[0], sigmas)],
        ...media.map(({ z0 }, index) => [t("known.interface", { image: index + 1 }), `${number(z0, 3)} m`]));
    }
    return html`<section class="card" ?hidden=${!remarks.length && !rows.length}><h2>${t("known.title")}</h2>
      <dl class="values one" data-testid="orientation-values">${rows.filter(([, text]) => text).map(([name, text, picture]) => html`<div>${
        picture ? html`<dt ${sketch(picture)}>${name}</dt>` : html`<dt>${name}</dt>`}<dd>${text}</dd></div>`)}</dl>
      <details data-testid="align-remarks" ?hidden=${!remarks.length}><summary>${t("known.remarks", { count: remarks.length })}</summary>${
        levelled("remarks", remarks, levels)}</details></section>`;
  }

  #controlRow(item) {
    const { name, picks, residual, use } = item;
    const send = (op, values) => this.app.send(`control.${op}`, { name, ...values });
    const worst = Math.max(...[1, 2].map((image) => Math.hypot(...(residual?.[image] ?? [NaN]))).filter(Number.isFinite), -1);
    const aim = (image) => { this.wallCard.dismiss(); this.picker.select(name); this.picker.aim(image); this.#fly(item, image); };
    return html`<tr data-key=${name} aria-selected=${name === this.picker.selected}
      @focusin=${() => { if (this.picker.selected !== name) this.picker.select(name); }}>
      <td>${textField({ label: t("control.name"), size: 5, value: name, save: (text) => send("rename", { new: text }) })}</td>
      ${COORDINATES.map((key) => html`<td>${numberField({ label: `${key} ${name}`, size: 6, value: item[key], save: (value) => send("set", { [key]: value }) })}</td>`)}
      <td class="seen">${[1, 2].map((image) => html`<button type="button" class="chip ink-${image} ${picks[image] ? "on" : ""}" @click=${() => aim(image)}
        aria-label=${t(picks[image] ? "control.again" : "control.pickIn", { name, image })}>${image}${picks[image] ? " ✓" : ""}</button>`)}</td>
      <td class="number">${worst < 0 ? "–" : number(worst, 2)}</td>
      <td class="seen"><input type="checkbox" .checked=${use} aria-label=${t("control.use", { name })} title=${t("control.use", { name })}
        @change=${({ target }) => send("use", { use: target.checked })}>${cross(name, () => send("delete"))}</td></tr>`;
  }

  #tapeRow({ from, to, length, sigma }) {
    return html`<tr><td>${from}</td><td>${to}</td><td class="number">${number(length, 3)}</td><td class="number">${number(sigma, 3)}</td>
      <td>${cross(`${from}–${to}`, () => this.app.send("tape.delete", { from, to }))}</td></tr>`;
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
    render(this.#side(this.app.state), this.side);
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
