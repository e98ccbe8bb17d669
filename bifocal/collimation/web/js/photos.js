/** Stage 1: photos dropped; what their files do not tell is asked in words. */
import { Alone } from "./alone.js";
import { h, keyedRows, number, setText } from "./dom.js";
import { afresh, button, fill, labelled, numberInput } from "./fields.js";
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
    this.app = app;
    this.cards = [1, 2].map((image) => this.#card(image));
    this.input = h("input", { type: "file", accept: PHOTOS, multiple: true, class: "unseen",
      id: "photo-files", testid: "photo-files", onchange: () => this.#drop([...this.input.files]) });
    this.lead = h("p", { class: "lead" }, t("photos.drop"));
    this.zone = h("div", { class: "drop-zone" },
      h("div", { class: "drop-icon", "aria-hidden": "true" }),
      this.lead,
      h("p", { class: "hint" }, t("photos.dropHint")),
      h("label", { for: "photo-files", class: "button primary" }, t("photos.choose")), this.input);
    this.site = Object.fromEntries([...SITE, ...MEDIA].map(([key]) => [key, numberInput({
      label: t(`setup.${key}`), save: (value) => app.send("setup.set", { [key]: value }) })]));
    const fields = (names) => h("div", { class: "fields" },
      names.map(([key, unit]) => labelled(t(`setup.${key}`), this.site[key], unit)));
    this.through = h("p", { testid: "pair-media" });
    // Most walls stand in air, and one length is enough: what is folded is opened where it is needed.
    this.form = h("details", { class: "card site", testid: "site" }, h("summary", {}, h("h2", {}, t("photos.site"))),
      h("p", { class: "hint" }, t("photos.siteHint")), fields(SITE));
    this.media = h("details", { class: "card site", testid: "media" },
      h("summary", {}, h("h2", {}, t("photos.media"))), this.through,
      h("p", { class: "hint" }, t("photos.mediaHint")), fields(MEDIA));
    this.recent = h("ul", { class: "recent" });
    this.walls = h("div", { class: "card walls", hidden: true });
    this.beginning = h("section", { class: "beginning" }, this.walls,
      h("div", { class: "card" }, h("h2", {}, t("start.sample")), h("p", { class: "hint" }, t("start.sampleHint")),
        h("div", { class: "row" }, button(t("start.try"), () => this.#begin("api/sample", {}), { testid: "sample" }))),
      h("div", { class: "card checklist" }, h("h2", {}, t("start.bring")),
        h("ul", {}, [1, 2, 3, 4, 5, 6].map((number) => h("li", {}, t(`start.bring.${number}`)))),
        h("div", { class: "row" }, button(t("start.print"), () => window.print(), { class: "quiet", testid: "print" }))),
      h("div", { class: "card" }, h("h2", {}, t("start.recent")), this.recent));
    this.actions = { choose: () => this.input.click() };
    this.alone = new Alone(app);
    this.exchangePlace = h("div", { class: "row" });
    this.others = h("div", { class: "cards", testid: "other-photos" });
    this.element = h("div", { class: "stage photos", id: "stage-photos" }, this.zone, this.beginning,
      h("div", { class: "cards" }, this.cards.map(({ element }) => element)), this.exchangePlace, this.others, app.jobBox("join"),
      this.alone.element, this.form, this.media);
    this.#listen();
  }

  #card(image) {
    const role = t(image === 1 ? "photo.far" : "photo.near");
    const card = { image, name: h("p", { class: "file" }), facts: h("p", { class: "hint" }), trust: h("p", { class: "hint", testid: `focal-said-${image}` }),
      thumb: h("img", { alt: t("photo.alt", { role }) }), questions: h("ul", { class: "questions" }) };
    const save = (key) => (value) => this.app.send("photo.set", { image, [key]: value });
    card.focal_mm = numberInput({ label: t("photo.focal"), save: save("focal_mm") });
    card.sensor_width_mm = numberInput({ label: t("photo.sensor"), save: save("sensor_width_mm") });
    card.element = h("section", { class: "card photo" },
      h("h2", { class: `ink-${image}` }, `${image} · ${role}`), card.thumb,
      h("div", { class: "card-body" }, card.name, card.facts, h("div", { class: "fields" },
        labelled(t("photo.focal"), card.focal_mm, "mm"),
        labelled(t("photo.sensor"), card.sensor_width_mm, "mm")), card.trust, card.questions));
    return card;
  }

  #listen() {
    const stop = (event) => event.preventDefault();
    for (const type of ["dragover", "drop"]) window.addEventListener(type, stop);
    window.addEventListener("dragenter", () => this.zone.classList.add("over"));
    window.addEventListener("dragleave", ({ relatedTarget }) => {
      if (!relatedTarget) this.zone.classList.remove("over");
    });
    window.addEventListener("drop", ({ dataTransfer }) => {
      this.zone.classList.remove("over");
      if (dataTransfer.files.length) this.#drop([...dataTransfer.files]);
    });
    window.addEventListener("paste", ({ clipboardData }) => {
      if (clipboardData?.files.length) this.#drop([...clipboardData.files]);
    });
  }

  /** Begin with what the server has: the sample, or a wall of a project. */
  async #begin(route, body) {
    this.beginning.classList.add("busy");
    try {
      await this.app.connection.ask(route, body);
      await this.app.connection.refresh();
      this.app.open(this.app.state.pair?.accepted ? "points" : "orientation");
    } catch (error) {
      this.app.refuse(error);
    }
    this.beginning.classList.remove("busy");
  }

  /** The walls of another program's project that lies in the folder. */
  async #tellWalls() {
    const { walls } = await this.app.connection.get("api/walls").catch(() => ({ walls: [] }));
    this.walls.hidden = !walls.length;
    this.walls.replaceChildren(h("h2", {}, t("start.project")), h("p", { class: "hint" }, t("start.projectHint")),
      ...walls.map(({ number: wall, words, picture }) => h("button", { type: "button", testid: `wall-${wall}`,
        onclick: () => this.#begin("api/walls", { number: wall }) }, h("img", { src: picture, alt: "" }), words)));
  }

  /** Surveys that were open before; another page opens beside this one. */
  async #tellRecent() {
    const { surveys } = await this.app.connection.get("api/recent").catch(() => ({ surveys: [] }));
    const open = async (number) => {
      try {
        const { url } = await this.app.connection.ask("api/recent", { number });
        window.location.assign(url);
      } catch (error) {
        this.app.refuse(error);
      }
    };
    this.recent.replaceChildren(...(surveys.length ? surveys.map(({ number, name, folder }) => h("li", {},
      button(`${folder} / ${name}`, () => open(number), { class: "link" })))
      : [h("li", { class: "hint" }, t("start.none"))]));
  }

  async #drop(files) {
    this.app.open("photos");
    this.zone.classList.add("busy");
    this.app.say(t("photos.reading"));
    try {
      await this.app.connection.upload(files);
      this.app.say(t(this.app.state.photos.length < 2 ? "photos.one" : "photos.read"));
    } catch (error) {
      this.app.refuse(error);
    }
    this.zone.classList.remove("busy");
    this.input.value = "";
    return undefined;
  }

  update(state) {
    const ready = state.photos.length === 2;
    this.beginning.hidden = state.photos.length > 0;
    if (!this.beginning.hidden && !this.asked) {
      this.asked = true;
      this.#tellRecent();
      this.#tellWalls();
    }
    this.zone.classList.toggle("small", state.photos.length > 0);
    this.zone.classList.toggle("further", ready);
    setText(this.lead, t(["photos.drop", "photos.dropSecond", "photos.dropMore"][state.photos.length]));
    this.alone.update(state);
    keyedRows(this.others, state.others, { key: ({ image }) => String(image), signature: JSON.stringify,
      build: (photo) => this.#other(photo) });
    this.form.hidden = this.media.hidden = !ready;
    for (const card of this.cards) this.#fillCard(card, state);
    for (const [key] of [...SITE, ...MEDIA]) fill(this.site[key], state.setup?.[key]);
    if (SITE.some(([key]) => (state.setup?.[key] ?? null) !== null) && !this.typed) this.form.open = this.typed = true;
    this.#tellMedia(state);
  }

  /** A photo beside far and near: it joins their orientation. */
  #other({ image, name, width, height, joined, distance }) {
    const away = button(t("photo.takeAway"), () => this.#takeAway(image), { class: "quiet", "aria-label": `${t("photo.takeAway")}: ${name}` });
    const thumb = h("img", { alt: t("photo.alt", { role: name }) });
    this.app.pyramids.info("photo", image, name).then(({ version, max_level: most }) => {
      thumb.src = `tiles/photo/${image}/${Math.min(THUMB_LEVEL, most)}/0_0.jpg?v=${version}`;
    }).catch((error) => this.app.refuse(error));
    return h("section", { class: "card photo" }, h("h2", {}, `${image} · ${t("photo.further")}`), thumb,
      h("div", { class: "card-body" }, h("p", { class: "file" }, name), h("p", { class: "hint" }, `${width} × ${height} px`),
        h("p", { class: joined ? "good" : "hint" }, t(joined ? "photo.joined" : "photo.joins", { distance: number(distance, 2) })),
        h("div", { class: "row" }, away)));
  }

  async #takeAway(image) {
    try {
      await this.app.connection.remove(`api/photos/${image}`);
      await this.app.connection.refresh();
    } catch (error) {
      this.app.refuse(error);
    }
  }

  /** What the oriented pair looks through; the card opens by itself where there is something. */
  #tellMedia({ pair, setup }) {
    const seen = pair?.images.map(({ media }) => media) ?? [];
    this.through.hidden = !seen[0];
    if (seen[0]) {
      setText(this.through, t("photos.through", { media: mediaWords(seen[0]),
        far: number(seen[0].z0, 3), near: number(seen[1].z0, 3) }));
    }
    const typed = MEDIA.some(([key]) => (setup?.[key] ?? null) !== null);
    if ((seen[0] || typed) && !this.told) this.media.open = this.told = true;
  }

  #fillCard(card, state) {
    const photo = state.photos.find(({ image }) => image === card.image);
    card.element.hidden = !photo;
    card.element.classList.toggle("bare", state.photos.length === 1);
    if (!photo) return;
    if (card.name.textContent !== photo.name) afresh([card.focal_mm, card.sensor_width_mm]);
    setText(card.name, photo.name);
    const size = `${photo.width} × ${photo.height} px`;
    setText(card.facts, [size, photo.camera].filter(Boolean).join(" · "));
    setText(card.trust, photo.focal_said ?? "");
    fill(card.focal_mm, photo.focal_mm);
    fill(card.sensor_width_mm, photo.sensor_width_mm);
    // An oriented pair knows its cameras.
    keyedRows(card.questions, state.pair ? [] : photo.missing, { key: (text) => text, signature: (text) => text,
      build: (text) => h("li", {}, text) });
    this.#thumb(card, state).catch((error) => this.app.refuse(error));
  }

  async #thumb(card, state) {
    const mark = photoMark(state);
    if (card.mark === mark) return;
    card.mark = mark;
    const info = await this.app.pyramids.info("photo", card.image, mark);
    if (card.mark !== mark) return;
    const level = Math.min(THUMB_LEVEL, info.max_level);
    card.thumb.src = `tiles/photo/${card.image}/${level}/0_0.jpg?v=${info.version}`;
  }
}
