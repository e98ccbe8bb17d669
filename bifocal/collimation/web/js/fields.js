/**
 * Fields that a person types into: a command is sent when the value has changed. What is refused
 * stays as it was typed, marked, until it is mended.
 */
import { decimal, Directive, directive, h, html, live, noChange, nothing, parseNumber } from "./dom.js";
import { t } from "./words/words.js";

let count = 0;

/** Write a value into a field unless somebody types in it, waits for the answer, or has to mend it. */
export function fill(input, value) {
  const text = value === null || value === undefined ? "" : typeof value === "number" ? decimal(String(value)) : String(value);
  const free = document.activeElement !== input && !input.dataset.sent && input.validity.valid;
  if (free && input.value !== text) input.value = text;
  input.dataset.known = text;
}

/** Let fields show something else than they did: what was refused is forgotten. */
export function afresh(inputs) {
  for (const input of inputs) {
    input.setCustomValidity("");
    delete input.dataset.sent;
  }
}

/** Send what was typed; `save` resolves to false where it was refused. */
async function hand(input, value, save) {
  const typed = input.value;
  // News of others that come before the answer do not take it away.
  input.dataset.sent = "true";
  const accepted = await save(value);
  delete input.dataset.sent;
  if (accepted === false && input.value === typed) input.setCustomValidity(t("field.refused"));
}

/** A number field: `save(number or null)`; refuses what is no number, in words. */
export function numberInput({ save, label, ...attributes }) {
  const input = h("input", { type: "text", inputmode: "decimal", autocomplete: "off",
    "aria-label": label, ...attributes });
  input.addEventListener("change", () => {
    const value = parseNumber(input.value);
    input.setCustomValidity(Number.isNaN(value) ? t("field.number") : "");
    if (!input.reportValidity()) return;
    if (input.value !== input.dataset.known) hand(input, value, save);
  });
  input.addEventListener("input", () => afresh([input]));
  return input;
}

export function textInput({ save, label, ...attributes }) {
  const input = h("input", { type: "text", autocomplete: "off", "aria-label": label, ...attributes });
  input.addEventListener("change", () => {
    const value = input.value.trim();
    if (value !== input.dataset.known) hand(input, value, save);
  });
  input.addEventListener("input", () => afresh([input]));
  return input;
}

/** A field under its visible label, with its unit. */
export function labelled(text, input, unit = null) {
  input.id ||= `field-${count++}`;
  input.removeAttribute("aria-label");
  const mark = unit ? h("span", { class: "unit" }, unit) : null;
  return h("div", { class: "field" }, h("label", { for: input.id }, text),
    h("span", { class: "with-unit" }, input, mark));
}

export function choice({ label, options, value, save, ...attributes }) {
  const select = h("select", { "aria-label": label, ...attributes,
    onchange: () => save(select.value) },
  Object.entries(options).map(([key, text]) => h("option", { value: key }, text)));
  if (value !== undefined) select.value = value;
  return select;
}

export function button(text, onclick, attributes = {}) {
  return h("button", { type: "button", onclick, ...attributes }, text);
}

const filled = directive(class extends Directive {
  update({ element }, [value, subject]) {
    // What was refused for one is not another's.
    if (subject !== this.subject) afresh([element]);
    this.subject = subject;
    if (value !== noChange) fill(element, value);
    return noChange;
  }
});

function changed({ target: input }, numeric, save) {
  const value = numeric ? parseNumber(input.value) : input.value.trim();
  input.setCustomValidity(Number.isNaN(value) ? t("field.number") : "");
  if (input.reportValidity() && input.value.trim() !== input.dataset.known) hand(input, value, save);
}

const field = (numeric) => ({ value, save = () => {}, subject, id, label, size, testid, placeholder, hidden = false }) => html`<input
  type="text" inputmode=${numeric ? "decimal" : "text"} autocomplete="off" ${filled(value, subject)} id=${id ?? nothing}
  aria-label=${label ?? nothing} size=${size ?? nothing} data-testid=${testid ?? nothing} placeholder=${placeholder ?? nothing} ?hidden=${hidden}
  @change=${(event) => changed(event, numeric, save)} @input=${({ target }) => afresh([target])}>`;

/** Fields for a text and for a number, `save(number or null)`; `subject`: whose value it is. */
export const textField = field(false);
export const numberField = field(true);

/** A field of an id under its visible label, with its unit. */
export const named = (text, id, input, unit = "") => html`<div class="field"><label for=${id}>${text}</label><span
  class="with-unit">${input}${unit ? html`<span class="unit">${unit}</span>` : ""}</span></div>`;

/** One of some: `options` are their words by key. */
export const select = ({ options, value, save, id, label, testid }) => html`<select id=${id ?? nothing} aria-label=${label ?? nothing}
  data-testid=${testid ?? nothing} @change=${({ target }) => save(target.value)}>${Object.entries(options).map(([key, text]) => html`<option
  value=${key} .selected=${live(key === value)}>${text}</option>`)}</select>`;

/** What deletes a row. */
export const cross = (name, onclick) => html`<button type="button" class="icon" aria-label=${t("list.deleteOf", { name })} @click=${onclick}>×</button>`;
