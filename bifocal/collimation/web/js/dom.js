/**
 * Markup and numbers. A view is a template of lit-html, rendered anew whenever something changes: only
 * what differs is touched, so focus and typed text stay. Nothing a user types is ever parsed as HTML.
 */
export { Directive, directive, html, live, noChange, nothing, render, repeat, svg } from "./vendor/lit-html.js";

/** `h("button", {class: "quiet", onclick: f, testid: "pick"}, "Pick")` */
export function h(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key === "testid") node.dataset.testid = value;
    else if (key === "value" || key === "checked") node[key] = value;
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
}

/** Write text only where it differs: no layout, no announcement for nothing. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** The digits of a number as the page's language writes them. */
export function decimal(digits) {
  return ["it", "de"].includes(document.documentElement.lang) ? digits.replace(".", ",") : digits;
}

/** A number for people: `digits` after the point, "–" where there is none. */
export function number(value, digits) {
  return Number.isFinite(value) ? decimal(value.toFixed(digits).replace(/^-(?=0\.?0*$)/, "")) : "–";
}

/** What a person typed as a number, comma or point; null when empty, NaN when it is none. */
export function parseNumber(text) {
  const tidy = text.trim().replace("−", "-");
  if (tidy === "") return null;
  const value = Number(/^-?\d*,\d+$/.test(tidy) ? tidy.replace(",", ".") : tidy);
  return Number.isFinite(value) ? value : NaN;
}

/** Keep keyed rows of a table body: rebuild only those whose signature changed, in the new order. */
export function keyedRows(body, items, { key, signature, build }) {
  const old = new Map([...body.children].map((row) => [row.dataset.key, row]));
  let place = body.firstElementChild;
  for (const item of items) {
    const name = key(item);
    const mark = signature(item);
    let row = old.get(name);
    // A row somebody types in, waits for an answer to, or has still to mend, stays as it is, and
    // keeps its old mark, so that its turn comes later.
    if (row?.querySelector("input:focus, select:focus, input:invalid, input[data-sent]")) {
      old.delete(name);
      if (row === place) place = place.nextElementSibling;
      else body.insertBefore(row, place);
      continue;
    }
    if (row && row.dataset.mark !== mark) {
      const fresh = build(item);
      if (place === row) place = fresh;
      const focused = row.contains(document.activeElement);
      row.replaceWith(fresh);
      if (focused) fresh.querySelector("button, input, select")?.focus();
      row = fresh;
    }
    old.delete(name);
    row ??= build(item);
    row.dataset.key = name;
    row.dataset.mark = mark;
    if (row === place) place = place.nextElementSibling;
    else body.insertBefore(row, place);
  }
  for (const row of old.values()) row.remove();
}
