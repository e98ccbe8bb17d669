/** Stage 3: both photos on the wall's grid, superimposed; homologous points and what they give. */
import { h, setText } from "./dom.js";
import * as drawing from "./drawing.js";
import { button } from "./fields.js";
import { Wall } from "./geometry.js";
import { Superposition } from "./layers.js";
import { Lines, Measure } from "./lines.js";
import { Loupe } from "./loupe.js";
import { Picker, trust } from "./picker.js";
import { PointList } from "./pointlist.js";
import { isWarning, Readout, TYPES } from "./readout.js";
import { sketched } from "./sketches.js";
import { photoMark, wallMark } from "./tiles.js";
import { Pane, pictureLayer, pixelView, spread, tileLayer } from "./viewer.js";
import { t } from "./words/words.js";

const LINE_INK = "#b9f27c";

export class PointsStage {
  constructor(app) {
    this.app = app;
    this.panes = [];
    this.picker = new Picker({ connection: app.connection, kind: "point", partner: true,
      items: () => app.points(), panes: () => this.panes });
    app.listen(this.picker, () => this.#refresh(), () => this.#look());
    this.loupe = new Loupe();
    this.buttons = this.#buttons();
    this.readout = new Readout(app, this.picker);
    this.list = new PointList(app, this.picker,
      [this.buttons.match, h("a", { class: "button quiet", href: "download/points.dxf", download: "" }, "DXF")],
      app.jobBox("match"));
    this.lines = new Lines(app, this.picker);
    this.measure = new Measure(app, this.picker);
    this.photos = h("div", { class: "viewer" });
    this.layers = new Superposition(this.photos);
    this.layers.addEventListener("mode", () => this.#arrange());
    new ResizeObserver(() => this.wall && spread(this.photos, this.wall.width, this.wall.height))
      .observe(this.photos);
    this.layers.addEventListener("blink", () => this.#paint());
    this.target = h("p", { class: "target", role: "status", testid: "target" });
    this.quality = h("p", { class: "quality", testid: "quality" });
    this.areaButton = button(t("pick.area"), () => this.toggleArea(), { class: "quiet",
      testid: "uncertainty", "aria-pressed": "false" });
    sketched(this.areaButton, "sigma");
    this.contours = [];
    this.fitButton = button(h("span", { class: "whole", "aria-hidden": "true" }), () => this.activePane?.fit(), { class: "icon", testid: "fit",
      "aria-label": t("key.fit"), title: `${t("key.fit")} (0)` });
    this.layers.element.append(this.areaButton, this.fitButton);
    const hand = h("section", { class: "hand" }, this.target, h("div", { class: "row" },
      this.buttons.pick, this.buttons.suggest, this.buttons.accept, this.buttons.snap, this.buttons.fresh),
    this.quality);
    this.element = h("div", { class: "stage work", id: "stage-points" },
      h("div", { class: "table-top" }, this.layers.element, this.photos),
      h("aside", { class: "panel" }, hand, this.loupe.element, this.readout.element,
        this.list.element, this.lines.element, this.measure.element));
    this.measures = "";
  }

  #buttons() {
    const { picker } = this;
    return {
      pick: button(t("pick.pick"), () => picker.begin(), { testid: "pick" }),
      suggest: button(t("pick.suggest"), () => picker.suggest(), { class: "quiet", testid: "suggest" }),
      accept: button(t("pick.accept"), () => picker.accept(), { class: "primary", testid: "accept" }),
      snap: button(t("pick.snap"), () => picker.snap(), { class: "quiet", testid: "snap" }),
      match: button(t("pick.match"), () => this.app.job("match"), { class: "quiet", testid: "match" }),
      fresh: button(t("pick.new"), () => picker.fresh(), { class: "quiet", testid: "point-new" }),
    };
  }

  /** Panes at once, so that pixels have their place; tiles as soon as the server tells of them. */
  async prepare(state) {
    const mark = wallMark(state);
    if (!state.pair || this.mark === mark) return;
    this.mark = mark;
    this.wall = new Wall(state.pair);
    this.view = pixelView(this.wall.width, this.wall.height);
    this.tileLayers = null;
    this.area = null;
    this.contours = [];
    this.areaButton.setAttribute("aria-pressed", "false");
    this.#makePanes();
    const [walls, photos] = await Promise.all([this.app.pyramids.both("wall", mark),
      this.app.pyramids.both("photo", photoMark(state))]);
    if (this.mark !== mark) return;
    this.tileLayers = Object.fromEntries([1, 2].map((image) => [image,
      tileLayer(`layer-${image}`, `tiles/wall/${image}`, walls[image - 1], null,
        this.wall.frameOf(image, state.photos[image - 1]))]));
    photos.forEach((info, index) => this.loupe.source(index + 1, info));
    this.layers.use(this.tileLayers);
    this.#arrange();
  }

  #makePanes() {
    const pane = (label) => {
      const made = new Pane({ label, view: this.view, frame: this.wall,
        painter: (context, self) => this.#draw(context, self) });
      this.app.follow(made, this.picker);
      return made;
    };
    this.picker.letGoOf(this.panes);
    for (const one of [this.main, this.second]) one?.dispose();
    this.main = pane(t("pane.wall"));
    this.second = pane(t("pane.photo", { image: 2, role: t("photo.near") }));
    this.photos.replaceChildren(this.main.element, this.second.element, this.layers.handle);
    this.#arrange();
    for (const one of this.panes) one.mounted();
  }

  /** One pane for both photos, or one each that share the view. */
  #arrange() {
    if (!this.main) return;
    const split = this.layers.mode === "split";
    this.photos.classList.toggle("two", split);
    spread(this.photos, this.wall.width, this.wall.height);
    this.second.element.hidden = !split;
    this.main.image = split ? 1 : null;
    this.second.image = split ? 2 : null;
    this.main.images = split ? [1] : [1, 2];
    this.second.images = [2];
    this.panes = split ? [this.main, this.second] : [this.main];
    if (!this.tileLayers) return;
    const { 1: far, 2: near } = this.tileLayers;
    const area = this.area ? [this.area] : [];
    this.second.setLayers([]);
    this.main.setLayers(split ? [far, ...area] : [far, near, ...area]);
    this.second.setLayers(split ? [near] : []);
    this.#paint();
  }

  toggleArea() {
    const { width, height } = this.wall ?? {};
    if (!this.view) return;
    this.area = this.area ? null : pictureLayer("layer-area", `uncertainty.png?v=${Date.now()}`,
      [-0.5, -0.5, width - 0.5, height - 0.5]);
    this.areaButton.setAttribute("aria-pressed", String(Boolean(this.area)));
    this.contours = [];
    this.#arrange();
    const { area } = this;
    if (area) {
      this.app.connection.get("uncertainty.json").then((lines) => {
        if (this.area === area) this.contours = lines;
        this.#paint();
      }).catch((error) => this.app.refuse(error));
    }
  }

  remove() {
    const { selected } = this.picker;
    if (!selected) return;
    this.picker.fresh();
    this.app.send("point.delete", { name: selected });
    this.app.say(t("say.deleted", { name: selected }));
  }

  cycleType() {
    const { item } = this.picker;
    if (!item) return;
    const type = TYPES[(TYPES.indexOf(item.type) + 1) % TYPES.length];
    this.app.send("point.type", { name: item.name, type });
  }

  rename() {
    const field = this.readout.element.querySelector("[data-testid=point-name]");
    field?.focus();
    field?.select();
  }

  #draw(context, pane) {
    const { picker, app } = this;
    const { pair } = app.state;
    if (!pair) return;
    if (pair.zoom_centre) drawing.centre(context, pane.place(pair.zoom_centre.wall), t("draw.centre"));
    for (const { sigma_mm: sigma, line } of this.contours) {
      drawing.contour(context, pane, line.map((pixel) => pane.place(pixel)), `${sigma} mm`);
    }
    this.#drawLines(context, pane);
    const { guide, proposal, cursor } = picker;
    if (guide && pane.images.includes(guide.image)) {
      const places = guide.line.map((pixel) => pane.screen(guide.image, pixel));
      drawing.polyline(context, drawing.INK[guide.image], places, { width: 1.2, dash: [8, 5] });
    }
    drawing.picks(context, pane, { items: app.points(), images: pane.images,
      pick: (item, image) => picker.pick(item, image), selected: picker.selected,
      doubtful: ({ result }) => isWarning(result?.flag) });
    if (proposal && pane.images.includes(proposal.image)) {
      for (const { column, row } of proposal.others ?? []) {
        const place = pane.screen(proposal.image, [column, row]);
        drawing.marker(context, proposal.image, place, { proposed: true });
        drawing.label(context, "?", [place[0] + 11, place[1] + 4], drawing.INK[proposal.image]);
      }
      const place = pane.screen(proposal.image, [proposal.column, proposal.row]);
      drawing.marker(context, proposal.image, place, { selected: true, proposed: true });
      const sure = proposal.quality === null ? "" : ` ${Math.round(100 * proposal.quality)} %`;
      drawing.label(context, `?${sure}`, [place[0] + 16, place[1] + 18],
        drawing.INK[proposal.image]);
    }
    if (cursor?.pane === pane) {
      drawing.cursor(context, pane, cursor.place, pane.image ?? picker.target.image);
    }
  }

  #drawLines(context, pane) {
    const { lines } = this.app.state;
    if (!lines.length) return;
    const known = new Map(this.app.points().map((item) => [item.name, item]));
    const [image] = pane.images;
    for (const { points, closed, name } of lines) {
      const places = points.map((one) => known.get(one)).filter(Boolean)
        .map((item) => this.picker.pick(item, image)).filter(Boolean)
        .map((pixel) => pane.screen(image, pixel));
      const width = name === this.lines.current ? 3 : 1.8;
      drawing.polyline(context, LINE_INK, places, { width, closed });
    }
  }

  update(state) {
    this.prepare(state).catch((error) => this.app.refuse(error));
    if (this.picker.selected && !this.picker.item && !this.app.connection.running) this.picker.fresh();
    this.list.update();
    this.lines.update();
    const places = JSON.stringify(this.measure.names.map((name) =>
      this.app.points().find((item) => item.name === name)?.result));
    if (places !== this.measures && this.measure.names.length) this.measure.update();
    this.measures = places;
    this.#refresh();
  }

  #refresh() {
    const { target, picking, proposal, selected } = this.picker;
    const next = { name: target.name ?? t("point.newName"), image: target.image };
    setText(this.target, picking ? t("pick.next", next) : t("pick.off"));
    this.target.dataset.image = target.image;
    this.layers.lean(picking ? target.image : null);
    this.#tellPhoto(picking ? target.image : null);
    this.buttons.pick.setAttribute("aria-pressed", String(picking));
    for (const key of ["suggest", "snap"]) this.buttons[key].disabled = !selected;
    this.buttons.accept.disabled = !proposal && !this.picker.lacking;
    // How sure another place is that fits as well, nobody knows.
    const { level, values } = trust(proposal);
    const words = level && t(`quality.${level}`, values);
    const others = proposal?.others?.length ?? 0;
    setText(this.quality, [words, others && t("quality.others", { count: others })].filter(Boolean).join(" "));
    this.quality.dataset.level = level;
    this.readout.update();
    this.list.mark();
    this.#paint();
    this.#look();
  }

  /** Over the picture stands which photo the next click belongs to. */
  #tellPhoto(image) {
    if (!this.main) return;
    this.whose ??= h("span", { testid: "whose" });
    if (this.whose.parentElement !== this.main.element) this.main.element.append(this.whose);
    this.whose.hidden = !image || this.layers.mode === "split";
    this.whose.className = `badge ink-${image ?? 1}`;
    setText(this.whose, image ? t("pane.whose", { image, role: t(image === 1 ? "photo.far" : "photo.near") }) : "");
  }

  #paint() {
    for (const pane of this.panes) pane.paint();
  }

  #look() {
    const { guide } = this.picker;
    for (const image of [1, 2]) {
      const place = this.picker.sight(image) ?? this.paneOf(image)?.middle(image);
      this.loupe.look(image, place, guide?.image === image ? guide.line : null);
    }
  }

  flyTo(name) {
    const item = this.app.points().find((one) => one.name === name);
    if (!item || !this.main) return false;
    this.picker.select(name);
    const image = this.picker.pick(item, 1) ? 1 : 2;
    const pixel = this.picker.pick(item, image);
    if (pixel) this.main.flyTo(this.main.grid(image, pixel));
    return true;
  }

  get activePane() {
    return this.panes.find(({ element }) => element === document.activeElement) ??
      this.panes.find(({ image }) => image === this.picker.target.image) ?? this.panes[0];
  }

  paneOf(image) {
    return this.panes.find((pane) => pane.image === image) ?? this.panes[0];
  }
}
