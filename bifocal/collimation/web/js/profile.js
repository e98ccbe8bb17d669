/** The relief along a line drawn on the wall, as a small chart with its sigma. */
import { decimal, h, number, setText } from "./dom.js";
import { button } from "./fields.js";
import { t } from "./words/words.js";

const [WIDTH, HEIGHT, LEFT, BOTTOM, PAD] = [900, 180, 66, 26, 12];

const svg = (tag, attributes) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  return node;
};

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
    this.chart = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", class: "chart" });
    this.caption = h("p", { class: "hint", role: "status" });
    this.keep = button(t("profile.keep"), () => this.#keep(), { class: "quiet", testid: "profile-keep", "aria-pressed": "false" });
    this.book = h("a", { class: "button quiet", download: "", testid: "profile-xlsx" }, "Excel");
    this.element = h("section", { class: "profile", hidden: true, "aria-label": t("profile.title") },
      h("div", { class: "row" }, this.caption, this.keep,
        button("CSV", () => this.#save(), { class: "quiet", testid: "profile-csv" }), this.book,
        button(t("profile.close"), () => this.close(), { class: "quiet" })),
      this.chart);
    this.chart.addEventListener("pointermove", (event) => this.#point(event));
    this.chart.addEventListener("pointerleave", () => { this.at = null; this.paint(); });
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
    this.#tellKept();
    this.app.say(t("profile.kept", { count: this.kept.length }));
  }

  #tellKept() {
    this.keep.setAttribute("aria-pressed", String(this.kept.includes(this.#corners)));
  }

  /** The profile as a table, in metres. */
  #save() {
    const { distance, r, sigma } = this.data;
    const [[x0, y0], [x1, y1]] = this.ends;
    const rows = distance.map((along, index) => {
      const share = along / this.length;
      return [along, x0 + share * (x1 - x0), y0 + share * (y1 - y0), r[index], sigma[index]]
        .map((value) => (Number.isFinite(value) ? value.toFixed(4) : "")).join(",");
    });
    const file = new Blob([["distance [m],X [m],Y [m],r [m],sigma_r [m]", ...rows, ""].join("\r\n")], { type: "text/csv" });
    const link = h("a", { href: URL.createObjectURL(file), download: `${this.app.state.title}_profile.csv` });
    link.click();
    URL.revokeObjectURL(link.href);
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
    let open = false;
    r.forEach((value, i) => {
      if (!Number.isFinite(value)) { open = false; return; }
      line.push(`${open ? "L" : "M"}${x(distance[i]).toFixed(1)} ${y(value).toFixed(1)}`);
      const spread = sigma[i] ?? 0;
      band.push(`M${x(distance[i]).toFixed(1)} ${y(value - spread).toFixed(1)}V${y(value + spread).toFixed(1)}`);
      open = true;
    });
    this.chart.replaceChildren(...this.#axes(x, y, low - slack, high + slack),
      svg("path", { d: band.join(""), class: "band" }), svg("path", { d: line.join(""), class: "curve" }));
    this.chart.setAttribute("aria-label", t("profile.alt", { low: number(low, 3), high: number(high, 3) }));
    this.element.hidden = false;
    this.shown();
    this.#tellKept();
    const [[x0, y0], [x1, y1]] = this.ends;
    this.book.href = `relief/profile.xlsx?${new URLSearchParams({ x0, y0, x1, y1 })}`;
    const times = (x(1) - x(0)) && (y(0) - y(1)) / (x(1) - x(0));
    setText(this.caption, `${t("profile.caption", { length: number(this.length, 3), low: number(low, 3), high: number(high, 3) })} · ${
      t("profile.times", { times: number(times, times < 10 ? 1 : 0) })}`);
    return undefined;
  }

  #axes(x, y, low, high) {
    const text = (value, attributes) => {
      const node = svg("text", attributes);
      node.textContent = `${decimal(String(+value.toPrecision(4)))} m`;
      return node;
    };
    return [
      ...ticks(low, high, 4).flatMap((value) => [
        svg("line", { x1: LEFT, x2: WIDTH - PAD, y1: y(value), y2: y(value), class: "rule" }),
        text(value, { x: LEFT - 6, y: y(value) + 4, "text-anchor": "end" })]),
      ...ticks(0, this.length, 8).map((value) =>
        text(value, { x: x(value), y: HEIGHT - 8, "text-anchor": "middle" })),
    ];
  }

  #point(event) {
    const { left, width } = this.chart.getBoundingClientRect();
    const along = (((event.clientX - left) / width) * WIDTH - LEFT) / (WIDTH - LEFT - PAD);
    this.at = Math.min(Math.max(along, 0), 1);
    const { distance, r, sigma } = this.data;
    const index = Math.round(this.at * (distance.length - 1));
    setText(this.caption, `${number(distance[index], 3)} m: r ${number(r[index] ?? NaN, 3)} ± ${number(sigma[index] ?? NaN, 3)} m`);
    this.paint();
  }
}
