/**
 * What is drawn on the wall in the last stage: faces, break lines and occluders that relief and
 * orthophoto obey, outlines that are measured. Corners snap, and are kept as pixels of photo 1.
 */
import { h, html, number, parseNumber, render, repeat } from "./dom.js";
import * as drawing from "./drawing.js";
import { nearest } from "./dragging.js";
import { cross, numberField, select, textField } from "./fields.js";
import { t } from "./words/words.js";

const KINDS = ["face", "break", "occluder", "outline"];
const INK = { face: "#ffd84d", break: "#ff8f5e", occluder: "#d69bff", outline: "#b9f27c" };
const CLOSE = 10;
/** So near its middle a corner is taken hold of. [CSS px] */
const GRIP = 8;

export class Shapes {
  /** `stage`: the products, whose pane and wall it draws on. */
  constructor(app, stage) {
    Object.assign(this, { app, stage, kind: "face", corners: null, hot: null, snapping: true, dragged: null, latest: Promise.resolve() });
    this.element = h("section", { class: "card" });
  }

  #again() {
    this.update(this.app.state);
    this.stage.pane?.paint();
  }

  /** The next clicks are corners. */
  arm() {
    this.corners = this.corners ? null : [];
    this.#again();
  }

  /** Whether corners go to the corner of the photo that lies there. */
  toggleSnap() {
    this.snapping = !this.snapping;
    this.update(this.app.state);
    this.app.say(t(this.snapping ? "shape.snaps" : "shape.snapsNot"));
  }

  /** Take back the last corner of the shape in hand. */
  back() {
    this.corners?.pop();
    this.#again();
  }

  /** The corner that is drawn at a CSS pixel of the pane, or null: of the shape in hand, or of a kept one. */
  cornerAt(place) {
    const { pane } = this.stage;
    const of = (shape, corners, places) => corners.map((corner, index) => ({ shape, index, corner,
      place: pane.place(this.#shown(corner, places?.[index])) }));
    const marks = this.corners ? of(null, this.corners)
      : this.app.state.shapes.flatMap((shape) => of(shape, shape.corners, shape.places));
    return nearest(marks, place, GRIP);
  }

  /** Draw a corner where it is dragged to. */
  drag(mark, place) {
    this.dragged = { ...mark, spot: this.stage.pane.unplace(place) };
    this.stage.pane.paint();
  }

  /** Leave a corner where it was dragged to: its shape follows. */
  async drop({ shape, index }, place) {
    const spot = this.stage.pane.unplace(place);
    const corner = await this.#corner(spot).catch((error) => this.app.refuse(error));
    this.dragged = null;
    this.stage.pane.paint();
    if (!corner) return;
    if (!shape) this.corners?.splice(index, 1, corner);
    else {
      const { name, kind } = shape;
      // A face is one plane: its corner keeps the relief of the others.
      if (kind !== "outline" && kind !== "break") corner[2] = shape.corners[index][2];
      await this.app.send("shape.set", { name, kind, corners: shape.corners.with(index, corner) });
    }
    this.#again();
  }

  leave() {
    if (!this.corners) return false;
    this.arm();
    return true;
  }

  /** A click at a pixel of the wall's grid, while a shape is in hand; one after the other. */
  click(spot) {
    return this.#next(() => this.#take(spot));
  }

  /** Close the shape in hand, once all its corners are there. */
  finish() {
    return this.#next(() => this.#keep());
  }

  #next(action) {
    this.latest = this.latest.then(action).catch((error) => this.app.refuse(error));
    return this.latest;
  }

  /** A corner by its coordinates on the wall: "4.20; 1.35". */
  async #type(text, input) {
    const place = text.split(/[;\s]+/).map(parseNumber);
    if (place.length !== 2 || !place.every(Number.isFinite)) return this.app.say(t("shape.typedHow"), "warning");
    input.value = input.dataset.known = "";
    return this.#next(() => this.#add(this.stage.wall.fromPlane(place), { typed: true }));
  }

  async #take(spot) {
    const { corners } = this;
    if (!corners) return undefined;
    const place = this.stage.pane.place(spot);
    const first = corners[0] && this.stage.pane.place(this.#shown(corners[0]));
    if (corners.length > 2 && Math.hypot(first[0] - place[0], first[1] - place[1]) < CLOSE) return this.#keep();
    return this.#add(spot);
  }

  async #add(spot, how) {
    const { corners } = this;
    const corner = await this.#corner(spot, how).catch((error) => this.app.refuse(error));
    if (!corner || !corners || this.corners !== corners) return undefined;
    corners.push(corner);
    return this.#again();
  }

  /** The photo's pixel under a place, on the corner there unless it was typed, with its relief. */
  async #corner(spot, { typed = false } = {}) {
    const { connection } = this.app;
    let pixel = this.stage.wall.toPhoto(1, spot);
    if (this.stage.onOrtho || typed) {
      const [X, Y] = this.stage.wall.toPlane(spot);
      const { picks } = await connection.get(`relief/value?X=${X}&Y=${Y}`).catch(() => ({}));
      if (picks) [pixel] = picks;
    }
    const [column, row] = pixel;
    const radius = Math.min(Math.max(4 / this.stage.pane.zoom, 4), 14);
    const found = typed || !this.snapping ? null : await connection.ask("api/snap", { image: 1, column, row, radius }).catch(() => null);
    if (found && found.kind !== "none") pixel = [found.column, found.row];
    const { places } = await connection.ask("relief/met", { pixels: [pixel] });
    return [...pixel, places[0][2] ?? 0];
  }

  /** Corners -> a shape of the survey: a face has one relief, that which lies most within. */
  async #keep() {
    const { corners, kind } = this;
    if (!corners || corners.length < (kind === "break" ? 2 : 3)) return this.app.say(t("shape.few"), "warning");
    this.corners = null;
    let shape = corners;
    if (kind === "face" || kind === "occluder") {
      const { within } = await this.app.connection.ask("relief/met", { pixels: corners.map(([c, r]) => [c, r]) }).catch(() => ({}));
      shape = corners.map(([column, row]) => [column, row, kind === "face" ? within ?? 0 : 0]);
    }
    if (await this.app.send("shape.set", { kind, corners: shape })) this.app.say(t(`shape.made.${kind}`));
    return undefined;
  }

  /** Where on the wall's grid a corner is shown: in the photo, or in its true place. */
  #shown([column, row, relief], place = null) {
    const { wall, onOrtho } = this.stage;
    return onOrtho && place ? wall.fromPlane(place) : wall.fromPhoto(1, [column, row, relief]);
  }

  draw(context, pane) {
    const { shapes, suggested } = this.app.state;
    const { dragged } = this;
    const line = (corners, places, ink, more, name = null) => drawing.polyline(context, ink,
      corners.map((corner, index) => pane.place(dragged && dragged.index === index && (dragged.shape?.name ?? null) === name
        ? dragged.spot : this.#shown(corner, places?.[index]))), more);
    for (const { name, kind, corners, places } of shapes) {
      line(corners, places, INK[kind], { closed: kind !== "break", width: name === this.hot ? 3.5 : 2, dash: kind === "occluder" ? [6, 4] : [] }, name);
    }
    for (const { corners } of suggested) line(corners, null, "#ffffff", { closed: true, width: 1.5, dash: [5, 5] }, "suggested");
    if (!this.corners?.length) return;
    line(this.corners, null, INK[this.kind], { width: 2.5 });
    this.corners.forEach((corner, index) => drawing.marker(context, 1,
      pane.place(dragged && !dragged.shape && dragged.index === index ? dragged.spot : this.#shown(corner))));
  }

  update({ pair, products, shapes, suggested }) {
    const { corners, kind } = this;
    const offers = suggested.filter((offer) => !shapes.some((one) => String(one.corners) === String(offer.corners)));
    render(html`<h2>${t("shape.title")}</h2><div class="row">
        ${select({ label: t("shape.kind"), testid: "face-kind", value: kind, save: (key) => { this.kind = key; },
          options: Object.fromEntries(KINDS.map((key) => [key, t(`shape.${key}`)])) })}
        <button type="button" class="quiet" data-testid="face" aria-pressed=${Boolean(corners)} ?disabled=${!pair} @click=${() => this.arm()}>${t("shape.draw")}</button>
        <button type="button" class="quiet" data-testid="face-close" ?hidden=${!corners?.length} @click=${() => this.finish()}>${t("shape.close")}</button>
        ${textField({ label: t("shape.typed"), placeholder: "X; Y [m]", size: 12, testid: "face-typed", hidden: !corners, save: (...typed) => this.#type(...typed) })}
        <button type="button" class="quiet" data-testid="face-snap" aria-pressed=${this.snapping} @click=${() => this.toggleSnap()}>${t("shape.snap")}</button>
        <button type="button" class="quiet" data-testid="face-suggest" ?disabled=${!products.relief} @click=${() => this.app.job("suggest")}>${t("shape.suggest")}</button></div>
      ${this.app.jobBox("suggest")}
      <p class="hint" role="status">${corners ? t("shape.corners", { count: corners.length }) : t(shapes.length ? "shape.again" : "shape.hint")}</p>
      <ul class="offers">${repeat(offers, ({ name }) => name, (offer) => this.#offer(offer))}</ul>
      <table class="grid" data-testid="shape-table"><tbody>${repeat(shapes, ({ name }) => name, (shape) => this.#row(shape))}</tbody></table>`, this.element);
  }

  #offer({ name, kind, corners, mends }) {
    return html`<li class="row between">${t("shape.offer", { name, relief: number(corners[0][2], 2), share: number(100 * (mends ?? 0), 1) })}
      <button type="button" data-testid="face-accept" @click=${() => this.app.send("shape.set", { kind, corners })}>${t("shape.accept")}</button></li>`;
  }

  #row({ name, kind, corners, relief, width, height, area, length }) {
    const save = (r) => this.app.send("shape.set", { name, kind, corners: corners.map(([c, row]) => [c, row, r ?? 0]) });
    const size = [width && `${number(width, 3)} × ${number(height, 3)} m`, area && `${number(area, 3)} m²`,
      kind === "break" && length && `${number(length, 3)} m`].filter(Boolean).join(" · ");
    const heat = (hot) => { this.hot = hot; this.stage.pane?.paint(); };
    return html`<tr data-key=${name} @pointerenter=${() => heat(name)} @pointerleave=${() => heat(null)}>
      <th scope="row"><span class="swatch ${kind}"></span>${name}</th><td>${t(`shape.${kind}`)}</td>
      <td><span class="with-unit">${numberField({ label: t("shape.relief", { name }), size: 6, save,
        value: relief === undefined ? null : Math.round(1000 * relief) / 1000 })}<span class="unit">m</span></span></td>
      <td class="number">${size}</td><td>${cross(name, () => this.app.send("shape.delete", { name }))}</td></tr>`;
  }
}
