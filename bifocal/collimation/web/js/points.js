/** Stage 3: both photos on the wall's grid, superimposed; homologous points and what they give. */
import { h, html, nothing, render } from "./dom.js";
import * as drawing from "./drawing.js";
import { Wall } from "./geometry.js";
import { Superposition } from "./layers.js";
import { Lines, Measure } from "./lines.js";
import { Loupe } from "./loupe.js";
import { Picker, trust } from "./picker.js";
import { PointList } from "./pointlist.js";
import { isWarning, Readout, TYPES } from "./readout.js";
import { sketch } from "./sketches.js";
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
    Object.assign(this, { loupe: new Loupe(), readout: new Readout(app, this.picker), list: new PointList(app, this.picker),
      lines: new Lines(app, this.picker), measure: new Measure(app, this.picker), area: null, contours: [], measures: "" });
    this.photos = h("div", { class: "viewer" });
    this.layers = new Superposition(this.photos, () => this.#tools());
    this.layers.addEventListener("mode", () => this.#arrange());
    this.layers.addEventListener("blink", () => this.#paint());
    new ResizeObserver(() => this.wall && spread(this.photos, this.wall.width, this.wall.height)).observe(this.photos);
    this.whose = h("span", { testid: "whose" });
    this.hand = h("section", { class: "hand" });
    this.element = h("div", { class: "stage work", id: "stage-points" },
      h("div", { class: "table-top" }, this.layers.element, this.photos),
      h("aside", { class: "panel" }, this.hand, ...["loupe", "readout", "list", "lines", "measure"].map((key) => this[key].element)));
  }

  #tools() {
    return html`<button type="button" class="quiet" data-testid="uncertainty" aria-pressed=${Boolean(this.area)} ${sketch("sigma")}
        @click=${() => this.toggleArea()}>${t("pick.area")}</button>
      <button type="button" class="icon" data-testid="fit" aria-label=${t("key.fit")} title="${t("key.fit")} (0)"
        @click=${() => this.activePane?.fit()}><span class="whole" aria-hidden="true"></span></button>`;
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
    this.layers.paint();
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
    const { target, picking } = this.picker;
    this.layers.lean(picking ? target.image : null);
    this.#tellPhoto(picking ? target.image : null);
    render(this.#inHand(), this.hand);
    this.readout.update();
    this.list.mark();
    this.#paint();
    this.#look();
  }

  /** What the next click picks, what can be done with the point in hand, how sure its other pick is. */
  #inHand() {
    const { picker } = this;
    const { target, picking, proposal, selected } = picker;
    // How sure another place is that fits as well, nobody knows.
    const { level, values } = trust(proposal);
    const others = proposal?.others?.length ?? 0;
    const words = [level && t(`quality.${level}`, values), others && t("quality.others", { count: others })].filter(Boolean).join(" ");
    return html`<p class="target" role="status" data-testid="target" data-image=${target.image}>${picking
        ? t("pick.next", { name: target.name ?? t("point.newName"), image: target.image }) : t("pick.off")}</p>
      <div class="row"><button type="button" data-testid="pick" aria-pressed=${picking} @click=${() => picker.begin()}>${t("pick.pick")}</button>
        <button type="button" class="quiet" data-testid="suggest" ?disabled=${!selected} @click=${() => picker.suggest()}>${t("pick.suggest")}</button>
        <button type="button" class="primary" data-testid="accept" ?disabled=${!proposal && !picker.lacking} @click=${() => picker.accept()}>${t("pick.accept")}</button>
        <button type="button" class="quiet" data-testid="snap" ?disabled=${!selected} @click=${() => picker.snap()}>${t("pick.snap")}</button>
        <button type="button" class="quiet" data-testid="point-new" @click=${() => picker.fresh()}>${t("pick.new")}</button></div>
      <p class="quality" data-testid="quality" data-level=${level ?? nothing}>${words}</p>`;
  }

  /** Over the picture stands which photo the next click belongs to. */
  #tellPhoto(image) {
    if (!this.main) return;
    if (this.whose.parentElement !== this.main.element) this.main.element.append(this.whose);
    this.whose.hidden = !image || this.layers.mode === "split";
    this.whose.className = `badge ink-${image ?? 1}`;
    this.whose.textContent = image ? t("pane.whose", { image, role: t(image === 1 ? "photo.far" : "photo.near") }) : "";
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
