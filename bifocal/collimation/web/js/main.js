/** The page: its four stages, what they share, and what outsiders may ask of it. */
import { Connection, Refusal } from "./connection.js";
import { h, setText } from "./dom.js";
import { draggable } from "./dragging.js";
import { button, choice } from "./fields.js";
import { KEYS, listen } from "./keys.js";
import { OrientationStage } from "./orientation.js";
import { PhotosStage } from "./photos.js";
import { PointsStage } from "./points.js";
import { ProductsStage } from "./products.js";
import { theme, useTheme } from "./theme.js";
import { Pyramids } from "./tiles.js";
import { LANGUAGES, load, t } from "./words/words.js";

const STAGES = {
  photos: PhotosStage, orientation: OrientationStage, points: PointsStage, products: ProductsStage,
};
const TOAST_MS = 6000;

class App {
  constructor(connection) {
    this.connection = connection;
    this.pyramids = new Pyramids(connection);
    this.boxes = [];
    /** Send a command; false where it was refused, which is said. */
    this.send = (op, args) => connection.send(op, args).then(() => true, (error) => this.refuse(error));
  }

  get state() {
    return this.connection.state;
  }

  /** The points that are not deleted. */
  points() {
    return this.state.points.filter(({ deleted }) => !deleted);
  }

  build() {
    this.stages = Object.fromEntries(Object.entries(STAGES).map(([key, Stage]) => [key, new Stage(this)]));
    this.tabs = Object.fromEntries(Object.keys(STAGES).map((key, index) => [key, this.#tab(key, index)]));
    this.title = h("h1", {}, "bifocal");
    this.undoButton = button("↶", () => this.undo(), { class: "icon", testid: "undo", "aria-label": t("top.undo"), title: `${t("top.undo")} (Ctrl+Z)` });
    this.redoButton = button("↷", () => this.redo(), { class: "icon", testid: "redo", "aria-label": t("top.redo"), title: `${t("top.redo")} (Ctrl+Y)` });
    this.exchangeButton = button(`⇄ ${t("photos.exchange")}`, () => this.exchange(), { class: "quiet", testid: "exchange" });
    this.nextButton = button("", () => this.next(), { class: "primary next-step", testid: "next" });
    this.themeButton = button("◐", () => { useTheme(theme() === "light" ? "dark" : "light"); this.#tellTheme(); },
      { class: "icon", testid: "theme" });
    this.#tellTheme();
    this.link = h("p", { class: "link-state", role: "status", testid: "link" });
    const language = choice({ label: t("top.language"), options: LANGUAGES, value: document.documentElement.lang,
      testid: "language", save: (code) => this.send("language.set", { language: code }) });
    this.toast = h("div", { class: "toast", role: "status", "aria-live": "polite", testid: "toast" });
    document.body.replaceChildren(
      h("a", { class: "skip", href: "#stage" }, t("top.skip")),
      h("header", { class: "top" }, this.title,
        h("nav", { role: "tablist", "aria-label": t("top.stages") }, Object.values(this.tabs)),
        h("div", { class: "tools" }, this.link, this.nextButton, this.undoButton, this.redoButton,
          this.themeButton, language,
          button("?", () => this.help(), { class: "icon", "aria-label": t("top.help"), testid: "help" }))),
      h("main", { id: "stage", tabindex: "-1" }, Object.values(this.stages).map(({ element }) => element)),
      this.toast);
    const wanted = location.hash.slice(1);
    this.open(wanted in STAGES ? wanted : this.state.stage, false);
    history.replaceState({ stage: this.current }, "", `#${this.current}`);
    window.addEventListener("popstate", ({ state }) => state?.stage && this.open(state.stage, true, false));
    listen(this);
  }

  #tellTheme() {
    const words = t(`top.theme.${theme() === "light" ? "dark" : "light"}`);
    this.themeButton.title = words;
    this.themeButton.setAttribute("aria-label", words);
  }

  #tab(key, index) {
    const status = h("span", { class: "missing" });
    const tab = h("button", { type: "button", role: "tab", id: `tab-${key}`, testid: `mode-${key}`,
      "aria-controls": `stage-${key}`, onclick: () => this.open(key) },
    h("span", { class: "step", "aria-hidden": "true" }, String(index + 1)),
    h("span", { class: "words" }, h("span", { class: "name" }, t(`stage.${key}`)), status));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!by) return;
      event.preventDefault();
      this.turn(by);
      this.tabs[this.current].focus();
    });
    tab.status = status;
    return tab;
  }

  /**
   * Show a stage; `tell` the survey, so that the next start opens there; `remember` it, so that the
   * browser's Back leads here.
   */
  open(key, tell = true, remember = tell) {
    if (remember && this.current !== key) history.pushState({ stage: key }, "", `#${key}`);
    this.current = key;
    for (const [name, stage] of Object.entries(this.stages)) {
      stage.element.hidden = name !== key;
      if (name === key) stage.exchangePlace?.append(this.exchangeButton);
      this.tabs[name].setAttribute("aria-selected", String(name === key));
      this.tabs[name].tabIndex = name === key ? 0 : -1;
      stage.element.setAttribute("role", "tabpanel");
      stage.element.setAttribute("aria-labelledby", `tab-${name}`);
    }
    if (tell && this.state.stage !== key) this.send("stage.set", { stage: key });
    this.update();
  }

  turn(by) {
    const keys = Object.keys(STAGES);
    const next = keys[keys.indexOf(this.current) + by];
    if (next) this.open(next);
  }

  get stage() {
    return this.stages[this.current];
  }

  /** The one step that comes next at the stage that is shown, as the server tells it. */
  get step() {
    return this.state.steps[this.current];
  }

  running(kind) {
    return this.state.jobs.some((job) => job.kind === kind && job.state === "running");
  }

  /** Take the next step: go to another stage, or what the stage that is shown does. */
  next() {
    const { action, ready } = this.step;
    if (!ready) return;
    if (action in STAGES) this.open(action);
    else this.stage.actions[action]();
  }

  update() {
    const { state } = this;
    document.title = `${state.title || t("title.untitled")} · bifocal`;
    for (const key of Object.keys(this.stages)) {
      const { status, count, done } = state.steps[key];
      const text = t(`status.${status}`, { count });
      setText(this.tabs[key].status, text);
      this.tabs[key].title = text;
      this.tabs[key].classList.toggle("done", Boolean(done));
    }
    this.undoButton.disabled = !state.undo;
    this.exchangeButton.hidden = state.photos.length < 2;
    this.redoButton.disabled = !state.redo;
    setText(this.nextButton, t(`next.${this.step.action}`));
    this.nextButton.disabled = !this.step.ready;
    for (const paint of this.boxes) paint(state);
    this.reach();
    this.stage.update(state);
  }

  /** Say whether the server is there and everything written. */
  reach() {
    const { online, locked, unsent } = this.connection;
    const { workbook_waiting: waiting } = this.state;
    const key = locked ? "link.locked" : !online ? "link.away" : unsent.length ? "link.sending" : waiting ? "link.waiting" : "link.saved";
    const words = t(key, { count: unsent.length });
    setText(this.link, words);
    this.link.title = waiting ?? words;
    this.link.dataset.level = locked || !online ? "warn" : waiting || unsent.length ? "fair" : "good";
  }

  /** Far and near the other way round: what is picked goes along, an orientation has to be made anew. */
  exchange() {
    const { pair } = this.state;
    const go = async () => {
      await this.connection.send("photos.exchange");
      if (!pair) return;
      this.open("orientation");
      this.say(t("photos.exchanged"));
    };
    if (!pair?.accepted) return go().catch((error) => this.refuse(error));
    return this.dialog(t("photos.exchange"), h("p", {}, t("photos.exchangeAsks")), t("dialog.exchange"), go);
  }

  undo() {
    if (this.state.undo || this.connection.unsent.length) this.send("undo");
  }

  redo() {
    if (this.state.redo) this.send("redo");
  }

  /** Enter: place at the keyboard's cursor, else accept what is proposed. */
  enter() {
    const { picker } = this.stage;
    const { cursor } = picker;
    if (cursor) (this.stage.click ? this.stage : picker).click(cursor.pane, cursor.place);
    else if (picker.proposal) picker.accept();
  }

  flyTo(name) {
    if (this.stage.flyTo?.(name)) return true;
    for (const key of ["points", "orientation"]) {
      if (key === this.current) continue;
      const known = key === "points" ? this.points() : this.state.control;
      if (!known.some((item) => item.name === name)) continue;
      this.open(key);
      requestAnimationFrame(() => this.stage.flyTo(name));
      return true;
    }
    return false;
  }

  /** Join a picker with the page: what it says is shown, what it changes is drawn. */
  listen(picker, changed, hovered) {
    picker.addEventListener("change", changed);
    picker.addEventListener("hover", hovered);
    picker.addEventListener("say", ({ detail }) => this.say(t(detail.key, detail.values)));
    picker.addEventListener("refused", ({ detail }) => this.refuse(detail));
  }

  /** Join a pane with a picker: clicks, the pointer. */
  follow(pane, picker, taker = picker) {
    pane.addEventListener("pick", ({ detail }) => taker.click(pane, detail.pixel));
    pane.addEventListener("hover", ({ detail }) => picker.hover(pane, detail.pixel));
    draggable(pane, { find: (place) => picker.markAt(pane, place),
      move: (image, place) => picker.drag(pane, image, place), drop: (image, place) => picker.drop(pane, image, place) });
  }

  async job(kind, options = {}) {
    // The server may have the workbook to write first: what was asked for is answered at once.
    this.say(t("job.started", { kind: t(`job.${kind}`) }));
    try {
      await this.connection.ask("api/jobs", { kind, options });
    } catch (error) {
      this.refuse(error);
    }
  }

  /** Progress of the latest job of a kind, with cancel. */
  jobBox(kind) {
    const bar = h("progress", { max: "1", "aria-label": t(`job.${kind}`) });
    const words = h("p", { class: "hint", role: "status" });
    const told = h("p", { class: "hint" });
    const fold = h("details", { hidden: true }, h("summary", {}, t("job.remarks")), told);
    const cancel = button(t("job.cancel"), () => {
      this.connection.remove(`api/jobs/${cancel.dataset.job}`).catch((error) => this.refuse(error));
    }, { class: "quiet", testid: `cancel-${kind}` });
    const box = h("div", { class: "job", hidden: true, testid: `job-${kind}` }, h("div", { class: "row" }, bar, cancel), words, fold);
    this.boxes.push((state) => {
      const job = state.jobs.filter((one) => one.kind === kind).at(-1);
      // What the program tries by itself, and failures that were mended, are nobody's concern.
      box.hidden = !job || job.quiet || job.cured;
      if (box.hidden) return;
      const running = job.state === "running";
      bar.value = job.state === "done" ? 1 : job.progress ?? 0;
      bar.hidden = cancel.hidden = !running;
      cancel.dataset.job = job.id;
      box.dataset.state = job.state;
      const percent = Math.round(100 * (job.progress ?? 0));
      const doing = running ? `${percent} %` : t(`job.state.${job.state}`);
      const long = job.state === "done" && Boolean(job.message);
      fold.hidden = !long;
      setText(told, long ? job.message : "");
      setText(words, [doing, long ? "" : job.message].filter(Boolean).join(" · "));
    });
    return box;
  }

  say(text, level = "info") {
    this.toast.dataset.level = level;
    this.toast.classList.add("on");
    setText(this.toast, text);
    clearTimeout(this.quiet);
    this.quiet = setTimeout(() => this.toast.classList.remove("on"), TOAST_MS);
  }

  refuse(error) {
    if (!(error instanceof Refusal)) console.error(error);
    this.say(error.message, "warning");
    return false;
  }

  /** `act` may throw a Refusal: it is told in the dialog, which stays open with what it holds. */
  dialog(title, content, action = null, act = null) {
    const fault = h("p", { class: "fault", role: "alert", hidden: true, testid: "dialog-fault" });
    const form = h("form", { method: "dialog" }, h("h2", {}, title), content, fault,
      h("div", { class: "row end" },
        h("button", { value: "", class: "quiet" }, action ? t("dialog.cancel") : t("dialog.close")),
        action && h("button", { value: "yes", class: "primary", testid: "dialog-yes" }, action)));
    const box = h("dialog", { "aria-label": title }, form);
    form.addEventListener("submit", async (event) => {
      if (event.submitter?.value !== "yes") return;
      event.preventDefault();
      try {
        await act();
        box.close();
      } catch (error) {
        setText(fault, error.message);
        fault.hidden = false;
      }
    });
    box.addEventListener("close", () => box.remove());
    document.body.append(box);
    box.showModal();
  }

  help() {
    const rows = KEYS.map(([name, shown]) => h("div", {}, h("dt", {}, shown.split("  ").map((key) => h("kbd", {}, key))),
      h("dd", {}, t(`key.${name}`))));
    this.dialog(t("help.title"), [h("p", { class: "hint" }, t("help.hint")), h("dl", { class: "keys" }, rows)]);
  }
}

/** Every pick of a point: `{name, image, column, row}`. */
function picksOf({ points }) {
  return points.flatMap(({ name, picks }) => [1, 2].filter((image) => picks[image])
    .map((image) => ({ name, image, column: picks[image][0], row: picks[image][1] })));
}

/** What `window.bifocal` offers: image 1 or 2, original photo pixels, CSS pixels of the page. */
function outside(app) {
  const box = (pane) => pane.ground.getBoundingClientRect();
  return {
    state: () => ({ ...app.state, stage: app.current, picks: picksOf(app.state) }),
    photoFromScreen(image, x, y) {
      const pane = app.stage.paneOf(image);
      const { left, top } = box(pane);
      return pane.photo(image, [x - left, y - top]);
    },
    screenFromPhoto(image, column, row) {
      const pane = app.stage.paneOf(image);
      const { left, top } = box(pane);
      const [x, y] = pane.screen(image, [column, row]);
      return [x + left, y + top];
    },
    flyTo: (name) => app.flyTo(name),
  };
}

async function start() {
  const connection = new Connection();
  await connection.start();
  const { language } = connection.state;
  await load(language);
  if (location.search) history.replaceState(null, "", `${location.pathname}${location.hash}`);
  const app = new App(connection);
  app.build();
  let waiting = 0;
  connection.addEventListener("state", () => {
    // Many answers in one frame are drawn once.
    waiting ||= requestAnimationFrame(() => {
      waiting = 0;
      if (connection.state.language === language) app.update();
      else if (!connection.unsent.length) location.reload();
    });
  });
  connection.addEventListener("reach", () => app.reach());
  connection.addEventListener("refused", ({ detail }) => app.refuse(detail));
  window.bifocal = outside(app);
}

start();
