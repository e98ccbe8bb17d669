/**
 * Where commands wait until the server has answered them. A shelf outlives its tab: the next one on
 * the same survey, which the page's path names, takes over what lies there.
 */
const PREFIX = `bifocal-unsent:${location.pathname}:`;

export class Shelf {
  constructor() {
    this.name = PREFIX + crypto.randomUUID();
    navigator.locks.request(this.name, () => new Promise(() => {})); // held as long as the tab lives
  }

  put(commands) {
    if (commands.length) localStorage.setItem(this.name, JSON.stringify(commands));
    else localStorage.removeItem(this.name);
  }

  /** Hand over what lies on the shelves of other tabs, each as soon as its tab is gone. */
  inherit(take) {
    const names = Object.keys(localStorage).filter((name) => name.startsWith(PREFIX) && name !== this.name);
    for (const name of names) {
      navigator.locks.request(name, () => {
        take(JSON.parse(localStorage.getItem(name) ?? "[]"));
        localStorage.removeItem(name);
      });
    }
  }
}
