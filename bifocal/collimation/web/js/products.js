/** Stage 4: relief and orthophoto run, looked at, delivered. */
import { h, keyedRows, number, parseNumber, setText } from "./dom.js";
import { draggable } from "./dragging.js";
import * as drawing from "./drawing.js";
import { button, choice, labelled, numberInput } from "./fields.js";
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

/** What is looked at, one at a time. */
const VIEWS = ["ortho", "relief", "photo"];
const frameOf = ([left, top, right, bottom]) => [[left, top], [right, bottom]];

/** Bytes of a file, in the unit that leaves digits to read. */
const size = (bytes) => (bytes < 1e5 ? `${number(bytes / 1e3, 1)} kB` : `${number(bytes / 1e6, 1)} MB`);

export class ProductsStage {
  constructor(app) {
    this.app = app;
    this.swipe = 1;
    this.shown = "photo";
    this.made = new Set();
    this.photos = h("div", { class: "viewer" });
    this.value = h("p", { class: "value", role: "status", testid: "relief-value" });
    this.range = new Range((low, high) => { this.limits = [low, high]; this.#showRelief(); });
    this.shapes = new Shapes(app, this);
    const make = () => this.deliver.click();
    this.actions = { make, again: make, download: () => this.download.click() };
    this.loupe = new Loupe();
    this.profile = new Profile(app, () => this.pane?.paint(), () => {
      this.pane?.mounted();
      this.pane?.fit();
    });
    this.element = h("div", { class: "stage work", id: "stage-products" },
      h("div", { class: "table-top" }, this.#bar(), this.photos, this.range.element, this.profile.element),
      h("aside", { class: "panel" }, this.#deliverBox(), this.#reliefBox(), this.#orthoBox(),
        this.shapes.element, this.loupe.element));
  }

  #bar() {
    const range = (id, value, changed) => {
      const input = h("input", { type: "range", min: "0", max: "100", value, id, testid: id,
        oninput: () => changed(input.value / 100) });
      return h("span", { class: "slider" }, h("label", { for: id }, t(`products.${id}`)), input);
    };
    this.opacity = 1;
    this.views = Object.fromEntries(VIEWS.map((view) => [view, button(t(`products.${view}`), () => this.look(view),
      { testid: `view-${view}` })]));
    const toggle = (key, testid, changed) => {
      const made = button(t(key), () => {
        const on = made.getAttribute("aria-pressed") !== "true";
        made.setAttribute("aria-pressed", String(on));
        changed(on);
      }, { class: "quiet", testid, "aria-pressed": "false" });
      return made;
    };
    return h("div", { class: "layer-bar", role: "toolbar", "aria-label": t("layer.bar") },
      h("div", { class: "segments", role: "group", "aria-label": t("products.view") }, Object.values(this.views)),
      this.veil = range("relief-opacity", "100", (value) => { this.opacity = value; this.#apply(); }),
      this.curtain = range("ortho-swipe", "100", (value) => { this.swipe = value; this.#apply(); }),
      this.hatch = toggle("relief.hatch", "relief-hatch", (on) => { this.hatched = on; this.#showRelief(); }),
      toggle("relief.points", "relief-points", (on) => { this.picks = on; }),
      button(t("profile.draw"), () => this.profile.begin(), { class: "quiet", testid: "profile" }),
      this.value);
  }

  /** Show one product, or the far photo on the wall; the others only as far as it is drawn aside. */
  look(view) {
    this.shown = view;
    this.#apply();
  }

  /** A product: its picture, what it is good for, its size, what makes it. */
  #product(kind, ...rest) {
    const picture = h("img", { class: "preview", alt: "", hidden: true });
    const state = h("p", { class: "hint" });
    this[`${kind}Picture`] = picture;
    this[`${kind}State`] = state;
    return h("section", { class: "card product" }, h("h2", {}, t(`${kind}.title`)),
      h("div", { class: "product-body" }, picture, h("div", {}, h("p", { class: "hint" }, t(`${kind}.hint`)), state)),
      ...rest, this.app.jobBox(kind));
  }

  #reliefBox() {
    this.grade = choice({ label: t("relief.quality"), value: "standard", testid: "relief-quality",
      options: Object.fromEntries(GRADES.map((grade) => [grade, t(`relief.${grade}`)])), save: () => {} });
    this.runRelief = button(t("relief.run"), () => this.app.job("relief", { quality: this.grade.value }),
      { testid: "run-relief" });
    return this.#product("relief", h("div", { class: "row" }, this.grade, this.runRelief));
  }

  #orthoBox() {
    this.gsd = numberInput({ label: t("ortho.gsd"), save: () => {}, placeholder: t("ortho.auto") });
    this.source = choice({ label: t("ortho.source"), value: "both",
      options: { both: t("ortho.both"), 1: t("photo.far"), 2: t("photo.near") }, save: () => {} });
    const run = () => {
      const gsd = parseNumber(this.gsd.value);
      // What is no number is told at the field, and is not the same as an empty one.
      if (Number.isNaN(gsd)) return this.gsd.reportValidity();
      return this.app.job("ortho", { gsd: gsd === null ? null : gsd / 1000, image: this.source.value });
    };
    this.runOrtho = button(t("ortho.run"), run, { testid: "run-ortho" });
    return this.#product("ortho", h("div", { class: "fields" }, labelled(t("ortho.gsd"), this.gsd, "mm"),
      labelled(t("ortho.source"), this.source)), h("div", { class: "row" }, this.runOrtho));
  }

  #deliverBox() {
    const same = (names) => Object.fromEntries(names.map((name) => [name, name]));
    this.scale = choice({ label: t("deliver.scale"), options: same(SCALES.map((scale) => `1:${scale}`)), value: "1:50",
      save: () => { this.chosen = true; }, testid: "deliver-scale" });
    this.sheet = choice({ label: t("deliver.sheet"), options: { auto: t("deliver.auto"), ...same(SHEETS) },
      save: () => {}, testid: "deliver-sheet" });
    this.title = h("input", { type: "text", maxlength: "120", autocomplete: "off", placeholder: t("deliver.titleHint"), testid: "deliver-title" });
    this.deliver = button(t("deliver.run"), () => this.app.job("deliver", { scale: this.scale.value, quality: this.grade.value,
      image: this.source.value, sheet: this.sheet.value === "auto" ? null : this.sheet.value, title: this.title.value.trim(),
      sections: this.profile.kept }), { testid: "deliver" });
    this.deliverState = h("p", { class: "hint", testid: "deliver-state" });
    this.files = h("ul", { class: "files" });
    this.count = h("summary", {});
    this.download = h("a", { class: "button", href: "download/all.zip", download: "", testid: "download" },
      t("deliver.download"));
    return h("section", { class: "card" }, h("h2", {}, t("deliver.title")),
      h("p", { class: "hint" }, t("deliver.hint")), h("div", { class: "fields" },
        labelled(t("deliver.scale"), this.scale), labelled(t("deliver.sheet"), this.sheet)),
      labelled(t("deliver.heading"), this.title),
      h("div", { class: "row" }, this.deliver, this.download), this.deliverState, this.app.jobBox("deliver"),
      h("details", { testid: "files" }, this.count, this.files));
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
    const there = { photo: this.wallLayer, ortho: this.ortho, relief: this.relief };
    // What is no longer there gives way to what is.
    if (!there[this.shown]) this.shown = "photo";
    const whole = this.swipe === 1 && (this.shown !== "relief" || this.opacity === 1);
    for (const [view, layer] of Object.entries(there)) {
      this.views[view].setAttribute("aria-pressed", String(view === this.shown));
      this.views[view].disabled = !layer;
      layer?.setVisible(view === this.shown || (view === "photo" && !whole));
    }
    this.curtain.hidden = this.shown === "photo";
    this.veil.hidden = this.hatch.hidden = this.range.element.hidden = this.shown !== "relief";
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
    setText(this.value, `X ${number(X, 3)} · Y ${number(Y, 3)} · ${relief}`);
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
    const { relief, ortho, files, stale, made_from: causes } = state.products;
    setText(this.deliverState, stale.deliver ?? causes.deliver ?? "");
    this.#tellScale(state.drawing_scale);
    this.picks &&= Boolean(relief);
    const pixels = (product) => (product.cols ? `${product.cols} × ${product.rows} px` : "");
    this.range.show(relief);
    this.loupe.element.hidden = !relief;
    for (const [kind, product] of [["relief", relief], ["ortho", ortho]]) {
      const size = product && t(`${kind}.ready`, { size: `${pixels(product)}, ${number(1000 * product.gsd, 1)} mm` });
      setText(this[`${kind}State`], stale[kind] ?? [size, causes[kind]].filter(Boolean).join(" · "));
      const picture = this[`${kind}Picture`];
      const mark = product && JSON.stringify(product).length + state.jobs.filter((job) => job.state === "done").length;
      picture.hidden = !product;
      if (product && picture.dataset.mark !== String(mark)) {
        picture.dataset.mark = String(mark);
        picture.src = `preview/${kind}?v=${mark}-${state.revision}`;
      }
    }
    this.shapes.update(state);
    for (const [kind, one] of [["relief", this.runRelief], ["ortho", this.runOrtho], ["deliver", this.deliver]]) {
      one.disabled = !state.pair || this.app.running(kind);
    }
    this.download.hidden = !files.length;
    const bytes = files.reduce((sum, file) => sum + file.bytes, 0);
    setText(this.count, t("deliver.files", { count: files.length, size: size(bytes) }));
    keyedRows(this.files, files, { key: ({ name }) => name, signature: JSON.stringify,
      build: ({ name, bytes: own }) => h("li", {}, h("a", { href: `download/${encodeURIComponent(name)}`, download: "" }, name),
        h("span", { class: "hint" }, ` ${size(own)}`)) });
  }

  /** The finest scale that holds is chosen; finer ones say that they are too fine. */
  #tellScale(finest) {
    if (!finest || this.finest === finest) return;
    this.finest = finest;
    SCALES.forEach((scale, index) => {
      setText(this.scale.options[index], scale < finest ? t("deliver.fine", { scale }) : `1:${scale}`);
    });
    if (!this.chosen) this.scale.value = `1:${finest}`;
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
