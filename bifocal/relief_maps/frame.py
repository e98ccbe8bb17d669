"""Both photos on one grid of the reference plane, where photo 2 is a pure zoom of photo 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bifocal import rays
from bifocal.model.grid import Grid
from bifocal.model.pair import Pair, Photo
from photocore.arrays import BoolArray, ByteArray, FloatArray
from photocore.errors import GeometryError, InputError

Float32Array = NDArray[np.float32]

#: A plane grid that fits the pixels of a photo this well is not resampled. [px]
SAME_LATTICE = 2e-3
#: Parts of an oblique photo this much coarser than its middle are left out.
COARSEST_SHARE = 3.0
#: cv2.remap counts pixels in 16 bits. [px]
LONGEST_SIDE = 32_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """The working frame of dense matching.

    Attributes
    ----------
    grid : Grid
        Where the pixels are on the plane (positions q, not ground positions P).
    image1, image2 : ndarray of uint8, shape (height, width)
        Both photos in grey on the grid.
    seen1, seen2 : ndarray of bool, shape (height, width)
        Where each photo has content.
    pair : Pair
    """

    grid: Grid
    image1: ByteArray
    image2: ByteArray
    seen1: BoolArray
    seen2: BoolArray
    pair: Pair

    @property
    def centre(self) -> FloatArray:
        """Zoom centre e in pixels of the grid, shape (2,)."""
        return self.grid.pixel_of(self.pair.zoom_centre)

    @property
    def distances(self) -> tuple[float, float]:
        """d1, d2. [m]"""
        return self.pair.image1.distance, self.pair.image2.distance

    def from_centre(self) -> tuple[Float32Array, Float32Array]:
        """Return offsets from the zoom centre, shapes (1, width) and (height, 1). [px]"""
        x = np.arange(self.grid.width, dtype=np.float32)[None, :] - np.float32(self.centre[0])
        y = np.arange(self.grid.height, dtype=np.float32)[:, None] - np.float32(self.centre[1])
        return x, y


def native_gsd(photo: Photo, shape: tuple[int, ...]) -> float:
    """Return the side of a photo's pixel on the plane in the middle of the photo. [m]"""
    height, width = shape[:2]
    middle = np.array([[(width - 1) / 2, (height - 1) / 2]])
    jacobian = photo.metres_per_pixel(middle)[0]
    return float(np.sqrt(abs(np.linalg.det(jacobian))))


def common_bounds(
    pair: Pair, shapes: tuple[tuple[int, ...], tuple[int, ...]]
) -> tuple[float, float, float, float]:
    """Return the box on the plane that both photos see (X min, Y min, X max, Y max). [m]

    Raises
    ------
    GeometryError
        If the photos have no common area on the plane.
    """
    places = []
    for one, other, shape, across in (
        (pair.image1, pair.image2, shapes[0], shapes[1]),
        (pair.image2, pair.image1, shapes[1], shapes[0]),
    ):
        footprint = _footprint(one, shape)
        places.append(footprint[_shows(other, across, footprint)])
    both = np.concatenate(places)
    if len(both) < 4:
        raise GeometryError(
            "the two photos have no common area on the reference plane: check that they show the "
            "same wall and that the pair file belongs to them."
        )
    (x_min, y_min), (x_max, y_max) = both.min(0).tolist(), both.max(0).tolist()
    return x_min, y_min, x_max, y_max


def zoomed_box(
    pair: Pair, shape2: tuple[int, ...], box: tuple[float, float, float, float], relief: float
) -> tuple[float, float, float, float]:
    """Return a box grown to where photo 2 shows what stands out by a relief, as far as it does."""
    d1, d2 = pair.image1.distance, pair.image2.distance
    factor = d2 * (d1 - relief) / (d1 * (d2 - relief))
    corners = np.array([[box[0], box[1]], [box[2], box[3]]])
    grown = pair.zoom_centre + (corners - pair.zoom_centre) * factor
    footprint = _footprint(pair.image2, shape2)
    low = np.minimum(corners[0], np.maximum(grown[0], footprint.min(0)))
    high = np.maximum(corners[1], np.minimum(grown[1], footprint.max(0)))
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _shows(photo: Photo, shape: tuple[int, ...], places: FloatArray) -> BoolArray:
    """Return which plane positions a photo shows, to a pixel."""
    pixels = photo.pixels_from_plane(places)
    height, width = shape[:2]
    with np.errstate(invalid="ignore"):
        inside = ((pixels > -1) & (pixels < [width, height])).all(-1)
    return np.asarray(inside & _in_front(photo, shape, places))


def _footprint(photo: Photo, shape: tuple[int, ...]) -> FloatArray:
    """Return plane positions of a raster of a photo's pixels, without its very oblique part.

    The raster is coarse inside and dense along the frame, where the common area ends.
    """
    height, width = shape[:2]
    sides = []
    for across, down in ((33, 33), (1025, 2), (2, 1025)):
        columns, rows = (
            np.linspace(-0.5, width - 0.5, across),
            np.linspace(-0.5, height - 0.5, down),
        )
        sides.append(np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    pixels = np.concatenate(sides)
    places = photo.plane_from_pixels(pixels)
    determinant = np.linalg.det(photo.metres_per_pixel(pixels))
    middle = np.array([[(width - 1) / 2, (height - 1) / 2]])
    sign = np.sign(np.linalg.det(photo.metres_per_pixel(middle)))
    limit = (COARSEST_SHARE * native_gsd(photo, shape)) ** 2
    with np.errstate(invalid="ignore"):
        good = np.isfinite(places).all(-1) & (determinant * sign > 0)
        good &= np.abs(determinant) < limit
    return places[good & _in_front(photo, shape, places)]


def working_grid(
    pair: Pair, shape1: tuple[int, ...], box: tuple[float, float, float, float], gsd: float
) -> Grid:
    """Return the grid over a box; on the lattice of photo 1 if that is square to the wall."""
    grid = Grid.from_bounds(box, gsd=gsd)
    photo = pair.image1
    matrix = photo.plane_from_pixel / photo.plane_from_pixel[2, 2]
    ideal = np.array([[gsd, 0, matrix[0, 2]], [0, -gsd, matrix[1, 2]], [0, 0, 1.0]])
    span = max(shape1[:2])
    if photo.lens is None and np.abs((matrix - ideal)[:, :2]).max() * span < SAME_LATTICE * gsd:
        column, row = np.rint(np.linalg.inv(matrix)[:2] @ np.array([grid.x0, grid.y0, 1.0]))
        x0, y0 = matrix[:2] @ np.array([column, row, 1.0])
        grid = Grid(x0=float(x0), y0=float(y0), gsd=gsd, width=grid.width, height=grid.height)
    if max(grid.shape) > LONGEST_SIDE:
        raise InputError(
            f"the relief would be worked out on {grid.width} x {grid.height} px, more than "
            f"{LONGEST_SIDE} a side: give a coarser gsd or smaller bounds."
        )
    return grid


def make_frame(
    pair: Pair, image1: NDArray[np.uint8], image2: NDArray[np.uint8], grid: Grid
) -> Frame:
    """Bring both photos onto the grid; each is sampled once, through lens and homography."""
    first, seen1 = _on_grid(pair.image1, image1, grid)
    second, seen2 = _on_grid(pair.image2, image2, grid)
    if not (seen1 & seen2).any():
        raise GeometryError(
            "the two photos have no common area within the bounds: check the bounds and that the "
            "photos show the same wall."
        )
    return Frame(grid=grid, image1=first, image2=second, seen1=seen1, seen2=seen2, pair=pair)


def _on_grid(photo: Photo, image: ByteArray, grid: Grid) -> tuple[ByteArray, BoolArray]:
    """Return a photo on the grid and where it has content."""
    import cv2

    matrix = np.linalg.inv(photo.plane_from_pixel) @ grid.plane_from_pixel
    matrix = matrix / matrix[2, 2]
    height, width = image.shape
    shift = _whole_shift(matrix, grid) if photo.lens is None else None
    if shift is not None:
        return _cut(image, shift, grid)
    ratio = grid.gsd / native_gsd(photo, image.shape)
    scale = 1.0
    if ratio > 1.5:  # averaging first, so that the coarser grid does not alias
        scale = 1 / ratio
        small = (max(16, round(width * scale)), max(16, round(height * scale)))
        image = np.asarray(cv2.resize(image, small, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    factors = np.array([image.shape[1] / width, image.shape[0] / height])
    result = np.empty(grid.shape, dtype=np.uint8)
    seen = np.empty(grid.shape, dtype=bool)
    band = max(1, 2**20 // grid.width)
    for top in range(0, grid.height, band):
        part = grid.window(0, top, grid.width, min(band, grid.height - top))
        places = np.stack(np.meshgrid(part.columns_x, part.rows_y), axis=-1)
        pixels = photo.pixels_from_plane(places)
        rows = slice(top, top + part.height)
        with np.errstate(invalid="ignore"):
            seen[rows] = ((pixels >= 0) & (pixels <= [width - 1, height - 1])).all(-1)
        seen[rows] &= _in_front(photo, (height, width), places)
        maps = ((pixels + 0.5) * factors - 0.5).astype(np.float32)
        maps[~np.isfinite(maps)] = -1e4
        result[rows] = cv2.remap(
            image, maps[..., 0], maps[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
    result[~seen] = 0
    return result, seen


def _in_front(photo: Photo, shape: tuple[int, ...], places: FloatArray) -> BoolArray:
    """Return which plane points lie on the photo's side of its horizon."""
    inverse = np.linalg.inv(photo.plane_from_pixel)
    scale = places @ inverse[2, :2] + inverse[2, 2]
    # q = H p / w and p = H^-1 q * w: both scales have the same sign where the photo looks.
    reference = photo.plane_from_pixel[2] @ [shape[1] / 2, shape[0] / 2, 1.0]
    return np.asarray(scale * reference > 0)


def _whole_shift(matrix: FloatArray, grid: Grid) -> tuple[int, int] | None:
    """Return column and row of the grid's corner if the grid is the photo's own lattice."""
    offset = np.rint(matrix[:2, 2])
    lattice = np.array([[1, 0, offset[0]], [0, 1, offset[1]], [0, 0, 1.0]])
    corners = np.array([[0, 0, 1], [grid.width, 0, 1], [0, grid.height, 1], [*grid.shape[::-1], 1]])
    mapped = corners @ matrix.T
    off = mapped[:, :2] / mapped[:, 2:] - (corners @ lattice.T)[:, :2]
    return (int(offset[0]), int(offset[1])) if np.abs(off).max() < SAME_LATTICE * 10 else None


def _cut(image: ByteArray, corner: tuple[int, int], grid: Grid) -> tuple[ByteArray, BoolArray]:
    """Return the part of a photo that starts at a pixel; outside it there is nothing."""
    result = np.zeros(grid.shape, dtype=np.uint8)
    seen = np.zeros(grid.shape, dtype=bool)
    column, row = corner
    left, top = max(0, -column), max(0, -row)
    right = min(grid.width, image.shape[1] - column)
    bottom = min(grid.height, image.shape[0] - row)
    if right > left and bottom > top:
        result[top:bottom, left:right] = image[
            top + row : bottom + row, left + column : right + column
        ]
        seen[top:bottom, left:right] = True
    return result, seen


def zoom_map(frame: Frame, relief: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return where photo 2 shows the pixels of photo 1 at given relief (columns, rows). [px]"""
    d1, d2 = frame.distances
    factor = rays.zoom_factor(relief, d1=d1, d2=d2).astype(np.float32)
    x, y = frame.from_centre()
    return (
        factor * x + np.float32(frame.centre[0]),
        factor * y + np.float32(frame.centre[1]),
    )
