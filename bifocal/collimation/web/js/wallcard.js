/**
 * The orientation that the program found by itself: the wall as a sheet in both photos, the one
 * length that gives its scale, and another face where the wall is none.
 */
import { decimal, h, keyedRows, number, parseNumber, setText } from "./dom.js";
import * as drawing from "./drawing.js";
import { button } from "./fields.js";
import { gridLines, gridStep, Wall } from "./geometry.js";
import { t } from "./words/words.js";

const SHEET = "rgb(60, 220, 130)";
const LENGTH_INK = "#ffe14d";
const CHECK_INK = "#b9f27c";

/** A length and what it is good to; nothing typed: what is taken everywhere. */
const lengthInputs = (id, ...testids) => testids.map((testid, index) => h("input", { type: "text", inputmode: "decimal",
  autocomplete: "off", testid, size: index ? "4" : "7", ...(index ? { placeholder: "3", "aria-label": t("wall.sigma") } : { id }) }));

const lengthFields = (length, sigma) => h("span", { class: "taped" }, h("label", { for: length.id }, t("wall.length")),
  h("span", { class: "with-unit" }, length, h("span", { class: "unit" }, "m")), "±",
  h("span", { class: "with-unit", title: t("wall.sigma") }, sigma, h("span", { class: "unit" }, "mm")));

const sigmaOf = ({ value }) => (parseNumber(value) > 0 ? { sigma: parseNumber(value) / 1000 } : {});

export class WallCard {
  /** `stage`: the orientation, whose panes and picker it shares. */
  constructor(stage) {
    Object.assign(this, { stage, app: stage.app, tool: null, ends: [], image: 1, dismissed: false, checking: false });
    this.state = h("p", { class: "wall-state", role: "status", testid: "wall-state" });
    [this.length, this.sigma] = lengthInputs("wall-length", "length-value", "length-sigma");
    this.drawButton = button(t("wall.draw"), () => this.arm("length"), { class: "quiet", testid: "length-draw" });
    this.faceButton = button(t("wall.other"), () => this.arm("wall"), { class: "quiet", testid: "wall-pick" });
    this.faces = h("ul", { class: "faces" });
    this.form = h("form", { class: "row", onsubmit: (event) => { event.preventDefault(); this.#send(); } },
      this.drawButton, lengthFields(this.length, this.sigma),
      h("button", { type: "submit", class: "quiet", testid: "length-set" }, t("wall.set")));
    [this.checkLength, this.checkSigma] = lengthInputs("check-length", "check-value", "check-sigma");
    this.agreement = h("p", { class: "hint", role: "status", testid: "check-agreement" });
    this.checks = h("tbody");
    this.checkCard = h("section", { class: "card", hidden: true, testid: "checks" }, h("h2", {}, t("check.title")), this.agreement,
      h("table", { class: "grid" }, this.checks),
      h("form", { class: "row", onsubmit: (event) => { event.preventDefault(); this.#check(); } },
        button(t("check.draw"), () => this.arm("check"), { class: "quiet", testid: "check-draw" }),
        lengthFields(this.checkLength, this.checkSigma),
        h("button", { type: "submit", class: "quiet", testid: "check-set" }, t("check.set"))));
    this.element = h("section", { class: "card wall-card", hidden: true }, h("h2", {}, t("wall.title")), this.state,
      this.form, h("div", { class: "row" }, this.faceButton, this.faces));
  }

  /** The next clicks are the ends of the length, or a spot on the wall. */
  arm(tool) {
    Object.assign(this, { tool, ends: [], dismissed: false, unasked: false, checking: tool === "check" });
    this.stage.refresh();
  }

  dismiss() {
    if (!this.tool) return false;
    Object.assign(this, { tool: null, ends: [], dismissed: true });
    this.stage.refresh();
    return true;
  }

  /** What the next click is for, or nothing where it picks control points. */
  get asks() {
    if (this.ends.length === 2) return t("wall.askLength");
    if (!this.tool) return "";
    if (this.tool === "wall") return t("wall.askSpot");
    return t(this.ends.length === 1 ? "wall.askSecond" : "wall.askFirst");
  }

  /** Whether a click at a pixel of a photo was meant for it. */
  click(image, pixel) {
    if (!this.tool || (this.tool === "wall" && image !== 1)) return Boolean(this.tool);
    if (this.tool === "wall") {
      this.tool = null;
      this.app.send("wall.set", { column: pixel[0], row: pixel[1] });
      this.stage.refresh();
      return true;
    }
    if (this.ends.length === 1 && image !== this.image) this.ends = [];
    this.image = image;
    this.#end(image, pixel);
    return true;
  }

  /** An end of the length, on the corner that lies there. */
  async #end(image, [column, row]) {
    const ends = [...this.ends, [column, row]];
    this.ends = ends;
    if (ends.length === 2) {
      // What is typed next is the length.
      this.tool = null;
      const input = this.checking ? this.checkLength : this.length;
      input.value = "";
      input.focus();
    }
    this.stage.refresh();
    const radius = this.stage.picker.reach;
    const found = await this.app.connection.ask("api/snap", { image, column, row, radius }).catch(() => null);
    if (this.ends === ends && found && found.kind !== "none") {
      this.ends = [...ends.slice(0, -1), [found.column, found.row]];
    }
    this.stage.refresh();
  }

  async #send() {
    const length = parseNumber(this.length.value);
    const drawn = this.app.state.scale;
    // The ends of a length that checks give no scale.
    const anew = this.ends.length === 2 && !this.checking;
    const ends = anew ? this.ends : drawn?.ends;
    if (!ends) return this.arm("length");
    if (!(length > 0)) return this.app.say(t("wall.number"), "warning");
    const image = anew ? this.image : drawn.image;
    if (await this.app.send("length.set", { image, ends, length, ...sigmaOf(this.sigma) })) {
      this.ends = [];
      this.length.blur();
      this.sigma.blur();
      this.app.say(t("wall.scaled"));
    }
    return undefined;
  }

  /** A length that gives no scale, and so checks it. */
  async #check() {
    const length = parseNumber(this.checkLength.value);
    if (!this.checking || this.ends.length < 2) return this.arm("check");
    if (!(length > 0)) return this.app.say(t("wall.number"), "warning");
    if (await this.app.send("length.check", { image: this.image, ends: this.ends, length, ...sigmaOf(this.checkSigma) })) {
      Object.assign(this, { ends: [], checking: false });
      this.checkLength.value = "";
      this.checkLength.blur();
      this.stage.refresh();
    }
    return undefined;
  }

  #tellChecks({ pair, check_lengths: checks }) {
    this.checkCard.hidden = !pair?.scaled;
    const told = checks.filter(({ measured }) => Number.isFinite(measured));
    const most = Math.max(...told.map(({ difference }) => 1000 * Math.abs(difference)), 0);
    setText(this.agreement, told.length ? t("check.agreement", { agree: told.filter(({ agrees }) => agrees).length,
      count: told.length, most: number(most, 0) }) : t("check.hint"));
    keyedRows(this.checks, checks, { key: ({ name }) => name, signature: JSON.stringify,
      build: ({ name, length, difference, sigma_difference: sigma, agrees }) => h("tr", {}, h("th", { scope: "row" }, name),
        h("td", { class: "number" }, `${number(length, 3)} m`),
        h("td", { class: agrees || !Number.isFinite(difference) ? "number" : "number warn" },
          Number.isFinite(difference) ? `${difference > 0 ? "+" : ""}${number(1000 * difference, 0)} ± ${number(1000 * sigma, 0)} mm` : ""),
        h("td", {}, button("×", () => this.app.send("length.delete", { name }),
          { class: "icon", "aria-label": t("list.deleteOf", { name }) }))) });
  }

  update(state) {
    this.#tellChecks(state);
    const { pair, scale, looking } = state;
    const found = pair && pair.accepted === false && pair.report?.free_scale;
    // What gave the scale can be mended as long as the photos alone gave the rest.
    const mended = pair?.accepted && pair.free_scale;
    const failed = state.jobs.filter(({ kind }) => kind === "align").at(-1);
    const refused = !pair && failed?.quiet && failed.state === "failed" && !failed.cured ? failed.message : "";
    this.element.hidden = !found && !mended && !looking && !refused;
    const ties = pair?.report?.common_points;
    const grid = found && pair.scaled ? t("wall.grid", { step: decimal(String(gridStep(pair))) }) : "";
    const words = found ? `${ties ? t("wall.found", { share: Math.round((100 * ties.on_wall) / ties.count), count: ties.count }) : t("wall.ofProject")} ${grid}`.trim()
      : mended ? t("wall.mend") : looking ? t("wall.looking") : t("wall.refused", { why: refused });
    setText(this.state, words);
    this.state.dataset.level = found || mended ? "good" : looking ? "busy" : "fair";
    this.form.hidden = !found && !mended;
    this.faceButton.hidden = this.faces.hidden = !ties || !found;
    if (scale && ![this.length, this.sigma].includes(document.activeElement) && this.ends.length < 2) {
      this.length.value = number(scale.length, 3);
      this.sigma.value = scale.sigma ? number(1000 * scale.sigma, 1) : "";
    }
    // The one thing that is asked is asked at once.
    if (found && !pair.scaled && !state.control.length && !this.tool && !this.ends.length && !this.dismissed) {
      Object.assign(this, { tool: "length", unasked: true });
    }
    if (this.unasked && this.tool && !this.ends.length && pair?.scaled) Object.assign(this, { tool: null, unasked: false });
    if (!found && !mended && !this.checking) Object.assign(this, { tool: null, ends: [] });
    const others = found ? pair.report.planes.slice(1, 4) : [];
    keyedRows(this.faces, others, { key: ({ pixel }) => String(pixel), signature: JSON.stringify,
      build: ({ offset, share, pixel: [column, row] }) => h("li", {}, button(
        t("wall.face", { offset: `${offset > 0 ? "+" : ""}${number(1000 * offset, 0)}`, share: Math.round(100 * share) }),
        () => this.app.send("wall.set", { column, row }), { class: "quiet",
          onpointerenter: () => { this.spot = [column, row]; this.stage.refresh(); },
          onpointerleave: () => { this.spot = null; this.stage.refresh(); } })) });
  }

  /** Lines of a grid on the wall, as each photo shows them; kept until the pair is another one. */
  #grid(pair) {
    const mark = JSON.stringify(pair.images);
    if (this.mark !== mark) {
      Object.assign(this, { mark, lines: [1, 2].map((image) => gridLines(new Wall(pair), image, gridStep(pair))) });
    }
    return this.lines;
  }

  draw(context, pane) {
    const { pair, photos, scale } = this.app.state;
    const outlines = pair?.accepted === false ? pair.report?.wall?.[pane.image - 1] : null;
    if (outlines) {
      const [right, bottom] = [photos[pane.image - 1].width - 0.5, photos[pane.image - 1].height - 0.5];
      const frame = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]];
      drawing.sheet(context, pane, { frame, lines: this.#grid(pair)[pane.image - 1], outlines }, SHEET);
    }
    for (const check of this.app.state.check_lengths) this.#drawLength(context, pane, check, CHECK_INK);
    const drawn = this.ends.length ? { image: this.image, ends: this.ends } : scale;
    this.#drawLength(context, pane, drawn, LENGTH_INK);
    if (this.spot && pane.image === 1) drawing.centre(context, pane.screen(1, this.spot), t("wall.here"));
  }

  #drawLength(context, pane, drawn, ink) {
    if (drawn?.image === pane.image) {
      const places = drawn.ends.map((end) => pane.screen(pane.image, end));
      drawing.polyline(context, ink, places, { width: 2.5 });
      for (const place of places) drawing.marker(context, pane.image, place);
      const [a, b] = places;
      const text = drawn.length ? `${number(drawn.length, 3)} m` : t("wall.howLong");
      if (b) drawing.label(context, text, [(a[0] + b[0]) / 2 + 8, (a[1] + b[1]) / 2 - 8], ink);
    }
  }
}
