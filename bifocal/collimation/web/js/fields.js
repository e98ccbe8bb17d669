/**
 * Fields that a person types into: a command is sent when the value has changed. What is refused
 * stays as it was typed, marked, until it is mended.
 */
import { decimal, h, parseNumber } from "./dom.js";
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
