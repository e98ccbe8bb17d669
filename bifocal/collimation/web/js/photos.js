/** Stage 1: photos dropped; what their files do not tell is asked in words. */
import { Alone } from "./alone.js";
import { h, html, nothing, number, render, repeat } from "./dom.js";
import { named, numberField } from "./fields.js";
import { mediaWords } from "./media.js";
import { photoMark } from "./tiles.js";
import { t } from "./words/words.js";

const SITE = [["d1", "m"], ["sigma_d1", "m"], ["d2", "m"], ["sigma_d2", "m"]];
/** What lies between cameras and wall; all empty in air. */
const MEDIA = [["water_index", null], ["sigma_water_index", null], ["glass_index", null],
  ["glass_thickness", "m"], ["port", "m"], ["depth", "m"]];
const THUMB_LEVEL = 9;
// What photocore.images reads.
const PHOTOS = "image/*,.heic,.heif,.hif,.avif,.3fr,.arw,.cr2,.cr3,.crw,.dcr,.dng,.erf,.fff,.iiq,.kdc,.mef,.mos,.mrw,.nef,"
  + ".nrw,.orf,.pef,.raf,.raw,.rw2,.rwl,.sr2,.srf,.srw,.x3f";

export class PhotosStage {
  constructor(app) {
    Object.assign(this, { app, thumbs: {}, walls: [], surveys: [], over: false, busy: false, beginning: false });
    this.actions = { choose: () => this.#input.click() };
    this.alone = new Alone(app);
    this.exchangePlace = h("div", { class: "row" });
    this.element = h("div", { class: "stage photos", id: "stage-photos" });
    this.#listen();
  }

  get #input() {
    return this.element.querySelector("#photo-files");
  }

  /** Paint with what has changed here. */
  #paint(changes = {}) {
    Object.assign(this, changes);
    const { photos, others } = this.app.state;
    const look = [this.over && "over", this.busy && "busy", photos.length && "small", photos.length === 2 && "further"].filter(Boolean);
    render(html`<div class="drop-zone ${look.join(" ")}"><div class="drop-icon" aria-hidden="true"></div>
        <p class="lead">${t(["photos.drop", "photos.dropSecond", "photos.dropMore"][photos.length])}</p><p class="hint">${t("photos.dropHint")}</p>
        <label for="photo-files" class="button primary">${t("photos.choose")}</label><input type="file" accept=${PHOTOS} multiple class="unseen"
          id="photo-files" data-testid="photo-files" @change=${({ target }) => this.#drop([...target.files])}></div>
      ${photos.length ? "" : this.#start()}
      <div class="cards">${photos.map((photo) => this.#card(photo))}</div>${this.exchangePlace}
      <div class="cards" data-testid="other-photos">${repeat(others, ({ image }) => image, (photo) => this.#other(photo))}</div>
      ${this.app.jobBox("join")}${this.alone.element}${photos.length === 2 ? this.#site(this.app.state) : ""}`, this.element);
  }

  #start() {
    return html`<section class="beginning ${this.beginning ? "busy" : ""}">
      <div class="card walls" ?hidden=${!this.walls.length}><h2>${t("start.project")}</h2><p class="hint">${t("start.projectHint")}</p>
        ${this.walls.map(({ number: wall, words, picture }) => html`<button type="button" data-testid="wall-${wall}"
          @click=${() => this.#begin("api/walls", { number: wall })}><img src=${picture} alt="">${words}</button>`)}</div>
      <div class="card"><h2>${t("start.sample")}</h2><p class="hint">${t("start.sampleHint")}</p><div class="row"><button type="button"
        data-testid="sample" @click=${() => this.#begin("api/sample", {})}>${t("start.try")}</button></div></div>
      <div class="card checklist"><h2>${t("start.bring")}</h2><ul>${[1, 2, 3, 4, 5, 6].map((index) => html`<li>${t(`start.bring.${index}`)}</li>`)}</ul>
        <div class="row"><button type="button" class="quiet" data-testid="print" @click=${() => window.print()}>${t("start.print")}</button></div></div>
      <div class="card"><h2>${t("start.recent")}</h2><ul class="recent">${this.surveys.map(({ number: survey, name, folder }) => html`<li><button
        type="button" class="link" @click=${() => this.#open(survey)}>${folder} / ${name}</button></li>`)}${
        this.surveys.length ? "" : html`<li class="hint">${t("start.none")}</li>`}</ul></div></section>`;
  }

  #card(photo) {
    const { image, name, width, height, camera, focal_said: said, missing } = photo;
    const role = t(image === 1 ? "photo.far" : "photo.near");
    const field = (words, key) => named(t(words), `${key}-${image}`, numberField({ id: `${key}-${image}`, value: photo[key], subject: name,
      save: (value) => this.app.send("photo.set", { image, [key]: value }) }), "mm");
    return html`<section class="card photo ${this.app.state.photos.length === 1 ? "bare" : ""}"><h2 class="ink-${image}">${image} · ${role}</h2>
      <img alt=${t("photo.alt", { role })} src=${this.#thumb(image, photoMark(this.app.state))}><div class="card-body"><p class="file">${name}</p>
        <p class="hint">${[`${width} × ${height} px`, camera].filter(Boolean).join(" · ")}</p>
        <div class="fields">${field("photo.focal", "focal_mm")}${field("photo.sensor", "sensor_width_mm")}</div>
        <p class="hint" data-testid="focal-said-${image}">${said}</p>
        <ul class="questions">${/* An oriented pair knows its cameras. */ this.app.state.pair ? "" : missing.map((text) => html`<li>${text}</li>`)}</ul></div></section>`;
  }

  /** A photo beside far and near: it joins their orientation. */
  #other({ image, name, width, height, joined, distance }) {
    return html`<section class="card photo"><h2>${image} · ${t("photo.further")}</h2>
      <img alt=${t("photo.alt", { role: name })} src=${this.#thumb(image, name)}><div class="card-body"><p class="file">${name}</p>
        <p class="hint">${width} × ${height} px</p>
        <p class=${joined ? "good" : "hint"}>${t(joined ? "photo.joined" : "photo.joins", { distance: number(distance, 2) })}</p>
        <div class="row"><button type="button" class="quiet" aria-label="${t("photo.takeAway")}: ${name}"
          @click=${() => this.#takeAway(image)}>${t("photo.takeAway")}</button></div></div></section>`;
  }

  /** Most walls stand in air, and one length is enough: what is folded is opened where there is something. */
  #site({ pair, setup }) {
    const media = pair?.images.map((image) => image.media) ?? [];
    const filled = (names) => names.some(([key]) => (setup?.[key] ?? null) !== null);
    this.measured ||= filled(SITE);
    this.wet ||= Boolean(media[0]) || filled(MEDIA);
    const through = media[0] && t("photos.through", { media: mediaWords(media[0]), far: number(media[0].z0, 3), near: number(media[1].z0, 3) });
    const fields = (names) => html`<div class="fields">${names.map(([key, unit]) => named(t(`setup.${key}`), `setup-${key}`, numberField({
      id: `setup-${key}`, value: setup?.[key], save: (value) => this.app.send("setup.set", { [key]: value }) }), unit))}</div>`;
    return html`<details class="card site" data-testid="site" ?open=${this.measured}><summary><h2>${t("photos.site")}</h2></summary>
        <p class="hint">${t("photos.siteHint")}</p>${fields(SITE)}</details>
      <details class="card site" data-testid="media" ?open=${this.wet}><summary><h2>${t("photos.media")}</h2></summary>
        <p data-testid="pair-media" ?hidden=${!through}>${through}</p><p class="hint">${t("photos.mediaHint")}</p>${fields(MEDIA)}</details>`;
  }

  /** The address of a photo's small picture; nothing until the server has told of its tiles. */
  #thumb(image, mark) {
    const key = `${image} ${mark}`;
    if (!(key in this.thumbs)) {
      this.thumbs[key] = nothing;
      this.app.pyramids.info("photo", image, mark).then(({ version, max_level: most }) => {
        this.thumbs[key] = `tiles/photo/${image}/${Math.min(THUMB_LEVEL, most)}/0_0.jpg?v=${version}`;
        this.#paint();
      }).catch((error) => this.app.refuse(error));
    }
    return this.thumbs[key];
  }

  #listen() {
    const stop = (event) => event.preventDefault();
    for (const type of ["dragover", "drop"]) window.addEventListener(type, stop);
    window.addEventListener("dragenter", () => this.#paint({ over: true }));
    window.addEventListener("dragleave", ({ relatedTarget }) => {
      if (!relatedTarget) this.#paint({ over: false });
    });
    window.addEventListener("drop", ({ dataTransfer }) => {
      this.#paint({ over: false });
      if (dataTransfer.files.length) this.#drop([...dataTransfer.files]);
    });
    window.addEventListener("paste", ({ clipboardData }) => {
      if (clipboardData?.files.length) this.#drop([...clipboardData.files]);
    });
  }

  /** Begin with what the server has: the sample, or a wall of a project. */
  async #begin(route, body) {
    this.#paint({ beginning: true });
    try {
      await this.app.connection.ask(route, body);
      await this.app.connection.refresh();
      this.app.open(this.app.state.pair?.accepted ? "points" : "orientation");
    } catch (error) {
      this.app.refuse(error);
    }
    this.#paint({ beginning: false });
  }

  /** Walls of another program's project that lies in the folder, and surveys that were open before. */
  async #look() {
    const { connection } = this.app;
    const [{ walls }, { surveys }] = await Promise.all([connection.get("api/walls").catch(() => ({ walls: [] })),
      connection.get("api/recent").catch(() => ({ surveys: [] }))]);
    this.#paint({ walls, surveys });
  }

  /** Another page opens beside this one. */
  async #open(survey) {
    try {
      const { url } = await this.app.connection.ask("api/recent", { number: survey });
      window.location.assign(url);
    } catch (error) {
      this.app.refuse(error);
    }
  }

  async #drop(files) {
    this.app.open("photos");
    this.#paint({ busy: true });
    this.app.say(t("photos.reading"));
    try {
      await this.app.connection.upload(files);
      this.app.say(t(this.app.state.photos.length < 2 ? "photos.one" : "photos.read"));
    } catch (error) {
      this.app.refuse(error);
    }
    this.#paint({ busy: false });
    this.#input.value = "";
  }

  update(state) {
    if (!state.photos.length && !this.looked) {
      this.looked = true;
      this.#look();
    }
    this.alone.update(state);
    this.#paint();
  }

  async #takeAway(image) {
    try {
      await this.app.connection.remove(`api/photos/${image}`);
      await this.app.connection.refresh();
    } catch (error) {
      this.app.refuse(error);
    }
  }
}
