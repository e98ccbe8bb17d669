/**
 * The wall and the photos: pixels of one carried to the other. Same conventions as the library:
 * (column, row), integers at pixel centres; matrices 3x3, rows first.
 */

export function project(matrix, [x, y]) {
  const [a, b, c] = matrix;
  const w = c[0] * x + c[1] * y + c[2];
  return [(a[0] * x + a[1] * y + a[2]) / w, (b[0] * x + b[1] * y + b[2]) / w];
}

export function invert(m) {
  const [[a, b, c], [d, e, f], [g, h, i]] = m;
  const A = e * i - f * h;
  const B = f * g - d * i;
  const C = d * h - e * g;
  const det = a * A + b * B + c * C;
  return [
    [A / det, (c * h - b * i) / det, (b * f - c * e) / det],
    [B / det, (a * i - c * g) / det, (c * d - a * f) / det],
    [C / det, (b * g - a * h) / det, (a * e - b * d) / det],
  ];
}

/** OpenCV's radial, rational, tangential and thin-prism terms, in its own order. */
function distortNormalised(k, x, y) {
  const [k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0] = k;
  const [s1 = 0, s2 = 0, s3 = 0, s4 = 0] = k.slice(8, 12);
  const r2 = x * x + y * y;
  const radial =
    (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return [
    x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
    y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4),
  ];
}

/** The lens of one photo; `null` where the photo is free of distortion. */
class Lens {
  constructor({ camera_matrix: matrix, coefficients }) {
    this.matrix = matrix;
    this.inverse = invert(matrix);
    this.coefficients = coefficients;
  }

  distort(pixel) {
    const [x, y] = project(this.inverse, pixel);
    return project(this.matrix, distortNormalised(this.coefficients, x, y));
  }

  /** Newton's steps with a numeric Jacobian: to rounding within the photo. */
  undistort(pixel) {
    const [u, v] = project(this.inverse, pixel);
    let [x, y] = [u, v];
    const step = 1e-6;
    for (let round = 0; round < 25; round++) {
      const [a, b] = distortNormalised(this.coefficients, x, y);
      const [ax, bx] = distortNormalised(this.coefficients, x + step, y);
      const [ay, by] = distortNormalised(this.coefficients, x, y + step);
      const [xx, yx, xy, yy] = [ax - a, bx - b, ay - a, by - b].map((d) => d / step);
      const det = xx * yy - xy * yx;
      const dx = ((u - a) * yy - (v - b) * xy) / det;
      const dy = ((v - b) * xx - (u - a) * yx) / det;
      x += dx;
      y += dy;
      if (Math.abs(dx) + Math.abs(dy) < 1e-13) break;
    }
    return project(this.matrix, [x, y]);
  }
}

/** The wall's pixel grid, common to both images. */
export class Wall {
  constructor(pair) {
    [this.width, this.height] = pair.wall_size;
    this.gsd = pair.gsd;
    [this.xmin, , , this.ymax] = pair.plane_bounds;
    this.photoFromWall = pair.images.map((image) => image.photo_from_wall);
    this.wallFromPhoto = this.photoFromWall.map(invert);
    this.lenses = pair.images.map((image) => (image.lens ? new Lens(image.lens) : null));
  }

  /** Wall pixel -> pixel of the original photo `image` (1 or 2). */
  toPhoto(image, pixel) {
    const straight = project(this.photoFromWall[image - 1], pixel);
    return this.lenses[image - 1]?.distort(straight) ?? straight;
  }

  /** Pixel of the original photo `image` (1 or 2) -> wall pixel. */
  fromPhoto(image, pixel) {
    const straight = this.lenses[image - 1]?.undistort(pixel) ?? pixel;
    return project(this.wallFromPhoto[image - 1], straight);
  }

  /** Wall pixel -> (X, Y) on the reference plane [m]. */
  toPlane([column, row]) {
    return [this.xmin + (column + 0.5) * this.gsd, this.ymax - (row + 0.5) * this.gsd];
  }

  /** (X, Y) on the reference plane [m] -> wall pixel. */
  fromPlane([x, y]) {
    return [(x - this.xmin) / this.gsd - 0.5, (this.ymax - y) / this.gsd - 0.5];
  }
}

/** The photo's own pixels as a place to draw in: nothing to convert. */
export const asTaken = { toPhoto: (_image, pixel) => pixel, fromPhoto: (_image, pixel) => pixel };
