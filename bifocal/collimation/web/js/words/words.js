/** The page's words, by key, in the language of the survey. */

export const LANGUAGES = { en: "English", it: "Italiano", de: "Deutsch" };

let words = {};

export async function load(language) {
  words = (await import(`./${language in LANGUAGES ? language : "en"}.js`)).default;
  document.documentElement.lang = language;
}

/** The word for a key, `{name}` replaced by its value. */
export function t(key, values = {}) {
  const text = words[key] ?? key;
  return text.replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);
}
