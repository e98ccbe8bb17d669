/**
 * Rays of one photo bent by plane-parallel media, at the reference plane: the same equations as
 * bifocal/media.py. Places are (X, Y) in metres; "apparent" is where the ray would meet the plane
 * if it went straight on in the first medium.
 */
import { number } from "./numbers.js";

const IDENTITY = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/** Vector [x, y, z] by the rows of a matrix. */
const turned = (rows, v) => rows.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);

/** Vector [x, y, z] by the columns of a matrix: back again. */
const turnedBack = (rows, v) =>
  [0, 1, 2].map((k) => rows[0][k] * v[0] + rows[1][k] * v[1] + rows[2][k] * v[2]);

/** What one photo looks through, for people: indices, thicknesses, and what is known of the last. */
export function mediaWords({ indices, thicknesses }, sigmas = {}) {
  return indices.map((index, k) => {
    const thick = k > 0 && k < indices.length - 1 ? ` (${number(1000 * thicknesses[k - 1], 1)} mm)` : "";
    const sigma = sigmas[`index${k + 1}`];
    return `${number(index, 4)}${Number.isFinite(sigma) ? ` ± ${number(sigma, 4)}` : ""}${thick}`;
  }).join(" · ");
}

export class Media {
  constructor({ indices, thicknesses, z0, distance, nadir, turn }) {
    Object.assign(this, { indices, thicknesses, z0, distance, nadir });
    this.axes = turn ?? IDENTITY;
    this.depth = thicknesses.reduce((sum, t) => sum + t, z0);
  }

  /** Tangent in medium i over that in the first. */
  bend(i, square) {
    const [first, n] = [this.indices[0], this.indices[i]];
    return first / Math.sqrt(n * n + (n * n - first * first) * square);
  }

  /** Radius behind `last` metres of the last medium, over the tangent; with its rate. */
  arm(tangent, last) {
    const square = tangent * tangent;
    let [arm, rate] = [this.z0, this.z0];
    [...this.thicknesses, last].forEach((height, k) => {
      const factor = this.bend(k + 1, square);
      arm += height * factor;
      // d(t k)/dt = k^3 n^2 / n_1^2
      rate += height * (factor ** 3) * (this.indices[k + 1] / this.indices[0]) ** 2;
    });
    return [arm, rate];
  }

  /** Tangent in the first medium beyond which a later, thinner one reflects the ray. */
  get limit() {
    const [first, thinnest] = [this.indices[0], Math.min(...this.indices)];
    return thinnest < first ? thinnest / Math.sqrt(first ** 2 - thinnest ** 2) : Infinity;
  }

  /** Tangent in the first medium of the ray to a radius, by Newton's steps. */
  tangent(radius, below) {
    const last = below - this.depth;
    const limit = this.limit;
    let tangent = Math.min(radius / this.arm(0, last)[0], limit / 2);
    for (let round = 0; round < 50; round++) {
      const [arm, rate] = this.arm(tangent, last);
      // The radius grows without end towards the limit: a step may lead half of the way there.
      const step = Math.min((radius - tangent * arm) / rate, (limit - tangent) / 2);
      tangent += step;
      if (Math.abs(step) < 1e-15 * (1 + Math.abs(tangent))) break;
    }
    return tangent;
  }

  /** Place on the plane -> where its ray would meet it if it went straight on. */
  apparent([x, y]) {
    const [dx, dy] = [x - this.nadir[0], y - this.nadir[1]];
    const [along, across, height] = turned(this.axes, [dx, dy, -this.distance]);
    const radius = Math.hypot(along, across);
    const per = radius > 0 ? this.tangent(radius, -height) / radius : 0;
    const way = turnedBack(this.axes, [along * per, across * per, -1]);
    return [0, 1].map((k) => this.nadir[k] - (way[k] * this.distance) / way[2]);
  }

  /** The way back: closed, since the ray is known. */
  onPlane([x, y]) {
    const [dx, dy] = [x - this.nadir[0], y - this.nadir[1]];
    const ray = turned(this.axes, [dx, dy, -this.distance]);
    const tangents = [ray[0] / -ray[2], ray[1] / -ray[2]];
    const square = tangents[0] ** 2 + tangents[1] ** 2;
    const arm = this.arm(Math.sqrt(square), 0)[0];
    const k = this.bend(this.indices.length - 1, square);
    const start = turnedBack(this.axes, [tangents[0] * arm, tangents[1] * arm, -this.depth]);
    const way = turnedBack(this.axes, [tangents[0] * k, tangents[1] * k, -1]);
    const left = (start[2] + this.distance) / way[2];
    return [0, 1].map((i) => this.nadir[i] + start[i] - way[i] * left);
  }
}
