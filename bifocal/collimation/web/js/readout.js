/** The point in hand: its name, type, reference and everything that follows from its picks. */
import { h, number, setText } from "./dom.js";
import { afresh, button, choice, fill, labelled, numberInput, textInput } from "./fields.js";
import { sketched } from "./sketches.js";
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
    this.app = app;
    this.picker = picker;
    const { send } = app;
    this.name = textInput({ label: t("point.name"), testid: "point-name",
      save: (text) => text && this.#rename(text) });
    this.type = choice({ label: t("point.type"), testid: "point-type",
      options: Object.fromEntries([...TYPES, "doubtful"].map((type) => [type, t(`type.${type}`)])),
      save: (type) => send("point.type", { name: picker.selected, type }) });
    this.reference = Object.fromEntries(["X", "Y", "r"].map((key) => [key, numberInput({
      label: t("point.reference", { key }), size: "7", save: (value) => this.#refer(key, value) })]));
    this.cells = Object.fromEntries(VALUES.map(([key]) => [key, h("dd", { testid: `value-${key}` })]));
    this.flag = h("p", { class: "flag", testid: "value-flag" });
    this.fields = h("div", { class: "fields" }, labelled(t("point.name"), this.name),
      labelled(t("point.type"), this.type));
    this.references = h("div", { class: "fields three" }, Object.entries(this.reference)
      .map(([key, input]) => labelled(t("point.reference", { key }), input, "m")));
    this.values = h("dl", { class: "values" }, VALUES.map(([key]) =>
      h("div", { class: key === "r" ? "main" : "" }, sketched(h("dt", {}, t(`value.${key}`)), key), this.cells[key])));
    this.empty = h("p", { class: "hint" }, t("point.none"));
    this.remove = button(t("pick.delete"), () => app.stages.points.remove(), { class: "quiet", testid: "point-delete" });
    this.foot = h("div", { class: "row between" }, this.flag, this.remove);
    this.element = h("section", { class: "card readout", "aria-label": t("point.inHand") },
      this.empty, this.fields, this.values, this.references, this.foot);
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

  #refer(key, value) {
    const { item } = this.picker;
    return this.app.send("point.reference", { name: item.name, [key]: value });
  }

  update() {
    const { item } = this.picker;
    this.empty.hidden = Boolean(item);
    for (const part of [this.fields, this.values, this.foot]) part.hidden = !item;
    this.references.hidden = !item || !["check", "control"].includes(item.type);
    // What was refused for one point is not another's.
    if (item?.name !== this.shown) afresh([this.name, ...Object.values(this.reference)]);
    this.shown = item?.name;
    if (!item) return;
    fill(this.name, item.name);
    this.type.value = item.type;
    for (const [key, input] of Object.entries(this.reference)) fill(input, item.reference?.[key]);
    const result = item.result ?? {};
    for (const [key, unit, most, sigma] of VALUES) {
      // Tenths of a millimetre only where they mean something.
      const digits = result[sigma] > COARSE ? 3 : most;
      const value = number(result[key], digits);
      const shown = unit === "mm" ? this.app.state.length_unit ?? unit : unit;
      const spread = sigma && Number.isFinite(result[sigma]) ? ` ± ${number(result[sigma], digits)}` : "";
      setText(this.cells[key], value === "–" ? value : `${value}${spread} ${shown}`);
    }
    const flag = result.flag ?? null;
    setText(this.flag, item.result ? flagWords(flag, result.uncertain_area) : t("flag.incomplete"));
    this.flag.dataset.level = !item.result ? "open" : isWarning(flag) ? "warn" : "good";
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
