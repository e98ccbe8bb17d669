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
