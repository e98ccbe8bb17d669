/**
 * The wall and the photos: pixels of one carried to the other. Same conventions as the library:
 * (column, row), integers at pixel centres; matrices 3x3, rows first.
 */
import { Lens } from "./lens.js";
import { invert, project } from "./matrices.js";
import { Media } from "./media.js";

const PIECES = 32;

/** The wall's pixel grid, common to both images. */
export class Wall {
  constructor(pair) {
    [this.width, this.height] = pair.wall_size;
    this.gsd = pair.gsd;
    [this.xmin, , , this.ymax] = pair.plane_bounds;
    this.photoFromWall = pair.images.map((image) => image.photo_from_wall);
    this.wallFromPhoto = this.photoFromWall.map(invert);
    this.known = [new WeakMap(), new WeakMap()];
    this.lenses = pair.images.map((image) => (image.lens ? new Lens(image.lens) : null));
    this.media = pair.images.map((image) => (image.media ? new Media(image.media) : null));
  }

  /** Wall pixel -> pixel of the original photo `image` (1 or 2). */
  toPhoto(image, pixel) {
    const media = this.media[image - 1];
    const seen = media ? this.fromPlane(media.apparent(this.toPlane(pixel))) : pixel;
    const straight = project(this.photoFromWall[image - 1], seen);
    return this.lenses[image - 1]?.distort(straight) ?? straight;
  }

  /** Pixel of the original photo `image` (1 or 2) -> wall pixel; drawn in every frame, so kept. */
  fromPhoto(image, pixel) {
    const known = this.known[image - 1];
    let place = known.get(pixel);
    if (!place) {
      const straight = this.lenses[image - 1]?.undistort(pixel) ?? pixel;
      place = project(this.wallFromPhoto[image - 1], straight);
      const media = this.media[image - 1];
      if (media) place = this.fromPlane(media.onPlane(this.toPlane(place)));
      known.set(pixel, place);
    }
    return place;
  }

  /** The frame of a photo on the wall's grid; none where part of it looks past the wall. */
  frameOf(image, { width, height }) {
    const steps = 24;
    const [right, bottom] = [width - 0.5, height - 0.5];
    const corners = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]];
    const [, , [a, b, c]] = this.wallFromPhoto[image - 1];
    const ahead = corners.map(([x, y]) => Math.sign(a * x + b * y + c));
    const far = 20 * Math.max(this.width, this.height);
    const places = corners.flatMap(([x, y], index) => {
      const [u, v] = corners[(index + 1) % 4];
      return Array.from({ length: steps }, (_, k) => this.fromPhoto(image, [x + ((u - x) * k) / steps, y + ((v - y) * k) / steps]));
    });
    const whole = new Set(ahead).size === 1 && places.every((place) => place.every((one) => Math.abs(one) < far));
    return whole ? places : [];
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

/** Meshes of a grid that a wall of this pair is divided into: some twelve across, of 1, 2 or 5 times a power of ten. [m] */
export function gridStep({ plane_bounds: [xmin, , xmax] }) {
  const wanted = (xmax - xmin) / 12;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [1, 2, 5, 10].map((one) => one * power).find((step) => step >= wanted);
}

/** Lines of a grid on the wall as a photo shows them, cut into pieces that follow its lens. */
export function gridLines(wall, image, step) {
  const [xmax, ymin] = wall.toPlane([wall.width - 0.5, wall.height - 0.5]);
  const places = (low, high) => Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 },
    (_, index) => (Math.ceil(low / step) + index) * step);
  const piece = (low, high) => Array.from({ length: PIECES + 1 }, (_, index) => low + ((high - low) * index) / PIECES);
  return [...places(wall.xmin, xmax).map((x) => piece(ymin, wall.ymax).map((y) => [x, y])),
    ...places(ymin, wall.ymax).map((y) => piece(wall.xmin, xmax).map((x) => [x, y]))]
    .map((line) => line.map((place) => wall.toPhoto(image, wall.fromPlane(place))));
}

/** The photo's own pixels as a place to draw in: nothing to convert. */
export const asTaken = { toPhoto: (_image, pixel) => pixel, fromPhoto: (_image, pixel) => pixel };
