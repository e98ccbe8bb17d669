/** One photo alone: the four corners of a rectangle on a flat wall and its size bring it to scale. */
import { h, html, noChange, nothing, number, parseNumber, render } from "./dom.js";
import * as drawing from "./drawing.js";
import { named, numberField } from "./fields.js";
import { asTaken } from "./geometry.js";
import { photoMark } from "./tiles.js";
import { Pane, pixelView, tileLayer } from "./viewer.js";
import { t } from "./words/words.js";

const CORNERS = 4;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const INK = "#ffe14d";
/** How far off a click may have fallen. [photo pixels] */
const REACH = 12;
/** How long the largest misfit is drawn. [CSS px] */
const LONGEST = 60;

export class Alone {
  constructor(app) {
    Object.assign(this, { app, corners: [], cursor: null, misfits: [] });
    this.viewer = h("div", { class: "viewer alone-viewer" });
    this.element = h("section", { class: "card alone", hidden: true, testid: "alone" });
  }

  #run() {
    const [width, height] = [...this.element.querySelectorAll("input")].map(({ value }) => parseNumber(value));
    if (!(width > 0) || !(height > 0)) return this.app.say(t("alone.size"), "warning");
    this.judged = this.corners;
    return this.app.job("rectify", { corners: this.corners, width, height });
  }

  update(state) {
    this.element.hidden = state.photos.length !== 1;
    if (this.element.hidden) return;
    this.misfits = state.misfits;
    this.worst = Math.max(0, ...state.misfits.map((off) => Math.hypot(...off)));
    this.#tell();
    this.#show(state).catch((error) => this.app.refuse(error));
  }

  #tell() {
    const { jobs, products: { rectified }, revision } = this.app.state;
    const { length } = this.corners;
    const done = jobs.findLast(({ kind, state }) => kind === "rectify" && state === "done");
    const asks = length < CORNERS ? t("alone.asks", { corner: t(`alone.corner.${length}`) }) : t("alone.asksSize");
    const size = (side) => named(t(`alone.${side}`), `alone-${side}`, numberField({ id: `alone-${side}`, testid: `alone-${side}`, value: noChange }), "m");
    render(html`<h2>${t("alone.title")}</h2><p class="hint">${t("alone.hint")}</p><div class="alone-body">${this.viewer}<div class="card-body">
        <p class="target" role="status" data-testid="alone-asks">${asks}</p><div class="fields">${["width", "height"].map(size)}</div>
        <div class="row"><button type="button" class="primary" data-testid="run-rectify" ?disabled=${length < CORNERS} @click=${() => this.#run()}>${t("alone.run")}</button>
          <button type="button" class="quiet" ?disabled=${!length} @click=${() => { this.corners = []; this.#tell(); }}>${t("alone.again")}</button></div>
        ${this.app.jobBox("rectify")}<p data-testid="alone-told">${done ? `${done.message} ${t("alone.misfit", { worst: number(this.worst, 1) })}` : ""}</p>
        <img class="preview large" alt=${t("alone.alt")} ?hidden=${!rectified} src=${rectified ? `preview/rectified?v=${done?.id}-${revision}` : nothing}>
        <div class="row"><a class="button" href="download/all.zip" download data-testid="alone-download" ?hidden=${!rectified}>${t("deliver.download")}</a></div></div></div>`,
    this.element);
    this.pane?.paint();
  }

  async #show(state) {
    const mark = photoMark(state);
    if (this.mark === mark) return;
    Object.assign(this, { mark, corners: [], cursor: null });
    this.pane?.dispose();
    const [{ width, height }] = state.photos;
    const view = pixelView(width, height);
    this.pane = new Pane({ label: t("alone.pane"), view, frame: asTaken, painter: (context) => this.#draw(context) });
    Object.assign(this.pane, { image: 1, images: [1] });
    this.pane.addEventListener("pick", ({ detail }) => this.#click(detail.pixel));
    this.pane.element.addEventListener("keydown", (event) => this.#key(event));
    this.viewer.replaceChildren(this.pane.element);
    this.pane.mounted();
    const info = await this.app.pyramids.info("photo", 1, mark);
    if (this.mark === mark) this.pane.setLayers([tileLayer("layer-1", "tiles/photo/1", info)]);
  }

  /** Arrows move a cross over the photo, Enter sets a corner there. */
  #key(event) {
    const arrow = ARROWS[event.key];
    if (!arrow && event.key !== "Enter") return;
    event.preventDefault();
    const { pane } = this;
    this.cursor ??= [pane.width / 2, pane.height / 2];
    if (!arrow) return this.#click(this.cursor);
    const by = event.altKey ? 1 : event.shiftKey ? 50 : 10;
    this.cursor = this.cursor.map((value, axis) => value + by * arrow[axis]);
    return pane.paint();
  }

  /** A corner, on that of the picture which lies there. */
  async #click(pixel) {
    if (this.corners.length >= CORNERS) return;
    const [column, row] = this.pane.photo(1, pixel);
    const corner = [column, row];
    this.corners = [...this.corners, corner];
    this.#tell();
    const found = await this.app.connection.ask("api/snap", { image: 1, column, row, radius: REACH }).catch(() => null);
    if (found && found.kind !== "none") [corner[0], corner[1]] = [found.column, found.row];
    if (this.corners.length === CORNERS) this.element.querySelector("input").focus();
    this.#tell();
  }

  #draw(context) {
    const places = this.corners.map((corner) => this.pane.screen(1, corner));
    drawing.polyline(context, INK, places, { width: 2, closed: places.length === CORNERS });
    places.forEach((place, index) => {
      drawing.marker(context, 1, place);
      drawing.label(context, number(index + 1, 0), [place[0] + 10, place[1] - 8], INK);
      const off = this.judged === this.corners && this.worst > 0.05 && this.misfits[index];
      if (off) drawing.residual(context, place, off.map((one) => (one * LONGEST) / this.worst), drawing.DOUBT);
    });
    if (this.cursor) drawing.cursor(context, this.pane, this.cursor, 1);
  }
}
