/** What the server says of its tile pyramids, asked once and anew when the pictures change; tiles. */

export class Pyramids {
  constructor(connection) {
    this.connection = connection;
    this.known = new Map();
  }

  /** {width, height, tile, max_level, version} of one pyramid; `mark`: what it was made from. */
  info(space, image, mark) {
    const key = `${space}/${image}`;
    const known = this.known.get(key);
    if (known?.mark === mark) return known.promise;
    const promise = this.connection.get(`tiles/${space}/${image}/info`);
    promise.catch(() => this.known.delete(key));
    this.known.set(key, { mark, promise });
    return promise;
  }

  async both(space, mark) {
    return Promise.all([1, 2].map((image) => this.info(space, image, mark)));
  }
}

/** At most so many tiles are kept, or twice what is wanted at once: a tile takes 1 MB. */
const KEEP = 96;
const AT_ONCE = 6;
/** After which a tile that did not come is asked for anew. [ms] */
const AGAIN_MS = 3000;

/** Tiles of one pyramid: those wanted are fetched, the last few kept; `changed`: one has come. */
export class TileStore {
  constructor(address, info, changed) {
    Object.assign(this, { address, info, changed, count: 0, kept: new Map(), fetching: new Set() });
  }

  /** The tile if it is there, or null. */
  get(...place) {
    const key = place.join();
    const tile = this.kept.get(key);
    if (!tile) return null;
    this.kept.delete(key);
    this.kept.set(key, tile);
    return tile;
  }

  /** Fetch the [level, column, row] not yet there, the first ones first; the others when these have come. */
  load(places) {
    this.most = Math.max(KEEP, 2 * places.length);
    for (const place of places) {
      if (this.fetching.size >= AT_ONCE) return;
      if (!this.kept.has(place.join()) && !this.fetching.has(place.join())) this.#fetch(place);
    }
  }

  async #fetch(place) {
    const key = place.join();
    const [level, column, row] = place;
    this.fetching.add(key);
    try {
      // What is picked goes before.
      const answer = await fetch(`${this.address}/${level}/${column}_${row}.jpg?v=${this.info.version}`, { priority: "low" });
      if (!answer.ok) throw new Error(answer.statusText);
      const tile = await createImageBitmap(await answer.blob());
      if (this.disposed) return tile.close();
      this.kept.set(key, tile);
      for (const oldest of [...this.kept.keys()].slice(0, Math.max(0, this.kept.size - this.most))) {
        this.kept.get(oldest).close();
        this.kept.delete(oldest);
      }
    } catch {
      await new Promise((done) => setTimeout(done, AGAIN_MS));
    }
    this.fetching.delete(key);
    this.count += 1;
    return this.disposed || this.changed();
  }

  /** Give the tiles back. */
  dispose() {
    this.disposed = true;
    for (const tile of this.kept.values()) tile.close();
    this.kept.clear();
  }
}

/** Of what the pictures are made: when this changes, they are fetched anew. */
export const photoMark = (state) =>
  JSON.stringify(state.photos.map(({ name, width, height }) => [name, width, height]));

export const wallMark = (state) =>
  state.pair && JSON.stringify([photoMark(state), state.pair.wall_size, state.pair.images]);
