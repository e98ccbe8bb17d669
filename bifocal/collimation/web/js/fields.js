/**
 * Fields that a person types into: a command is sent when the value has changed. What is refused
 * stays as it was typed, marked, until it is mended.
 */
import { decimal, Directive, directive, h, html, live, noChange, nothing, parseNumber } from "./dom.js";
import { t } from "./words/words.js";

/** What was refused is forgotten. */
function afresh(input) {
  input.setCustomValidity("");
  delete input.dataset.sent;
}

/**
 * The value of a field, unless somebody types in it, it waits for the answer, or has to be mended;
 * `noChange` leaves it alone. What was refused for one `subject` is not another's.
 */
const filled = directive(class extends Directive {
  update({ element: input }, [value, subject]) {
    if (subject !== this.subject) afresh(input);
    this.subject = subject;
    if (value === noChange) return value;
    const text = typeof value === "number" ? decimal(String(value)) : value ?? "";
    const free = document.activeElement !== input && !input.dataset.sent && input.validity.valid;
    if (free && input.value !== text) input.value = text;
    input.dataset.known = text;
    return noChange;
  }
});

/** Send what was typed; `save(value, input)` resolves to false where it was refused. */
async function changed({ target: input }, numeric, save) {
  const typed = input.value;
  const value = numeric ? parseNumber(typed) : typed.trim();
  input.setCustomValidity(Number.isNaN(value) ? t("field.number") : "");
  if (!input.reportValidity() || typed.trim() === input.dataset.known) return;
  // News of others that come before the answer do not take it away.
  input.dataset.sent = "true";
  const accepted = await save(value, input);
  delete input.dataset.sent;
  if (accepted === false && input.value === typed) input.setCustomValidity(t("field.refused"));
}

const field = (numeric) => ({ value, save = () => {}, subject, id, label, size, testid, placeholder, hidden = false }) => html`<input
  type="text" inputmode=${numeric ? "decimal" : "text"} autocomplete="off" ${filled(value, subject)} id=${id ?? nothing}
  aria-label=${label ?? nothing} size=${size ?? nothing} data-testid=${testid ?? nothing} placeholder=${placeholder ?? nothing} ?hidden=${hidden}
  @change=${(event) => changed(event, numeric, save)} @input=${({ target }) => afresh(target)}>`;

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

/** A button outside a template. */
export function button(text, onclick, attributes = {}) {
  return h("button", { type: "button", onclick, ...attributes }, text);
}
