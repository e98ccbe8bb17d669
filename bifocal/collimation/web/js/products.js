/** Stage 4: relief and orthophoto run, looked at, delivered. */
import { h, keyedRows, number, parseNumber, setText } from "./dom.js";
import * as drawing from "./drawing.js";
import { button, choice, labelled, numberInput } from "./fields.js";
import { Wall } from "./geometry.js";
import { Profile } from "./profile.js";
import { wallMark } from "./tiles.js";
import { Pane, pictureLayer, pixelView, tileLayer } from "./viewer.js";
import { t } from "./words/words.js";

const SCALES = ["1:10", "1:20", "1:25", "1:50", "1:100", "1:200"];
const SHEETS = ["A4", "A3", "A2", "A1", "A0"];
const GRADES = ["fast", "standard", "best"];
const ASK_MS = 80;

/** Bytes of a file, in the unit that leaves digits to read. */
const size = (bytes) => (bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);

export class ProductsStage {
  constructor(app) {
    this.app = app;
    this.swipe = 1;
    this.photos = h("div", { class: "viewer" });
    this.value = h("p", { class: "value", role: "status", testid: "relief-value" });
    this.low = h("span", {});
    this.high = h("span", {});
    this.legend = h("div", { class: "legend", role: "img", hidden: true, testid: "relief-legend" },
      this.low, h("span", { class: "colours" }), this.high);
    this.profile = new Profile(app, () => this.pane?.paint(), () => {
      this.pane?.mounted();
      this.pane?.fit();
    });
    this.element = h("main", { class: "stage work", id: "stage-products" },
      h("div", { class: "table-top" }, this.#bar(), this.photos, this.profile.element),
      h("aside", { class: "panel" }, this.#reliefBox(), this.#orthoBox(), this.#deliverBox()));
  }

  #bar() {
    const range = (id, value, changed) => {
      const input = h("input", { type: "range", min: "0", max: "100", value, id, testid: id,
        oninput: () => changed(input.value / 100) });
      return h("span", { class: "slider" }, h("label", { for: id }, t(`products.${id}`)), input);
    };
    this.opacity = 0.6;
    return h("div", { class: "layer-bar", role: "toolbar", "aria-label": t("layer.bar") },
      range("relief-opacity", "60", (value) => { this.opacity = value; this.#apply(); }),
      range("ortho-swipe", "100", (value) => { this.swipe = value; this.#apply(); }),
      button(t("profile.draw"), () => this.profile.begin(), { class: "quiet", testid: "profile" }),
      this.value);
  }

  #reliefBox() {
    this.grade = choice({ label: t("relief.quality"), value: "standard", testid: "relief-quality",
      options: Object.fromEntries(GRADES.map((grade) => [grade, t(`relief.${grade}`)])), save: () => {} });
    this.runRelief = button(t("relief.run"), () => this.app.job("relief", { quality: this.grade.value }),
      { class: "primary", testid: "run-relief" });
    this.reliefState = h("p", { class: "hint" });
    return h("section", { class: "card" }, h("h2", {}, t("relief.title")), this.reliefState,
      h("div", { class: "row" }, this.grade, this.runRelief), this.app.jobBox("relief"));
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
    this.runOrtho = button(t("ortho.run"), run, { class: "primary", testid: "run-ortho" });
    this.orthoState = h("p", { class: "hint" });
    return h("section", { class: "card" }, h("h2", {}, t("ortho.title")), this.orthoState,
      h("div", { class: "fields" }, labelled(t("ortho.gsd"), this.gsd, "mm"),
        labelled(t("ortho.source"), this.source)),
      h("div", { class: "row" }, this.runOrtho), this.app.jobBox("ortho"));
  }

  #deliverBox() {
    const same = (names) => Object.fromEntries(names.map((name) => [name, name]));
    this.scale = choice({ label: t("deliver.scale"), options: same(SCALES), value: "1:50",
      save: () => {}, testid: "deliver-scale" });
    this.sheet = choice({ label: t("deliver.sheet"), options: { auto: t("deliver.auto"), ...same(SHEETS) },
      save: () => {}, testid: "deliver-sheet" });
    this.deliver = button(t("deliver.run"), () => this.app.job("deliver", { scale: this.scale.value,
      image: this.source.value, sheet: this.sheet.value === "auto" ? null : this.sheet.value }), { class: "primary", testid: "deliver" });
    this.files = h("ul", { class: "files" });
    this.download = h("a", { class: "button", href: "/download/all.zip", download: "", testid: "download" },
      t("deliver.download"));
    return h("section", { class: "card" }, h("h2", {}, t("deliver.title")),
      h("p", { class: "hint" }, t("deliver.hint")), h("div", { class: "fields" },
        labelled(t("deliver.scale"), this.scale), labelled(t("deliver.sheet"), this.sheet)),
      h("div", { class: "row" }, this.deliver, this.download), this.app.jobBox("deliver"), this.files);
  }

  status(state) {
    if (!state.pair) return { text: t("status.points.pair") };
    if (!state.products.relief) return { text: t("status.products.relief") };
    if (!state.products.ortho) return { text: t("status.products.ortho") };
    if (!state.products.files.some(({ name }) => name.endsWith(".pdf"))) {
      return { text: t("status.products.deliver") };
    }
    return { done: true, text: t("status.done") };
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
    const [walls, image] = await Promise.all([
      this.app.pyramids.info("wall", 1, this.wallMark),
      ortho ? this.app.pyramids.info("ortho", 0, mark).catch(() => null) : null]);
    if (this.mark !== mark) return;
    const layers = [tileLayer(this.view, "layer-1", "/tiles/wall/1", walls)];
    this.ortho = image && this.#orthoLayer(ortho, image);
    if (this.ortho) layers.push(this.ortho);
    this.relief = relief && pictureLayer(this.view, "layer-relief", `/relief/overlay.png?v=${done.length}-${state.revision}`,
      this.#edges(relief.bounds));
    if (this.relief) layers.push(this.relief);
    this.pane.setLayers(layers);
    this.#apply();
  }

  #makePane(state) {
    this.pane?.dispose();
    this.wall = new Wall(state.pair);
    this.view = pixelView(this.wall.width, this.wall.height);
    this.pane = new Pane({ label: t("pane.products"), view: this.view, frame: this.wall,
      painter: (context, pane) => this.#draw(context, pane) });
    this.pane.addEventListener("hover", ({ detail }) => this.#ask(detail.pixel));
    this.pane.addEventListener("pick", ({ detail }) => {
      this.profile.click(this.wall.toPlane(this.pane.unplace(detail.pixel)));
    });
    this.photos.replaceChildren(this.pane.element, this.legend);
    this.pane.mounted();
  }

  /** Outer edges on the plane [m] -> outer edges on the wall's grid, in columns and rows. */
  #edges([xmin, ymin, xmax, ymax]) {
    return [...this.wall.fromPlane([xmin, ymax]), ...this.wall.fromPlane([xmax, ymin])];
  }

  #orthoLayer(ortho, info) {
    const [left, top, right] = this.#edges(ortho.bounds);
    const scale = (right - left) / info.width;
    return tileLayer(this.view, "layer-ortho", "/tiles/ortho/0", info, [left + 0.5, -top - 0.5, scale]);
  }

  #apply() {
    this.relief?.setOpacity(this.opacity);
    this.photos.style.setProperty("--ortho-cut", `${100 * (1 - this.swipe)}%`);
  }

  #draw(context, pane) {
    const places = this.profile.ends.map((end) => pane.place(this.wall.fromPlane(end)));
    drawing.polyline(context, "#ffffff", places, { width: 2 });
    for (const place of places) drawing.marker(context, 2, place);
    const here = this.profile.here();
    if (here) drawing.marker(context, 1, pane.place(this.wall.fromPlane(here)));
  }

  /** The relief under the pointer, asked at most a dozen times a second. */
  #ask(pixel) {
    this.wanted = pixel && this.app.state.products.relief ? pixel : null;
    if (this.asking || !this.wanted) return;
    this.asking = setTimeout(async () => {
      const wanted = this.wanted;
      if (wanted) {
        const [X, Y] = this.wall.toPlane(this.pane.unplace(wanted));
        const { r, sigma } = await this.app.connection.get(`/relief/value?X=${X}&Y=${Y}`).catch(() => ({}));
        const relief = Number.isFinite(r) ? `r ${number(r, 3)} ± ${number(sigma, 3)} m` : t("relief.unknown");
        setText(this.value, `X ${number(X, 3)} · Y ${number(Y, 3)} · ${relief}`);
      }
      this.asking = null;
      if (this.wanted && this.wanted !== wanted) this.#ask(this.wanted);
    }, ASK_MS);
  }

  update(state) {
    this.prepare(state).catch((error) => this.app.refuse(error));
    const { relief, ortho, files } = state.products;
    const pixels = (product) => (product.cols ? `${product.cols} × ${product.rows} px` : "");
    this.#name(relief?.range);
    setText(this.reliefState, relief ? t("relief.ready", { size: pixels(relief) }) : t("relief.hint"));
    setText(this.orthoState, ortho ? t("ortho.ready", { size: pixels(ortho) }) : t("ortho.hint"));
    this.runRelief.disabled = !state.pair;
    this.runOrtho.disabled = !state.pair;
    this.deliver.disabled = !ortho;
    this.deliver.title = ortho ? "" : t("status.products.ortho");
    this.download.hidden = !files.length;
    keyedRows(this.files, files, { key: ({ name }) => name, signature: JSON.stringify,
      build: ({ name, bytes }) => h("li", {}, h("a", { href: `/download/${encodeURIComponent(name)}`, download: "" }, name),
        h("span", { class: "hint" }, ` ${size(bytes)}`)) });
  }

  /** Say what the colours of the relief mean. */
  #name(range) {
    this.legend.hidden = !range;
    if (!range) return;
    const [low, high] = range.map((value) => number(value, 2));
    setText(this.low, low);
    setText(this.high, `${high} m`);
    this.legend.setAttribute("aria-label", t("relief.legend", { low, high }));
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
