/**
 * Picking, the same for control points in single photos and for points in superimposed ones: what
 * the next click means, the point in hand, nudge, snap, the proposed partner.
 */
import { nearest } from "./dragging.js";

const NEAR = 14;
const REACH = 8;
/** So near its middle a mark is taken hold of. [CSS px] */
const GRIP = 9;
const FARTHEST = 16;

const other = (image) => 3 - image;

/** How far a proposal is to be trusted, in a word and in numbers; no word where nobody knows. */
export function trust(proposal) {
  if (!proposal || proposal.quality === null) return { level: "", values: {} };
  const level = proposal.kept ? "good" : proposal.quality > 0.5 ? "fair" : "poor";
  return { level, values: { percent: Math.round(100 * proposal.quality),
    sigma: proposal.sigma_px?.toFixed(2) ?? "?" } };
}

export class Picker extends EventTarget {
  /**
   * `kind`: "point" or "control", the family of commands; `items()`: what can be picked;
   * `panes()`: those that show; `partner`: propose the homologous point.
   */
  constructor({ connection, kind, items, panes, partner }) {
    super();
    Object.assign(this, { connection, kind, items, panes, partner });
    this.picking = true;
    this.selected = null;
    this.image = 1;
    this.target = { name: null, image: 1 };
    this.proposal = null;
    this.guide = null;
    this.cursor = null;
    this.hovered = null;
    this.dragged = null;
    this.latest = Promise.resolve();
  }

  /** The point in hand, or null. */
  get item() {
    return this.items().find(({ name }) => name === this.selected) ?? null;
  }

  /** The photo in which the point in hand is still to be picked, or null. */
  get lacking() {
    const { item } = this;
    return (item && [1, 2].find((image) => !this.pick(item, image))) ?? null;
  }

  pick(item, image) {
    const { dragged } = this;
    if (dragged?.name === item.name && dragged.image === image) return dragged.pixel;
    return this.connection.pick(this.kind, item, image);
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }

  say(key, values) {
    this.dispatchEvent(new CustomEvent("say", { detail: { key, values } }));
  }

  /** Take a point in hand; what it lacks is picked next. */
  select(name) {
    if (name === this.selected && this.item) return this.changed();
    this.selected = name;
    this.forget();
    const { item } = this;
    if (item) {
      const missing = this.lacking;
      this.target = missing ? { name, image: missing } : this.#fresh();
      if (!this.pick(item, this.image)) this.image = missing ? other(missing) : 1;
      if (this.partner && missing) this.suggest();
      else if (this.partner) this.#guide(item, null);
    } else {
      this.target = this.#fresh();
    }
    return this.changed();
  }

  /** The survey changed under the hand: what was to be picked next may be gone, or picked. */
  settle() {
    const { name, image } = this.target;
    const item = this.items().find((one) => one.name === name);
    const stale = name ? !item || (name !== this.selected && this.pick(item, image)) : this.kind === "control";
    if (stale) this.target = this.#fresh();
  }

  forget() {
    this.proposal = null;
    this.guide = null;
  }

  /** The next pick makes a new point, in photo `image`. */
  fresh(image = 1) {
    this.picking = true;
    this.selected = null;
    this.forget();
    this.target = { name: null, image };
    this.image = image;
    this.changed();
  }

  /** The next pick is of photo `image`: of the point in hand, else of a new one. */
  aim(image) {
    this.picking = true;
    this.target = { name: this.selected, image };
    if (this.item && this.pick(this.item, image)) this.image = image;
    this.changed();
  }

  begin() {
    this.picking = true;
    this.changed();
  }

  /** Leave what is half done, one thing at a time. */
  leave() {
    if (this.cursor) this.cursor = null;
    else if (this.proposal) this.forget();
    else if (this.selected) this.fresh();
    else this.picking = false;
    this.changed();
  }

  /** A click, or Enter at the keyboard's cursor, at a CSS pixel of a pane. */
  click(pane, pixel) {
    if (!this.picking) return this.#nearest(pane, pixel);
    const spot = pane.unplace(pixel);
    return this.#next(() => {
      const image = pane.image ?? this.target.image;
      const name = image === this.target.image ? this.target.name : this.#lacking(image);
      return this.#place(name, image, pane.frame.toPhoto(image, spot));
    });
  }

  /** One pick after the other: the first gives a new point its name. */
  #next(action) {
    this.latest = this.latest.then(action).catch((error) => {
      this.dispatchEvent(new CustomEvent("refused", { detail: error }));
    });
    return this.latest;
  }

  async #place(name, image, [column, row], doubtful = false) {
    this.forget();
    this.hovered = null;
    const op = `${this.kind}.pick`;
    const args = { name, image, column, row, doubtful };
    const answer = await (name ? this.connection.move(op, args) : this.connection.send(op, args));
    this.selected = name ?? answer.name;
    this.cursor = null;
    this.image = image;
    await this.#advance();
  }

  async #advance() {
    const { item } = this;
    const missing = this.lacking;
    this.target = missing ? { name: item.name, image: missing } : this.#fresh();
    this.changed();
    if (!item) return;
    this.say(missing ? "say.picked" : "say.complete", { name: item.name, image: this.image });
    if (this.partner && missing) await this.#suggest();
    else if (this.partner) await this.#guide(item, null);
  }

  /** A new point; of control points that are listed already, the next that lacks a pick. */
  #fresh() {
    const next = this.kind === "control" && this.items().find((item) => item.use !== false
      && [1, 2].some((image) => !this.pick(item, image)));
    if (next) return { name: next.name, image: [1, 2].find((image) => !this.pick(next, image)) };
    return { name: null, image: this.target.image === 2 && this.kind === "control" ? 2 : 1 };
  }

  /** Side by side the click says the photo: of the point in hand if it lacks that pick. */
  #lacking(image) {
    const { item } = this;
    return item && !this.pick(item, image) ? item.name : null;
  }

  /** The line in the photo where the partner must lie. */
  async #guide(item, missing) {
    const image = missing ?? other(this.image);
    const from = this.pick(item, other(image));
    if (!from) return;
    const [column, row] = from;
    const answer = await this.connection
      .ask("api/line", { image: other(image), column, row })
      .catch(() => null);
    if (!answer || this.selected !== item.name) return;
    this.guide = { image, line: answer.line };
    this.changed();
  }

  /** Ask for the homologous point of the one in hand; where it is in doubt, for the next place. */
  suggest() {
    const { proposal, item } = this;
    const from = proposal && item && this.pick(item, other(proposal.image));
    // Once the pick itself has moved, the places are those of another line.
    const same = proposal?.name === this.selected && String(from) === String(proposal?.from);
    if (same && proposal.others?.length) {
      const [next, ...rest] = proposal.others;
      const { column, row, quality, sigma_px } = proposal;
      const left = { column, row, quality, sigma_px };
      this.proposal = { ...proposal, quality: null, sigma_px: null, ...next, others: [...rest, left] };
      this.say("say.other");
      return this.changed();
    }
    return this.#next(() => this.#suggest());
  }

  async #suggest() {
    const { item } = this;
    if (!item) return this.say("say.nothing");
    const image = this.lacking ?? other(this.image);
    const from = this.pick(item, other(image));
    if (!from) return this.say("say.nothing");
    const [column, row] = from;
    const found = await this.connection.ask("api/suggest", { image: other(image), column, row });
    if (this.selected !== item.name) return undefined;
    this.guide = { image, line: found.line };
    this.proposal = Number.isFinite(found.column) ? { image, name: item.name, from, ...found } : null;
    const { level, values } = trust(this.proposal);
    this.say(level ? `quality.${level}` : "say.none", values);
    return this.changed();
  }

  /** Take the proposed partner. */
  accept() {
    return this.#next(async () => {
      if (!this.proposal && this.lacking) await this.#suggest();
      if (!this.proposal) return;
      const { name, image, column, row, kept } = this.proposal;
      await this.#place(name, image, [column, row], !kept);
    });
  }

  /** Move the pick in hand by some pixels of its photo. */
  nudge(columns, rows) {
    const { item } = this;
    const from = item && this.pick(item, this.image);
    if (!from) return false;
    this.#shift(item, this.image, from[0] + columns, from[1] + rows);
    return true;
  }

  /** The photo whose pick of the point in hand is drawn at a place of a pane, or null. */
  markAt(pane, place) {
    const { item } = this;
    const marks = (item ? pane.images : []).filter((image) => this.pick(item, image))
      .map((image) => ({ image, place: pane.screen(image, this.pick(item, image)) }));
    return nearest(marks, place, GRIP)?.image ?? null;
  }

  /** Show the pick in hand at a place of a pane. */
  drag(pane, image, place) {
    this.dragged = { name: this.selected, image, pixel: pane.photo(image, place) };
    this.changed();
  }

  /** Leave the pick in hand where it was dragged to: one step, whichever way it went. */
  drop(pane, image, place) {
    const { item } = this;
    this.dragged = null;
    this.image = image;
    if (item) this.#shift(item, image, ...pane.photo(image, place));
  }

  #shift(item, image, column, row) {
    const args = { name: item.name, image, column, row };
    this.hovered = null;
    // What is complete and was moved by hand stays: the next click is a new point's.
    if (!this.lacking) this.target = this.#fresh();
    this.connection.move(`${this.kind}.pick`, args).catch((error) => {
      this.dispatchEvent(new CustomEvent("refused", { detail: error }));
    });
    this.changed();
  }

  /** Slide the pick in hand along its line, outwards by `step` pixels. */
  slide(step) {
    const { item, guide } = this;
    const from = item && this.pick(item, this.image);
    if (!from || guide?.image !== this.image || guide.line.length < 2) return;
    const [a, b] = [guide.line[0], guide.line.at(-1)];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    this.nudge((step * (b[0] - a[0])) / length, (step * (b[1] - a[1])) / length);
  }

  /** How far off a click may have fallen: farther where the photo is shown small. [photo pixels] */
  get reach() {
    const zoom = Math.min(...this.panes().map((pane) => pane.zoom), 1);
    return Math.min(Math.max(REACH, (REACH / 2) / zoom), FARTHEST);
  }

  /** Centre the pick in hand on the corner or target that lies there. */
  snap(radius = this.reach) {
    return this.#next(async () => {
      const { item, image } = this;
      const from = item && this.pick(item, image);
      if (!from) return this.say("say.nothing");
      const [column, row] = from;
      const found = await this.connection.ask("api/snap", { image, column, row, radius });
      if (found.kind === "none") return this.say("say.unsnapped");
      this.#shift(item, image, found.column, found.row);
      return this.say(`say.${found.kind}`, { sigma: found.sigma_px?.toFixed(2) ?? "?" });
    });
  }

  #nearest(pane, place) {
    const marks = this.items().flatMap((item) => pane.images.filter((image) => this.pick(item, image))
      .map((image) => ({ name: item.name, place: pane.screen(image, this.pick(item, image)) })));
    const mark = nearest(marks, place, NEAR);
    if (mark) this.select(mark.name);
  }

  /** Show the keyboard's cursor in the middle of a pane, or hide it. */
  toggleCursor(pane) {
    this.picking = true;
    this.cursor = this.cursor ? null : { pane, place: [pane.width / 2, pane.height / 2] };
    this.#follow();
  }

  moveCursor(dx, dy) {
    const { pane, place } = this.cursor;
    const inside = (value, size) => Math.min(Math.max(value, 0), size);
    this.cursor.place = [inside(place[0] + dx, pane.width), inside(place[1] + dy, pane.height)];
    this.#follow();
  }

  /** Panes that are taken away take the cursor and the pointer with them. */
  letGoOf(panes) {
    if (panes.includes(this.cursor?.pane)) this.cursor = null;
    if (panes.includes(this.hovered?.pane)) this.hovered = null;
  }

  /** Tell the loupe where the pointer or the cursor is. */
  hover(pane, pixel) {
    this.hovered = pixel && this.picking ? { pane, pixel } : null;
    this.dispatchEvent(new Event("hover"));
  }

  #follow() {
    if (this.cursor) this.hover(this.cursor.pane, this.cursor.place);
    this.changed();
  }

  /** What the loupe shows of photo `image`: the pointer, the proposal or the pick. */
  sight(image) {
    if (this.hovered && (this.hovered.pane.image ?? this.target.image) === image) {
      return this.hovered.pane.photo(image, this.hovered.pixel);
    }
    const { item } = this;
    const picked = item && this.pick(item, image);
    if (picked) return picked;
    if (this.proposal?.image === image) return [this.proposal.column, this.proposal.row];
    if (!this.hovered || this.hovered.pane.image) return null;
    return this.hovered.pane.photo(image, this.hovered.pixel);
  }
}
