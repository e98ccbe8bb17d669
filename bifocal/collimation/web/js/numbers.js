/** Numbers as people write them. */

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
