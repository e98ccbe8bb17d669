/** Stage 4: relief and orthophoto run, looked at, delivered. */
import { h, html, noChange, nothing, number, parseNumber, render } from "./dom.js";
import { draggable } from "./dragging.js";
import * as drawing from "./drawing.js";
import { named, numberField, select } from "./fields.js";
import { Wall } from "./geometry.js";
import { Loupe } from "./loupe.js";
import { Profile } from "./profile.js";
import { Range } from "./range.js";
import { Shapes } from "./shapes.js";
import { photoMark, wallMark } from "./tiles.js";
import { Pane, pictureLayer, pixelView, tileLayer } from "./viewer.js";
import { t } from "./words/words.js";

const SCALES = [10, 20, 25, 50, 100, 200, 500];
const SHEETS = ["A4", "A3", "A2", "A1", "A0"];
const GRADES = ["fast", "standard", "best"];
const ASK_MS = 80;

const frameOf = ([left, top, right, bottom]) => [[left, top], [right, bottom]];

/** Bytes of a file, in the unit that leaves digits to read. */
const size = (bytes) => (bytes < 1e5 ? `${number(bytes / 1e3, 1)} kB` : `${number(bytes / 1e6, 1)} MB`);

export class ProductsStage {
  constructor(app) {
    Object.assign(this, { app, swipe: 1, opacity: 1, shown: "photo", made: new Set(), previews: {}, grade: "standard", source: "both", sheet: "auto" });
    this.photos = h("div", { class: "viewer" });
    this.value = h("p", { class: "value", role: "status", testid: "relief-value" });
    this.range = new Range((low, high) => { this.limits = [low, high]; this.#showRelief(); });
    this.shapes = new Shapes(app, this);
    const make = () => this.#deliver();
    this.actions = { make, again: make, download: () => this.#at("[data-testid=download]").click() };
    this.loupe = new Loupe();
    this.profile = new Profile(app, () => this.pane?.paint(), () => {
      this.pane?.mounted();
      this.pane?.fit();
    });
    this.bar = h("div", { class: "layer-bar", role: "toolbar", "aria-label": t("layer.bar") });
    this.panel = h("aside", { class: "panel" });
    this.element = h("div", { class: "stage work", id: "stage-products" },
      h("div", { class: "table-top" }, this.bar, this.photos, this.range.element, this.profile.element), this.panel);
  }

  #at(selector) {
    return this.panel.querySelector(selector);
  }

  /** What may be looked at: its layer, or nothing. */
  get #layers() {
    return { ortho: this.ortho, relief: this.relief, photo: this.wallLayer };
  }

  #paintBar() {
    const { shown } = this;
    const slider = (id, hidden, changed) => html`<span class="slider" ?hidden=${hidden}><label for=${id}>${t(`products.${id}`)}</label>
      <input type="range" min="0" max="100" value="100" id=${id} data-testid=${id} @input=${({ target }) => { changed(target.value / 100); this.#apply(); }}></span>`;
    render(html`<div class="segments" role="group" aria-label=${t("products.view")}>${Object.entries(this.#layers).map(([view, layer]) => html`<button
        type="button" data-testid="view-${view}" aria-pressed=${view === shown} ?disabled=${!layer} @click=${() => this.look(view)}>${t(`products.${view}`)}</button>`)}</div>
      ${slider("relief-opacity", shown !== "relief", (value) => { this.opacity = value; })}
      ${slider("ortho-swipe", shown === "photo", (value) => { this.swipe = value; })}
      <button type="button" class="quiet" data-testid="relief-hatch" ?hidden=${shown !== "relief"} aria-pressed=${Boolean(this.hatched)}
        @click=${() => { this.hatched = !this.hatched; this.#showRelief(); }}>${t("relief.hatch")}</button>
      <button type="button" class="quiet" data-testid="relief-points" aria-pressed=${Boolean(this.picks)}
        @click=${() => { this.picks = !this.picks; this.#paintBar(); }}>${t("relief.points")}</button>
      <button type="button" class="quiet" data-testid="profile" @click=${() => this.profile.begin()}>${t("profile.draw")}</button>${this.value}`, this.bar);
  }

  /** Show one product, or the far photo on the wall; the others only as far as it is drawn aside. */
  look(view) {
    this.shown = view;
    this.#apply();
  }

  /** A product: its picture, what it is good for, its size, what makes it. */
  #product(kind, controls) {
    const { products, jobs, revision, pair } = this.app.state;
    const product = products[kind];
    const mark = JSON.stringify([product, jobs.filter((job) => job.state === "done").length]);
    if (this.previews[kind]?.mark !== mark) this.previews[kind] = { mark, src: product ? `preview/${kind}?v=${jobs.length}-${revision}` : nothing };
    const pixels = product?.cols ? `${product.cols} × ${product.rows} px` : "";
    const ready = product && t(`${kind}.ready`, { size: `${pixels}, ${number(1000 * product.gsd, 1)} mm` });
    return html`<section class="card product"><h2>${t(`${kind}.title`)}</h2>
      <div class="product-body"><img class="preview" alt="" ?hidden=${!product} src=${this.previews[kind].src}><div><p class="hint">${t(`${kind}.hint`)}</p>
        <p class="hint">${products.stale[kind] ?? [ready, products.made_from[kind]].filter(Boolean).join(" · ")}</p></div></div>
      ${controls(!pair || this.app.running(kind))}${this.app.jobBox(kind)}</section>`;
  }

  #runOrtho() {
    const input = this.#at("#ortho-gsd");
    const gsd = parseNumber(input.value);
    // What is no number is told at the field, and is not the same as an empty one.
    if (Number.isNaN(gsd)) return input.reportValidity();
    return this.app.job("ortho", { gsd: gsd === null ? null : gsd / 1000, image: this.source });
  }

  /** The finest scale that holds, unless another was chosen. */
  get scale() {
    return this.chosen ?? `1:${this.finest ?? 50}`;
  }

  #deliver() {
    return this.app.job("deliver", { scale: this.scale, quality: this.grade, image: this.source, title: this.#at("#deliver-title").value.trim(),
      sheet: this.sheet === "auto" ? null : this.sheet, sections: this.profile.kept });
  }

  #package({ pair, products: { files, stale, made_from: causes } }) {
    const scales = Object.fromEntries(SCALES.map((scale) => [`1:${scale}`, scale < this.finest ? t("deliver.fine", { scale }) : `1:${scale}`]));
    const sheets = { auto: t("deliver.auto"), ...Object.fromEntries(SHEETS.map((name) => [name, name])) };
    const choose = (key, options, save) => named(t(`deliver.${key}`), `deliver-${key}`,
      select({ id: `deliver-${key}`, testid: `deliver-${key}`, options, value: this[key], save }));
    return html`<section class="card"><h2>${t("deliver.title")}</h2><p class="hint">${t("deliver.hint")}</p>
      <div class="fields">${choose("scale", scales, (scale) => { this.chosen = scale; })}${choose("sheet", sheets, (sheet) => { this.sheet = sheet; })}</div>
      ${named(t("deliver.heading"), "deliver-title", html`<input type="text" maxlength="120" autocomplete="off" id="deliver-title"
        placeholder=${t("deliver.titleHint")} data-testid="deliver-title">`)}
      <div class="row"><button type="button" data-testid="deliver" ?disabled=${!pair || this.app.running("deliver")} @click=${() => this.#deliver()}>${t("deliver.run")}</button>
        <a class="button" href="download/all.zip" download data-testid="download" ?hidden=${!files.length}>${t("deliver.download")}</a></div>
      <p class="hint" data-testid="deliver-state">${stale.deliver ?? causes.deliver}</p>${this.app.jobBox("deliver")}
      <details data-testid="files"><summary>${t("deliver.files", { count: files.length, size: size(files.reduce((sum, { bytes }) => sum + bytes, 0)) })}</summary>
        <ul class="files">${files.map(({ name, bytes }) => html`<li><a href="download/${encodeURIComponent(name)}" download>${name}</a>
          <span class="hint">${size(bytes)}</span></li>`)}</ul></details></section>`;
  }

  async prepare(state) {
    if (!state.pair) return;
    const { relief, ortho } = state.products;
    const done = state.jobs.filter((job) => job.state === "done").map(({ id }) => id);
    const mark = JSON.stringify([wallMark(state), relief, ortho, done]);
    if (this.mark === mark) return;
    this.mark = mark;
    if (this.wallMark !== wallMark(state)) this.#makePane(state);
    this.wallMark = wallMark(state);
    const runs = state.jobs.filter((job) => job.kind === "relief" && done.includes(job.id));
    const surface = JSON.stringify([this.wallMark, relief, runs.map(({ id }) => id)]);
    if (this.surface !== surface) this.profile.forget();
    this.surface = surface;
    const [walls, photos, image] = await Promise.all([
      this.app.pyramids.info("wall", 1, this.wallMark), this.app.pyramids.both("photo", photoMark(state)),
      ortho ? this.app.pyramids.info("ortho", 0, mark).catch(() => null) : null]);
    if (this.mark !== mark) return;
    photos.forEach((info, index) => {
      this.loupe.source(index + 1, info);
      if (!this.loupe.places[index + 1]) this.loupe.look(index + 1, this.pane.middle(index + 1));
    });
    this.wallLayer = tileLayer("layer-1", "tiles/wall/1", walls, null, this.wall.frameOf(1, state.photos[0]));
    this.ortho = image && this.#orthoLayer(ortho, image, state.photos);
    this.reliefMark = `${done.length}-${state.revision}`;
    this.#showRelief();
    // What was made last is looked at first.
    const newest = ["ortho", "relief"].find((kind) => state.products[kind] && !this.made.has(kind));
    this.made = new Set(["ortho", "relief"].filter((kind) => state.products[kind]));
    if (newest) {
      this.look(newest);
      this.pane.frameTo(frameOf(this.#edges(state.products[newest].bounds)));
      this.pane.fit();
    }
  }

  /** The relief in the colours that were chosen, above photo and orthophoto. */
  #showRelief() {
    const { relief } = this.app.state.products;
    if (!this.wallLayer) return;
    const wanted = [`v=${this.reliefMark}`, ...(this.limits ? [`low=${this.limits[0]}`, `high=${this.limits[1]}`] : []),
      ...(this.hatched ? ["hatched"] : [])].join("&");
    this.relief = relief && pictureLayer("layer-relief", `relief/overlay.png?${wanted}`, this.#edges(relief.bounds));
    this.pane.setLayers([this.wallLayer, this.ortho, this.relief].filter(Boolean));
    this.#apply();
  }

  /** Whether what lies under the pointer is the orthophoto, where X and Y are true. */
  get onOrtho() {
    return this.shown === "ortho" && Boolean(this.ortho) && this.swipe > 0.5;
  }

  #makePane(state) {
    this.pane?.dispose();
    this.wall = new Wall(state.pair);
    this.view = pixelView(this.wall.width, this.wall.height);
    this.pane = new Pane({ label: t("pane.products"), view: this.view, frame: this.wall,
      painter: (context, pane) => this.#draw(context, pane) });
    this.pane.frameTo(this.wall.frameOf(1, state.photos[0]));
    this.pane.addEventListener("hover", ({ detail }) => this.#ask(detail.pixel));
    draggable(this.pane, { find: (place) => this.shapes.cornerAt(place),
      move: (mark, place) => this.shapes.drag(mark, place), drop: (mark, place) => this.shapes.drop(mark, place) });
    this.pane.addEventListener("pick", ({ detail }) => this.#click(this.pane.unplace(detail.pixel)));
    this.photos.replaceChildren(this.pane.element);
    this.pane.mounted();
  }

  /** A click: a corner, an end of the profile, or a point where relief is known. */
  #click(spot) {
    if (this.shapes.corners) return this.shapes.click(spot);
    const [X, Y] = this.wall.toPlane(spot);
    if (this.profile.drawing) return this.profile.click([X, Y]);
    return this.picks ? this.#point(X, Y) : undefined;
  }

  /** The relief under the pointer becomes a point, picked in both photos. */
  async #point(X, Y) {
    const { connection } = this.app;
    try {
      const { picks, r } = await connection.get(`relief/value?X=${X}&Y=${Y}`);
      if (!picks) return this.app.say(t("relief.unknown"), "warning");
      const pick = (image, name) => connection.send("point.pick", { name, image, column: picks[image - 1][0], row: picks[image - 1][1] });
      const { name } = await pick(1, null);
      await pick(2, name);
      return this.app.say(t("relief.point", { name, r: number(r, 3) }));
    } catch (error) {
      return this.app.refuse(error);
    }
  }

  /** Take back the last corner; null where none is in hand. */
  get remove() {
    return this.shapes.corners?.length ? () => this.shapes.back() : null;
  }

  /** Leave what is half done. */
  leave() {
    return this.shapes.leave();
  }

  /** Outer edges on the plane [m] -> outer edges on the wall's grid, in columns and rows. */
  #edges([xmin, ymin, xmax, ymax]) {
    return [...this.wall.fromPlane([xmin, ymax]), ...this.wall.fromPlane([xmax, ymin])];
  }

  /** Within both photos alone: what neither of them shows is no grey board. */
  #orthoLayer(ortho, info, photos) {
    const [left, top, right] = this.#edges(ortho.bounds);
    const scale = (right - left) / info.width;
    return tileLayer("layer-ortho", "tiles/ortho/0", info, [left, top, scale],
      ...[1, 2].map((one) => this.wall.frameOf(one, photos[one - 1])));
  }

  #apply() {
    const layers = this.#layers;
    // What is no longer there gives way to what is.
    if (!layers[this.shown]) this.shown = "photo";
    const whole = this.swipe === 1 && (this.shown !== "relief" || this.opacity === 1);
    for (const [view, layer] of Object.entries(layers)) layer?.setVisible(view === this.shown || (view === "photo" && !whole));
    this.range.element.hidden = this.shown !== "relief";
    this.#paintBar();
    this.relief?.setOpacity(this.opacity);
    this.photos.style.setProperty("--ortho-cut", `${100 * (1 - this.swipe)}%`);
    this.pane?.mounted();
  }

  #draw(context, pane) {
    this.shapes.draw(context, pane);
    const places = this.profile.ends.map((end) => pane.place(this.wall.fromPlane(end)));
    drawing.polyline(context, "#ffffff", places, { width: 2 });
    for (const place of places) drawing.marker(context, 2, place);
    const here = this.profile.here();
    if (here) drawing.marker(context, 1, pane.place(this.wall.fromPlane(here)));
  }

  /** Say what the relief is under a CSS pixel of the pane, and show that spot of both photos. */
  async #tell(wanted) {
    const spot = this.pane.unplace(wanted);
    const [X, Y] = this.wall.toPlane(spot);
    const { r, sigma, picks } = await this.app.connection.get(`relief/value?X=${X}&Y=${Y}`).catch(() => ({}));
    const relief = Number.isFinite(r) ? `r ${number(r, 3)} ± ${number(sigma, 3)} m` : t("relief.unknown");
    for (const image of [1, 2]) this.loupe.look(image, picks?.[image - 1] ?? (image === 1 ? this.wall.toPhoto(1, spot) : null));
    this.value.textContent = `X ${number(X, 3)} · Y ${number(Y, 3)} · ${relief}`;
  }

  /** The relief under the pointer, asked at most a dozen times a second. */
  #ask(pixel) {
    this.wanted = pixel && this.app.state.products.relief ? pixel : null;
    if (this.asking || !this.wanted) return;
    this.asking = setTimeout(async () => {
      const { wanted } = this;
      if (wanted) await this.#tell(wanted).catch((error) => this.app.refuse(error));
      this.asking = null;
      if (this.wanted && this.wanted !== wanted) this.#ask(this.wanted);
    }, ASK_MS);
  }

  update(state) {
    this.prepare(state).catch((error) => this.app.refuse(error));
    const { relief } = state.products;
    this.finest = state.drawing_scale ?? this.finest;
    this.picks &&= Boolean(relief);
    this.range.show(relief);
    this.loupe.element.hidden = !relief;
    this.shapes.update(state);
    this.#paintBar();
    const grades = Object.fromEntries(GRADES.map((grade) => [grade, t(`relief.${grade}`)]));
    const sources = { both: t("ortho.both"), 1: t("photo.far"), 2: t("photo.near") };
    render(html`${this.#package(state)}
      ${this.#product("relief", (off) => html`<div class="row">${select({ label: t("relief.quality"), value: this.grade, testid: "relief-quality",
        options: grades, save: (grade) => { this.grade = grade; } })}<button type="button" data-testid="run-relief" ?disabled=${off}
        @click=${() => this.app.job("relief", { quality: this.grade })}>${t("relief.run")}</button></div>`)}
      ${this.#product("ortho", (off) => html`<div class="fields">${named(t("ortho.gsd"), "ortho-gsd",
        numberField({ id: "ortho-gsd", value: noChange, placeholder: t("ortho.auto") }), "mm")}${named(t("ortho.source"), "ortho-source",
        select({ id: "ortho-source", value: this.source, options: sources, save: (source) => { this.source = source; } }))}</div>
        <div class="row"><button type="button" data-testid="run-ortho" ?disabled=${off} @click=${() => this.#runOrtho()}>${t("ortho.run")}</button></div>`)}
      ${this.shapes.element}${this.loupe.element}`, this.panel);
  }

  get activePane() {
    return this.pane;
  }

  paneOf() {
    return this.pane;
  }

  flyTo(name) {
    const item = this.app.points().find((one) => one.name === name);
    const image = item && [1, 2].find((one) => item.picks[one]);
    if (!image || !this.pane) return false;
    this.pane.flyTo(this.wall.fromPhoto(image, item.picks[image]));
    return true;
  }
}
