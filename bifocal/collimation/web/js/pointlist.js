/** All points: sorted by any column, named, found, deleted. */
import { h, keyedRows, number, setText } from "./dom.js";
import { button } from "./fields.js";
import { isWarning } from "./readout.js";
import { t } from "./words/words.js";

const size = (value) => (typeof value === "number" ? Math.abs(value) : null);

const COLUMNS = [
  ["name", (item) => item.name],
  ["type", (item) => item.type],
  ["r", (item) => item.result?.r ?? null],
  ["sigma_r", (item) => item.result?.sigma_r ?? null],
  ["misfit_px", (item) => size(item.result?.misfit_px)],
  ["flag", (item) => (item.result ? item.result.flag || "OK" : "…")],
];
const DIGITS = { r: 3, sigma_r: 3, misfit_px: 1 };
const worded = new Intl.Collator(undefined, { numeric: true });

/** What has no value yet comes last either way. */
function compare(a, b, down) {
  if (a === null || b === null) return (a === null) - (b === null);
  const order = typeof a === "number" ? a - b : worded.compare(a, b);
  return down ? -order : order;
}

export class PointList {
  /** `tools`: what stands beside the heading; `progress`: below it. */
  constructor(app, picker, tools, progress) {
    this.app = app;
    this.picker = picker;
    this.sort = { column: null, down: false };
    this.body = h("tbody");
    this.heads = COLUMNS.map(([key]) => h("th", { scope: "col", "aria-sort": "none" },
      h("button", { type: "button", class: "sort", onclick: () => this.#sortBy(key) }, t(`list.${key}`))));
    this.count = h("span", { class: "count" });
    this.table = h("table", { class: "grid points", testid: "point-list" },
      h("caption", { class: "unseen" }, t("list.title")),
      h("thead", {}, h("tr", {}, this.heads)), this.body);
    this.doubts = button("", () => this.step(1, this.doubtful), { class: "quiet warn", testid: "next-doubtful",
      title: `${t("key.doubtful")} (Y)` });
    this.element = h("section", { class: "card list" },
      h("div", { class: "row between" }, h("h2", {}, t("list.title"), " ", this.count),
        h("span", { class: "row" }, this.doubts, tools)), progress, h("div", { class: "scroll" }, this.table));
    this.table.addEventListener("keydown", (event) => this.#key(event));
  }

  #sortBy(column) {
    const down = this.sort.column === column ? !this.sort.down : false;
    this.sort = { column, down };
    this.heads.forEach((head, index) => head.setAttribute("aria-sort",
      COLUMNS[index][0] === column ? (down ? "descending" : "ascending") : "none"));
    this.update();
  }

  /** The points in the order shown. */
  get order() {
    const points = this.app.points();
    const column = COLUMNS.find(([key]) => key === this.sort.column);
    if (!column) return points;
    return [...points].sort((a, b) => compare(column[1](a), column[1](b), this.sort.down));
  }

  /** Those whose flag warns, in the order shown. */
  get doubtful() {
    return this.order.filter(({ result }) => isWarning(result?.flag));
  }

  update() {
    const { doubtful, order } = this;
    setText(this.count, String(order.length));
    this.doubts.hidden = !doubtful.length;
    setText(this.doubts, t("list.doubtful", { count: doubtful.length }));
    keyedRows(this.body, order, { key: ({ name }) => name,
      signature: (item) => COLUMNS.map(([, value]) => value(item)).join("\t"),
      build: (item) => this.#row(item) });
    this.mark();
  }

  mark() {
    const { selected } = this.picker;
    if (this.marked?.dataset.key !== selected || !this.marked?.isConnected) {
      this.marked?.setAttribute("aria-selected", "false");
      this.marked = selected && [...this.body.children].find((row) => row.dataset.key === selected);
      this.marked?.setAttribute("aria-selected", "true");
      if (this.marked) this.#show(this.marked);
    }
  }

  /** Scroll the list, never the page, until a row is seen. */
  #show(row) {
    const { parentElement: box } = this.table;
    const head = this.table.tHead.offsetHeight;
    const above = row.offsetTop - head - box.scrollTop;
    const below = row.offsetTop + row.offsetHeight - box.scrollTop - box.clientHeight;
    if (above < 0) box.scrollTop += above;
    else if (below > 0) box.scrollTop += below;
  }

  #row(item) {
    const { name } = item;
    const cells = COLUMNS.map(([key, value]) => {
      if (key === "name") {
        return h("th", { scope: "row" }, h("button", { type: "button", class: "link",
          "aria-label": t("list.flyTo", { name }), title: name, onclick: () => this.#take(name) }, name));
      }
      const content = value(item);
      if (key in DIGITS) return h("td", { class: "number" }, number(content, DIGITS[key]));
      const text = key === "type" ? t(`type.${content}`) : content;
      return h("td", { class: key === "flag" && content !== "…" && isWarning(content) ? "warn" : "" }, text);
    });
    return h("tr", { "aria-selected": "false", onclick: ({ target }) => {
      if (target.tagName !== "BUTTON") this.picker.select(name);
    }, ondblclick: () => this.#take(name) }, cells);
  }

  #take(name) {
    this.app.flyTo(name);
  }

  /** Up and down go through the list; the rest is the page's own keys. */
  #key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    this.step(step);
    this.marked?.querySelector("button").focus();
  }

  /** The next or previous point of some, in the order shown. */
  step(by, order = this.order) {
    if (!order.length) return;
    const index = order.findIndex(({ name }) => name === this.picker.selected);
    const next = index < 0 ? (by > 0 ? 0 : order.length - 1) : (index + by + order.length) % order.length;
    this.#take(order[next].name);
  }
}
