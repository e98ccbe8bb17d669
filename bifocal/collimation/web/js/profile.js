/** The relief along a line drawn on the wall, as a small chart with its sigma. */
import { decimal, h, html, number, render, svg } from "./dom.js";
import { t } from "./words/words.js";

const [WIDTH, HEIGHT, LEFT, BOTTOM, PAD] = [900, 180, 66, 26, 12];

/** About `count` round numbers between two values. */
function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) found.push(value);
  return found;
}

export class Profile {
  /** `paint`: draw the line on the wall; `shown`: the chart has taken its room. */
  constructor(app, paint, shown) {
    Object.assign(this, { app, paint, shown, ends: [], drawing: false, data: null, at: null, kept: [] });
    this.element = h("section", { class: "profile", hidden: true, "aria-label": t("profile.title") });
  }

  /** The line as the drawing's sections are named: the corners, in metres. */
  get #corners() {
    return this.ends.map((end) => end.map((one) => one.toFixed(3)).join(",")).join(" ");
  }

  /** Draw this profile in the package's drawings too, or no longer. */
  #keep() {
    const { kept } = this;
    const corners = this.#corners;
    this.kept = kept.includes(corners) ? kept.filter((one) => one !== corners) : [...kept, corners];
    this.#paint();
    this.app.say(t("profile.kept", { count: this.kept.length }));
  }

  begin() {
    this.ends = [];
    this.drawing = true;
    this.app.say(t("profile.first"));
    this.paint();
  }

  close() {
    this.ends = [];
    this.element.hidden = true;
    this.shown();
    this.paint();
  }

  /** The relief or the wall is another: what was drawn shows neither. */
  forget() {
    this.kept = [];
    if (this.ends.length) this.close();
  }

  /** One end, then the other, in plane metres. */
  async click(place) {
    // A double click is no line.
    if (!this.drawing || String(place) === String(this.ends[0])) return;
    this.ends = [...this.ends, place];
    this.paint();
    if (this.ends.length < 2) return this.app.say(t("profile.second"));
    this.drawing = false;
    try {
      const [from, to] = this.ends;
      const data = await this.app.connection.ask("relief/profile", { from, to });
      if (this.ends[1] !== to) return undefined; // closed or drawn anew meanwhile
      this.data = data;
      this.#show();
    } catch (error) {
      this.app.refuse(error);
    }
    return undefined;
  }

  /** Where on the plane the pointer on the chart stands, or null. */
  here() {
    if (this.at === null || this.ends.length < 2) return null;
    const [[x0, y0], [x1, y1]] = this.ends;
    return [x0 + this.at * (x1 - x0), y0 + this.at * (y1 - y0)];
  }

  #show() {
    const { distance, r, sigma } = this.data;
    const known = r.flatMap((value, i) => (Number.isFinite(value) ? [value - (sigma[i] ?? 0), value + (sigma[i] ?? 0)] : []));
    if (!known.length) {
      this.close();
      return this.app.say(t("profile.empty"), "warning");
    }
    const [low, high] = [Math.min(...known), Math.max(...known)];
    const slack = Math.max(0.05 * (high - low), 0.005);
    this.length = distance.at(-1);
    const x = (value) => LEFT + (value / this.length) * (WIDTH - LEFT - PAD);
    const y = (value) => PAD + ((high + slack - value) / (high - low + 2 * slack)) * (HEIGHT - PAD - BOTTOM);
    const band = [];
    const line = [];
    r.forEach((value, i) => {
      if (!Number.isFinite(value)) return;
      const at = x(distance[i]).toFixed(1);
      line.push(`${Number.isFinite(r[i - 1]) ? "L" : "M"}${at} ${y(value).toFixed(1)}`);
      const spread = sigma[i] ?? 0;
      band.push(`M${at} ${y(value - spread).toFixed(1)}V${y(value + spread).toFixed(1)}`);
    });
    const times = (x(1) - x(0)) && (y(0) - y(1)) / (x(1) - x(0));
    const range = { low: number(low, 3), high: number(high, 3) };
    this.words = `${t("profile.caption", { length: number(this.length, 3), ...range })} · ${t("profile.times", { times: number(times, times < 10 ? 1 : 0) })}`;
    this.element.hidden = false;
    this.#paint(svg`${this.#axes(x, y, low - slack, high + slack)}<path d=${band.join("")} class="band"></path><path d=${line.join("")} class="curve"></path>`,
      t("profile.alt", range));
    this.shown();
    return undefined;
  }

  #paint(drawn = this.drawn, alt = this.alt) {
    Object.assign(this, { drawn, alt });
    const [[x0, y0], [x1, y1]] = this.ends;
    render(html`<div class="row"><p class="hint" role="status">${this.words}</p><button type="button" class="quiet" data-testid="profile-keep"
        aria-pressed=${this.kept.includes(this.#corners)} @click=${() => this.#keep()}>${t("profile.keep")}</button>
        ${Object.entries({ csv: "CSV", xlsx: "Excel" }).map(([ending, name]) => html`<a class="button quiet" download data-testid="profile-${ending}"
          href="relief/profile.${ending}?${new URLSearchParams({ x0, y0, x1, y1 })}">${name}</a>`)}
        <button type="button" class="quiet" @click=${() => this.close()}>${t("profile.close")}</button></div>
      <svg viewBox="0 0 ${WIDTH} ${HEIGHT}" role="img" class="chart" aria-label=${alt} @pointermove=${(event) => this.#point(event)}
        @pointerleave=${() => { this.at = null; this.paint(); }}>${drawn}</svg>`, this.element);
  }

  #axes(x, y, low, high) {
    const text = (value, left, base, anchor) => svg`<text x=${left} y=${base} text-anchor=${anchor}>${decimal(String(+value.toPrecision(4)))} m</text>`;
    return [
      ...ticks(low, high, 4).map((value) => svg`<line x1=${LEFT} x2=${WIDTH - PAD} y1=${y(value)} y2=${y(value)} class="rule"></line>${
        text(value, LEFT - 6, y(value) + 4, "end")}`),
      ...ticks(0, this.length, 8).map((value) => text(value, x(value), HEIGHT - 8, "middle")),
    ];
  }

  #point(event) {
    const { left, width } = event.currentTarget.getBoundingClientRect();
    const along = (((event.clientX - left) / width) * WIDTH - LEFT) / (WIDTH - LEFT - PAD);
    this.at = Math.min(Math.max(along, 0), 1);
    const { distance, r, sigma } = this.data;
    const index = Math.round(this.at * (distance.length - 1));
    this.words = `${number(distance[index], 3)} m: r ${number(r[index] ?? NaN, 3)} ± ${number(sigma[index] ?? NaN, 3)} m`;
    this.#paint();
    this.paint();
  }
}
