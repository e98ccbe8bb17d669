/** The point in hand: its name, type, reference and everything that follows from its picks. */
import { h, html, number, render } from "./dom.js";
import { named, numberField, select, textField } from "./fields.js";
import { sketch } from "./sketches.js";
import { t } from "./words/words.js";

/** Standard deviation from which millimetres are enough. [m] */
const COARSE = 0.003;
export const TYPES = ["plain", "wall", "check", "control"];
const VALUES = [
  ["r", "m", 4, "sigma_r"], ["X", "m", 4, "sigma_X"], ["Y", "m", 4, "sigma_Y"],
  ["s1", "mm", 4], ["s2", "mm", 4], ["delta_s", "mm", 4], ["e1", "mm", 4], ["misfit_px", "px", 2],
];

export class Readout {
  constructor(app, picker) {
    Object.assign(this, { app, picker });
    this.element = h("section", { class: "card readout", "aria-label": t("point.inHand") });
  }

  /** The point stays in hand under its new name. */
  async #rename(name) {
    const { selected } = this.picker;
    try {
      await this.app.connection.send("point.rename", { name: selected, new: name });
      if (this.picker.selected === selected) this.picker.select(name);
      return true;
    } catch (error) {
      return this.app.refuse(error);
    }
  }

  update() {
    const { item } = this.picker;
    render(item ? this.#point(item) : html`<p class="hint">${t("point.none")}</p>`, this.element);
  }

  #point({ name, type, reference, result }) {
    const { send, stages } = this.app;
    const options = Object.fromEntries([...TYPES, "doubtful"].map((key) => [key, t(`type.${key}`)]));
    return html`<div class="fields">${named(t("point.name"), "point-name", textField({ id: "point-name", testid: "point-name", value: name,
        subject: name, save: (text) => text && this.#rename(text) }))}
      ${named(t("point.type"), "point-type", select({ id: "point-type", testid: "point-type", options, value: type,
        save: (key) => send("point.type", { name, type: key }) }))}</div>
      <dl class="values">${VALUES.map((row) => html`<div class=${row[0] === "r" ? "main" : ""}><dt ${sketch(row[0])}>${t(`value.${row[0]}`)}</dt>
        <dd data-testid="value-${row[0]}">${this.#value(result ?? {}, ...row)}</dd></div>`)}</dl>
      ${["check", "control"].includes(type) ? html`<div class="fields three">${["X", "Y", "r"].map((key) => named(t("point.reference", { key }),
        `reference-${key}`, numberField({ id: `reference-${key}`, size: 7, value: reference?.[key], subject: name,
          save: (value) => send("point.reference", { name, [key]: value }) }), "m"))}</div>` : ""}
      <div class="row between"><p class="flag" data-testid="value-flag" data-level=${!result ? "open" : isWarning(result.flag) ? "warn" : "good"}>${
        result ? flagWords(result.flag, result.uncertain_area) : t("flag.incomplete")}</p>
        <button type="button" class="quiet" data-testid="point-delete" @click=${() => stages.points.remove()}>${t("pick.delete")}</button></div>`;
  }

  #value(result, key, unit, most, sigma) {
    // Tenths of a millimetre only where they mean something.
    const digits = result[sigma] > COARSE ? 3 : most;
    const value = number(result[key], digits);
    const spread = sigma && Number.isFinite(result[sigma]) ? ` ± ${number(result[sigma], digits)}` : "";
    return value === "–" ? value : `${value}${spread} ${unit === "mm" ? this.app.state.length_unit ?? unit : unit}`;
  }
}

/** That a point lies on the plane is said, not warned of. */
export const isWarning = (flag) => Boolean(flag) && !["OK", "ON-PLANE"].includes(flag);

/** The flag as the workbook has it, and what it means. */
function flagWords(flag, uncertain) {
  const words = t(`flag.${flag || "OK"}`);
  const meaning = words.startsWith("flag.") ? "" : ` · ${words}`;
  return `${flag || "OK"}${meaning}${uncertain ? ` · ${t("flag.area")}` : ""}`;
}
