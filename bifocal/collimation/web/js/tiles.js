/** What the server says of its tile pyramids, asked once and anew when the pictures change. */

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

/** Of what the pictures are made: when this changes, they are fetched anew. */
export const photoMark = (state) =>
  JSON.stringify(state.photos.map(({ name, width, height }) => [name, width, height]));

export const wallMark = (state) =>
  state.pair && JSON.stringify([photoMark(state), state.pair.wall_size, state.pair.images]);
