/** A lens as the library has it: ideal pixels to those of the photo as taken, and back. */
import { invert, project } from "./matrices.js";

/** OpenCV's radial, rational, tangential, thin-prism and tilt terms, in its own order. */
function opencv(coefficients, [x, y]) {
  const [k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0] = coefficients;
  const [s1 = 0, s2 = 0, s3 = 0, s4 = 0, tiltX = 0, tiltY = 0] = coefficients.slice(8);
  const r2 = x * x + y * y;
  const radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  const bent = [
    x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
    y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4),
  ];
  return tiltX || tiltY ? tilted(tiltX, tiltY, bent) : bent;
}

/** The sensor turned about x, then y (Scheimpflug), as OpenCV has it. */
function tilted(tiltX, tiltY, [x, y]) {
  const [cx, sx, cy, sy] = [Math.cos(tiltX), Math.sin(tiltX), Math.cos(tiltY), Math.sin(tiltY)];
  const u = cy * x + sy * sx * y - sy * cx;
  const v = cx * y + sx;
  const w = sy * x - cy * sx * y + cy * cx;
  const [a, b, c] = [-sy * cx, sx, cy * cx];
  return [(c * u - a * w) / w, (c * v - b * w) / w];
}

function fisheye([k1, k2, k3, k4], [x, y]) {
  const radius = Math.hypot(x, y);
  if (!radius) return [x, y];
  const angle = Math.atan(radius);
  const a2 = angle * angle;
  const scale = (angle * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))) / radius;
  return [x * scale, y * scale];
}

/** Cubic spline through the nodes whose third derivative does not jump at the first and last. */
function spline(x, y) {
  const n = x.length;
  const step = x.slice(1).map((value, i) => value - x[i]);
  const slope = step.map((value, i) => (y[i + 1] - y[i]) / value);
  const rows = x.map((_, i) => {
    const row = new Array(n + 1).fill(0);
    if (i === 0) [row[0], row[1], row[2]] = [step[1], -(step[0] + step[1]), step[0]];
    else if (i === n - 1) {
      [row[n - 3], row[n - 2], row[n - 1]] = [step[n - 2], -(step[n - 3] + step[n - 2]), step[n - 3]];
    } else {
      [row[i - 1], row[i], row[i + 1]] = [step[i - 1], 2 * (step[i - 1] + step[i]), step[i]];
      row[n] = 6 * (slope[i] - slope[i - 1]);
    }
    return row;
  });
  const bend = solve(rows);
  return (at) => {
    let i = x.findIndex((value) => value > at) - 1;
    if (i === -2) i = n - 2;
    i = Math.max(i, 0);
    const d = at - x[i];
    const h = step[i];
    const first = slope[i] - (h * (2 * bend[i] + bend[i + 1])) / 6;
    return y[i] + d * (first + d * (bend[i] / 2 + (d * (bend[i + 1] - bend[i])) / (6 * h)));
  };
}

/** Gauss with pivots; the right side is the last column. */
function solve(rows) {
  const n = rows.length;
  for (let i = 0; i < n; i++) {
    let best = i;
    for (let j = i + 1; j < n; j++) if (Math.abs(rows[j][i]) > Math.abs(rows[best][i])) best = j;
    [rows[i], rows[best]] = [rows[best], rows[i]];
    for (let j = i + 1; j < n; j++) {
      const factor = rows[j][i] / rows[i][i];
      for (let k = i; factor && k <= n; k++) rows[j][k] -= factor * rows[i][k];
    }
  }
  const found = new Array(n);
  for (let i = n - 1; i >= 0; i--) {
    let rest = rows[i][n];
    for (let k = i + 1; k < n; k++) rest -= rows[i][k] * found[k];
    found[i] = rest / rows[i][i];
  }
  return found;
}

export class Lens {
  constructor({ camera_matrix: matrix, model, coefficients }) {
    this.matrix = matrix;
    this.inverse = invert(matrix);
    this.coefficients = coefficients;
    if (model === "radial") {
      const at = (rest) => coefficients.filter((_, i) => i % 2 === rest);
      this.profile = spline(at(0), at(1));
    } else {
      this.bend = model === "fisheye" ? fisheye : opencv;
    }
  }

  distort(pixel) {
    if (this.bend) {
      return project(this.matrix, this.bend(this.coefficients, project(this.inverse, pixel)));
    }
    const [cx, cy] = [this.matrix[0][2], this.matrix[1][2]];
    const [x, y] = [pixel[0] - cx, pixel[1] - cy];
    const factor = this.profile(Math.hypot(x, y));
    return [cx + x * factor, cy + y * factor];
  }

  /** Newton's steps with a numeric Jacobian, to rounding within the photo. */
  undistort(pixel) {
    let [x, y] = pixel;
    const step = 1e-3;
    for (let round = 0; round < 25; round++) {
      const [a, b] = this.distort([x, y]);
      const [ax, bx] = this.distort([x + step, y]);
      const [ay, by] = this.distort([x, y + step]);
      const [xx, yx, xy, yy] = [ax - a, bx - b, ay - a, by - b].map((d) => d / step);
      const det = xx * yy - xy * yx;
      const [p, q] = [pixel[0] - a, pixel[1] - b];
      const [dx, dy] = [(p * yy - q * xy) / det, (q * xx - p * yx) / det];
      x += dx;
      y += dy;
      if (Math.abs(dx) + Math.abs(dy) < 1e-10) break;
    }
    return [x, y];
  }
}
