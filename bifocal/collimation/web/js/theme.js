/** Light and dark: kept by the browser, dark where nobody chose. */
const SHELF = "bifocal-theme";

export function theme() {
  return document.documentElement.dataset.theme ?? "dark";
}

export function useTheme(name) {
  document.documentElement.dataset.theme = name;
  document.querySelector("meta[name=color-scheme]").content = name;
  localStorage.setItem(SHELF, name);
  window.dispatchEvent(new Event("theme"));
}

useTheme(localStorage.getItem(SHELF) === "light" ? "light" : "dark");
