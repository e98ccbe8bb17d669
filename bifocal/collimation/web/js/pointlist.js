/** All points: sorted by any column, named, found, deleted. */
import { h, html, number, render, repeat } from "./dom.js";
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
  constructor(app, picker) {
    Object.assign(this, { app, picker, sort: { column: null, down: false } });
    this.element = h("section", { class: "card list" });
  }

  #sortBy(column) {
    const down = this.sort.column === column ? !this.sort.down : false;
    this.sort = { column, down };
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
    const { doubtful, order, sort } = this;
    this.marked = this.picker.selected;
    const sorted = (key) => (key !== sort.column ? "none" : sort.down ? "descending" : "ascending");
    render(html`<div class="row between"><h2>${t("list.title")} <span class="count">${order.length}</span></h2><span class="row">
        <button type="button" class="quiet warn" data-testid="next-doubtful" title="${t("key.doubtful")} (Y)" ?hidden=${!doubtful.length}
          @click=${() => this.step(1, this.doubtful)}>${t("list.doubtful", { count: doubtful.length })}</button>
        <button type="button" class="quiet" data-testid="match" @click=${() => this.app.job("match")}>${t("pick.match")}</button>
        <a class="button quiet" href="download/points.dxf" download>DXF</a></span></div>
      ${this.app.jobBox("match")}
      <div class="scroll"><table class="grid points" data-testid="point-list" @keydown=${(event) => this.#key(event)}>
        <caption class="unseen">${t("list.title")}</caption>
        <thead><tr>${COLUMNS.map(([key]) => html`<th scope="col" aria-sort=${sorted(key)}><button type="button" class="sort"
          @click=${() => this.#sortBy(key)}>${t(`list.${key}`)}</button></th>`)}</tr></thead>
        <tbody>${repeat(order, ({ name }) => name, (item) => this.#row(item))}</tbody></table></div>`, this.element);
  }

  /** Mark the point in hand, and scroll to it. */
  mark() {
    if (this.marked === this.picker.selected) return;
    this.update();
    if (this.row) this.#show(this.row);
  }

  get row() {
    return this.element.querySelector("tr[aria-selected=true]");
  }

  /** Scroll the list, never the page, until a row is seen. */
  #show(row) {
    const table = row.closest("table");
    const { parentElement: box } = table;
    const head = table.tHead.offsetHeight;
    const above = row.offsetTop - head - box.scrollTop;
    const below = row.offsetTop + row.offsetHeight - box.scrollTop - box.clientHeight;
    if (above < 0) box.scrollTop += above;
    else if (below > 0) box.scrollTop += below;
  }

  #row(item) {
    const { name } = item;
    const cells = COLUMNS.slice(1).map(([key, value]) => {
      const content = value(item);
      if (key in DIGITS) return html`<td class="number">${number(content, DIGITS[key])}</td>`;
      if (key === "type") return html`<td>${t(`type.${content}`)}</td>`;
      return html`<td class=${content !== "…" && isWarning(content) ? "warn" : ""}>${content}</td>`;
    });
    return html`<tr data-key=${name} aria-selected=${name === this.picker.selected} @dblclick=${() => this.#take(name)}
      @click=${({ target }) => { if (target.tagName !== "BUTTON") this.picker.select(name); }}>
      <th scope="row"><button type="button" class="link" aria-label=${t("list.flyTo", { name })} title=${name}
        @click=${() => this.#take(name)}>${name}</button></th>${cells}</tr>`;
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
    this.row?.querySelector("button").focus();
  }

  /** The next or previous point of some, in the order shown. */
  step(by, order = this.order) {
    if (!order.length) return;
    const index = order.findIndex(({ name }) => name === this.picker.selected);
    const next = index < 0 ? (by > 0 ? 0 : order.length - 1) : (index + by + order.length) % order.length;
    this.#take(order[next].name);
  }
}
