/** The first state, asked for while the page's scripts are still being read; null where that failed. */
export const ahead = fetch("api/state", { cache: "no-store", headers: { "X-Edition": "none" } })
  .then((answer) => (answer.ok ? answer.json() : null))
  .catch(() => null);
