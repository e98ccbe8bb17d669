/**
 * The orientation that the program found by itself: the wall as a sheet in both photos, the one
 * length that gives its scale, and another face where the wall is none.
 */
import { decimal, h, html, noChange, number, parseNumber, render, repeat } from "./dom.js";
import * as drawing from "./drawing.js";
import { cross, numberField } from "./fields.js";
import { gridLines, gridStep, Wall } from "./geometry.js";
import { t } from "./words/words.js";

const SHEET = "rgb(60, 220, 130)";
const LENGTH_INK = "#ffe14d";
const CHECK_INK = "#b9f27c";

/** A length and what it is good to; nothing typed: what is taken everywhere. */
const taped = (kind, length, sigma, drawn) => html`<span class="taped"><label for="${kind}-length">${t("wall.length")}</label>
  <span class="with-unit">${numberField({ id: `${kind}-length`, size: 7, testid: length, value: drawn.length })}<span class="unit">m</span></span>±
  <span class="with-unit" title=${t("wall.sigma")}>${numberField({ label: t("wall.sigma"), size: 4, testid: sigma, placeholder: 3, value: drawn.sigma })}<span
    class="unit">mm</span></span></span>`;

/** What is typed into such a form: the length, and its sigma if any. [m] */
function typed(form) {
  const [length, sigma] = [...form.querySelectorAll("input")].map(({ value }) => parseNumber(value));
  return { length, ...(sigma > 0 ? { sigma: sigma / 1000 } : {}) };
}

export class WallCard {
  /** `stage`: the orientation, whose panes and picker it shares. */
  constructor(stage) {
    Object.assign(this, { stage, app: stage.app, tool: null, ends: [], image: 1, dismissed: false, checking: false });
    this.checkCard = h("section", { class: "card", hidden: true, testid: "checks" });
    this.element = h("section", { class: "card wall-card", hidden: true });
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
      const input = (this.checking ? this.checkCard : this.element).querySelector("input");
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

  async #send(form) {
    const { length, ...sigma } = typed(form);
    const drawn = this.app.state.scale;
    // The ends of a length that checks give no scale.
    const anew = this.ends.length === 2 && !this.checking;
    const ends = anew ? this.ends : drawn?.ends;
    if (!ends) return this.arm("length");
    if (!(length > 0)) return this.app.say(t("wall.number"), "warning");
    const image = anew ? this.image : drawn.image;
    if (await this.app.send("length.set", { image, ends, length, ...sigma })) {
      this.ends = [];
      document.activeElement.blur();
      this.app.say(t("wall.scaled"));
    }
    return undefined;
  }

  /** A length that gives no scale, and so checks it. */
  async #check(form) {
    const { length, ...sigma } = typed(form);
    if (!this.checking || this.ends.length < 2) return this.arm("check");
    if (!(length > 0)) return this.app.say(t("wall.number"), "warning");
    if (await this.app.send("length.check", { image: this.image, ends: this.ends, length, ...sigma })) {
      Object.assign(this, { ends: [], checking: false });
      form.querySelector("input").value = "";
      document.activeElement.blur();
      this.stage.refresh();
    }
    return undefined;
  }

  #form(tool, words, length, act, drawn = { length: noChange, sigma: noChange }) {
    const submit = (event) => { event.preventDefault(); act(event.target); };
    return html`<form class="row" novalidate @submit=${submit}>
      <button type="button" class="quiet" data-testid="${tool}-draw" @click=${() => this.arm(tool)}>${t(`${words}.draw`)}</button>
      ${taped(words, length, `${tool}-sigma`, drawn)}<button type="submit" class="quiet" data-testid="${tool}-set">${t(`${words}.set`)}</button></form>`;
  }

  #checks({ pair, check_lengths: checks }) {
    this.checkCard.hidden = !pair?.scaled;
    const compared = checks.filter(({ measured }) => Number.isFinite(measured));
    const most = Math.max(...compared.map(({ difference }) => 1000 * Math.abs(difference)), 0);
    render(html`<h2>${t("check.title")}</h2><p class="hint" role="status" data-testid="check-agreement">${compared.length
        ? t("check.agreement", { agree: compared.filter(({ agrees }) => agrees).length, count: compared.length, most: number(most, 0) }) : t("check.hint")}</p>
      <table class="grid"><tbody>${repeat(checks, ({ name }) => name, (check) => this.#checkRow(check))}</tbody></table>
      ${this.#form("check", "check", "check-value", (form) => this.#check(form))}`, this.checkCard);
  }

  #checkRow({ name, length, difference, sigma_difference: sigma, agrees }) {
    const compared = Number.isFinite(difference);
    return html`<tr><th scope="row">${name}</th><td class="number">${number(length, 3)} m</td>
      <td class=${agrees || !compared ? "number" : "number warn"}>${compared
        ? `${difference > 0 ? "+" : ""}${number(1000 * difference, 0)} ± ${number(1000 * sigma, 0)} mm` : ""}</td>
      <td>${cross(name, () => this.app.send("length.delete", { name }))}</td></tr>`;
  }

  update(state) {
    this.#checks(state);
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
    // The one thing that is asked is asked at once.
    if (found && !pair.scaled && !state.control.length && !this.tool && !this.ends.length && !this.dismissed) {
      Object.assign(this, { tool: "length", unasked: true });
    }
    if (this.unasked && this.tool && !this.ends.length && pair?.scaled) Object.assign(this, { tool: null, unasked: false });
    if (!found && !mended && !this.checking) Object.assign(this, { tool: null, ends: [] });
    const drawn = scale && this.ends.length < 2 && !this.element.contains(document.activeElement)
      ? { length: number(scale.length, 3), sigma: scale.sigma ? number(1000 * scale.sigma, 1) : "" } : undefined;
    render(html`<h2>${t("wall.title")}</h2><p class="wall-state" role="status" data-testid="wall-state"
        data-level=${found || mended ? "good" : looking ? "busy" : "fair"}>${words}</p>
      ${found || mended ? this.#form("length", "wall", "length-value", (form) => this.#send(form), drawn) : ""}
      ${ties && found ? html`<div class="row"><button type="button" class="quiet" data-testid="wall-pick"
        @click=${() => this.arm("wall")}>${t("wall.other")}</button><ul class="faces">${pair.report.planes.slice(1, 4).map((face) => this.#face(face))}</ul></div>` : ""}`, this.element);
  }

  #face({ offset, share, pixel: [column, row] }) {
    const show = (spot) => { this.spot = spot; this.stage.refresh(); };
    return html`<li><button type="button" class="quiet" @click=${() => this.app.send("wall.set", { column, row })}
      @pointerenter=${() => show([column, row])} @pointerleave=${() => show(null)}>${
      t("wall.face", { offset: `${offset > 0 ? "+" : ""}${number(1000 * offset, 0)}`, share: Math.round(100 * share) })}</button></li>`;
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
      if (b) drawing.beside(context, text, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], 8, ink, true);
    }
  }
}
