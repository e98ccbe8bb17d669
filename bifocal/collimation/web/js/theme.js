/** Light and dark: kept by the browser where somebody chose, else as the system's. */
const SHELF = "bifocal-theme";

export function theme() {
  return document.documentElement.dataset.theme ?? "dark";
}

const system = window.matchMedia("(prefers-color-scheme: light)");

function show(name) {
  document.documentElement.dataset.theme = name;
  document.querySelector("meta[name=color-scheme]").content = name;
  window.dispatchEvent(new Event("theme"));
}

export function useTheme(name) {
  localStorage.setItem(SHELF, name);
  show(name);
}

const follow = () => show(localStorage.getItem(SHELF) ?? (system.matches ? "light" : "dark"));
system.addEventListener("change", follow);
follow();
