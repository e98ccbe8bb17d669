/** The page: its four stages, what they share, and what outsiders may ask of it. */
import { Connection, Refusal } from "./connection.js";
import { h, html, render } from "./dom.js";
import { draggable } from "./dragging.js";
import { button, select } from "./fields.js";
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
    this.exchangeButton = button(`⇄ ${t("photos.exchange")}`, () => this.exchange(), { class: "quiet", testid: "exchange" });
    this.toast = h("div", { class: "toast", role: "status", "aria-live": "polite", testid: "toast" });
    document.body.replaceChildren();
    const stage = location.hash.slice(1);
    this.open(stage in STAGES ? stage : this.state.stage, false);
    history.replaceState({ stage: this.current }, "", `#${this.current}`);
    window.addEventListener("popstate", ({ state }) => state?.stage && this.open(state.stage, true, false));
    window.addEventListener("theme", () => this.paint());
    listen(this);
  }

  /** The page's frame: the stages, the next step, whether the server is there and everything written. */
  paint() {
    const { state, step } = this;
    const shade = theme() === "light" ? "dark" : "light";
    const tool = (key, sign, able, act, hint = "") => html`<button type="button" class="icon" data-testid=${key.split(".")[1]} aria-label=${t(key)}
      title="${t(key)}${hint}" ?disabled=${!able} @click=${act}>${sign}</button>`;
    render(html`<a class="skip" href="#stage">${t("top.skip")}</a><header class="top"><h1>bifocal</h1>
        <nav role="tablist" aria-label=${t("top.stages")} @keydown=${(event) => this.#key(event)}>${Object.keys(STAGES).map((key, index) => this.#tab(key, index))}</nav>
        <div class="tools">${this.#link()}
          <button type="button" class="primary next-step" data-testid="next" ?disabled=${!step.ready} @click=${() => this.next()}>${t(`next.${step.action}`)}</button>
          ${tool("top.undo", "↶", state.undo, () => this.undo(), " (Ctrl+Z)")}${tool("top.redo", "↷", state.redo, () => this.redo(), " (Ctrl+Y)")}
          <button type="button" class="icon" data-testid="theme" aria-label=${t(`top.theme.${shade}`)} title=${t(`top.theme.${shade}`)}
            @click=${() => useTheme(shade)}>◐</button>
          ${select({ label: t("top.language"), options: LANGUAGES, value: document.documentElement.lang, testid: "language",
            save: (code) => this.send("language.set", { language: code }) })}${tool("top.help", "?", true, () => this.help())}</div></header>
      <main id="stage" tabindex="-1">${Object.values(this.stages).map(({ element }) => element)}</main>${this.toast}`, document.body);
  }

  #tab(key, index) {
    const { status, count, done } = this.state.steps[key];
    const text = t(`status.${status}`, { count });
    const shown = key === this.current;
    return html`<button type="button" role="tab" id="tab-${key}" data-testid="mode-${key}" aria-controls="stage-${key}" aria-selected=${shown}
      tabindex=${shown ? 0 : -1} class=${done ? "done" : ""} title=${text} @click=${() => this.open(key)}><span class="step" aria-hidden="true">${index + 1}</span>
      <span class="words"><span class="name">${t(`stage.${key}`)}</span><span class="missing">${text}</span></span></button>`;
  }

  #key(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    event.preventDefault();
    this.turn(by);
    document.getElementById(`tab-${this.current}`).focus();
  }

  #link() {
    const { online, locked, unsent } = this.connection;
    const { workbook_waiting: waiting } = this.state;
    const key = locked ? "link.locked" : !online ? "link.away" : unsent.length ? "link.sending" : waiting ? "link.waiting" : "link.saved";
    const words = t(key, { count: unsent.length });
    return html`<p class="link-state" role="status" data-testid="link" title=${waiting ?? words}
      data-level=${locked || !online ? "warn" : waiting || unsent.length ? "fair" : "good"}>${words}</p>`;
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
    this.exchangeButton.hidden = state.photos.length < 2;
    this.paint();
    this.stage.update(state);
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
    const job = this.state.jobs.findLast((one) => one.kind === kind);
    // What the program tries by itself, and failures that were mended, are nobody's concern.
    if (!job || job.quiet || job.cured) return "";
    const running = job.state === "running";
    const doing = running ? `${Math.round(100 * (job.progress ?? 0))} %` : t(`job.state.${job.state}`);
    const long = job.state === "done" && job.message;
    const cancel = () => this.connection.remove(`api/jobs/${job.id}`).catch((error) => this.refuse(error));
    return html`<div class="job" data-testid="job-${kind}" data-state=${job.state}><div class="row" ?hidden=${!running}>
        <progress max="1" aria-label=${t(`job.${kind}`)} .value=${job.progress ?? 0}></progress>
        <button type="button" class="quiet" data-testid="cancel-${kind}" @click=${cancel}>${t("job.cancel")}</button></div>
      <p class="hint" role="status">${[doing, long ? "" : job.message].filter(Boolean).join(" · ")}</p>
      <details ?hidden=${!long}><summary>${t("job.remarks")}</summary><p class="hint">${long || ""}</p></details></div>`;
  }

  say(text, level = "info") {
    this.toast.dataset.level = level;
    this.toast.classList.add("on");
    this.toast.textContent = text;
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
        fault.textContent = error.message;
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
  connection.addEventListener("reach", () => app.paint());
  connection.addEventListener("refused", ({ detail }) => app.refuse(detail));
  window.bifocal = outside(app);
}

start();
