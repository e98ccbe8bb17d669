/**
 * Markup and numbers. A view is a template of lit-html, rendered anew whenever something changes: only
 * what differs is touched, so focus and typed text stay. Nothing a user types is ever parsed as HTML.
 */
export { Directive, directive, html, live, noChange, nothing, render, repeat, svg } from "./vendor/lit-html.js";
export { decimal, number, parseNumber } from "./numbers.js";

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
