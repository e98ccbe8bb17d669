"""Both photos on one grid of the reference plane, where photo 2 is a pure zoom of photo 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal import rays
from bifocal.model.grid import Bounds, Grid, bounds_of, cut
from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from bifocal.model.ray_field import RayField
from bifocal.remarks import remark
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from photocore.errors import GeometryError, InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTuning:
    """Both photos on one grid."""

    #: A plane grid that fits the pixels of a photo this well is not resampled. [px]
    same_lattice: float = 0.002
    #: Parts of an oblique photo this much coarser than its middle are left out.
    coarsest_share: float = 3.0
    #: Side of the raster on which the pixels' shapes are taken. [px]
    stretch_side: int = 64


FRAME = FrameTuning()
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
    fields : tuple of RayField, or None
        The rays of both photos where the pair looks through media.
    sideways : bool
        Whether the cameras, of a set, stand beside each other rather than before one another.
    of_set : bool
        Whether further photos of a set tell what is right where these cannot.
    """

    grid: Grid
    image1: ByteArray
    image2: ByteArray
    seen1: BoolArray
    seen2: BoolArray
    pair: Pair
    fields: tuple[RayField, RayField] | None = None
    sideways: bool = False
    of_set: bool = False

    @property
    def centre(self) -> FloatArray:
        """Zoom centre e in pixels of the grid, shape (2,)."""
        return self.grid.pixel_of(self.zoom_centre)

    @property
    def distances(self) -> tuple[float, float]:
        """d1, d2; through media those of straight cameras that see alike near the axis. [m]"""
        return self.pair.straight_distances

    @property
    def zoom_centre(self) -> FloatArray:
        """Zoom centre e, through media that of straight cameras that see alike, shape (2,). [m]"""
        return rays.zoom_centre(self.foot(1), self.foot(2))

    def foot(self, number: int) -> rays.Foot:
        """Return a camera; through media the straight one that sees alike near its axis."""
        return rays.straight(self.pair.photo(number).foot)

    def slopes(
        self, number: int, column: Any, row: Any, relief: Any = None
    ) -> tuple[Float32Array, Float32Array]:
        """Return how bent rays move along columns and rows per metre of relief. [px/m]

        Parameters
        ----------
        number : int
            1 or 2.
        column, row : ndarray of float32
            Where the rays meet the plane, or with ``relief`` the points they pass.
        relief : ndarray of float32, optional
            Of the points. [m]
        """
        field = self._field(number)
        x, y = self._metres(field, column, row)
        slope = field.slopes(x, y) if relief is None else field.through(x, y, relief)[2:]
        share = np.float32(1 / self.grid.gsd)
        return slope[0] * share, slope[1] * -share

    def shown(
        self, number: int, column: Any, row: Any, relief: Any
    ) -> tuple[Float32Array, Float32Array]:
        """Return where bent rays through points meet the plane (columns, rows). [px]"""
        field = self._field(number)
        x, y, _, _ = field.through(*self._metres(field, column, row), relief)
        at, share = self.grid.pixel_of(field.foot.nadir), np.float32(1 / self.grid.gsd)
        return x * share + np.float32(at[0]), np.float32(at[1]) - y * share

    def _field(self, number: int) -> RayField:
        assert self.fields is not None
        return self.fields[number - 1]

    def _metres(self, field: RayField, column: Any, row: Any) -> tuple[Float32Array, Float32Array]:
        """Return offsets of pixels from a field's nadir along X and Y. [m]"""
        at, gsd = self.grid.pixel_of(field.foot.nadir), np.float32(self.grid.gsd)
        return (column - np.float32(at[0])) * gsd, (np.float32(at[1]) - row) * gsd

    def from_centre(self) -> tuple[Float32Array, Float32Array]:
        """Return offsets from the zoom centre, shapes (1, width) and (height, 1). [px]"""
        return offsets(self.grid.shape, self.centre)


def _footprints(photo: Photo, places: FloatArray, towards: FloatArray) -> FloatArray:
    """Return the square of a photo's pixel size on the plane along directions, (n,). [m²]"""
    per_pixel = photo.metres_per_pixel(photo.pixels_from_plane(places))
    return np.asarray((np.einsum("nij,ni->nj", per_pixel, towards) ** 2).sum(-1))


def radial_stretch(frame: Frame) -> Float32Array:
    """Return how much coarser the photos are along the radius than across it.

    A photo oblique to the wall has long pixels on the plane, and an error of matching that is the
    same in all directions of the photo is longer along them; 1 for photos square to the wall.
    """
    step = max(1, max(frame.grid.shape) // FRAME.stretch_side)
    places = np.stack(
        np.meshgrid(frame.grid.columns_x[step // 2 :: step], frame.grid.rows_y[step // 2 :: step]),
        axis=-1,
    )
    shape = places.shape[:2]
    away = places.reshape(-1, 2) - frame.zoom_centre
    along = away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None]
    across = along[:, ::-1] * [-1, 1]
    flat, photos = places.reshape(-1, 2), (frame.pair.image1, frame.pair.image2)
    squares = [sum(_footprints(photo, flat, way) for photo in photos) for way in (along, across)]
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sqrt(squares[0] / squares[1]).reshape(shape)
    ratio = np.nan_to_num(ratio, nan=1.0, posinf=1.0).astype(np.float32)
    size = frame.grid.shape[::-1]
    return np.asarray(cv2.resize(ratio, size, interpolation=cv2.INTER_LINEAR))


def parallax_per_metre(frame: Frame) -> Float32Array:
    """Return the parallax of a metre of relief, s / B. [px/m]"""
    x, y = frame.from_centre()
    return np.asarray(np.sqrt(x * x + y * y) / frame.pair.base_factor, dtype=np.float32)


def offsets(
    shape: tuple[int, int], centre: Sequence[float] | FloatArray = (0.0, 0.0)
) -> tuple[Float32Array, Float32Array]:
    """Return offsets of pixels from a point (column, row), shapes (1, w) and (h, 1). [px]"""
    x = np.arange(shape[1], dtype=np.float32)[None, :] - np.float32(centre[0])
    y = np.arange(shape[0], dtype=np.float32)[:, None] - np.float32(centre[1])
    return x, y


def common_bounds(pair: Pair, shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> Bounds:
    """Return the box on the plane that both photos see (X min, Y min, X max, Y max). [m]

    Raises
    ------
    GeometryError
        If the photos have no common area on the plane.
    """
    places = []
    photos = zip((pair.image1, pair.image2), shapes, strict=True)
    for (one, shape), (second, across) in permutations(photos):
        footprint = _footprint(one, shape)
        places.append(footprint[_shows(second, across, footprint)])
    both = np.concatenate(places)
    if len(both) < 4:
        raise GeometryError(remark("relief.nothing_in_common"))
    return bounds_of(both)


def zoomed_box(pair: Pair, shape2: tuple[int, ...], box: Bounds, relief: float) -> Bounds:
    """Return a box grown to where photo 2 shows what stands out by a relief, as far as it does."""
    d1, d2 = pair.straight_distances
    factor = rays.zoom_factor(relief, d1=d1, d2=d2)
    corners = np.reshape(box, (2, 2))
    centre = rays.zoom_centre(*(rays.straight(photo.foot) for photo in (pair.image1, pair.image2)))
    grown = centre + (corners - centre) * factor
    footprint = _footprint(pair.image2, shape2)
    low = np.minimum(corners[0], np.maximum(grown[0], footprint.min(0)))
    high = np.maximum(corners[1], np.minimum(grown[1], footprint.max(0)))
    return bounds_of(np.stack([low, high]))


def _shows(photo: Photo, shape: tuple[int, ...], places: FloatArray) -> BoolArray:
    """Return which plane positions a photo shows, to a pixel."""
    pixels = photo.pixels_from_plane(places)
    height, width = shape[:2]
    with np.errstate(invalid="ignore"):
        inside = ((pixels > -1) & (pixels < [width, height])).all(-1)
    return np.asarray(inside & photo.sees_ahead(places, shape))


def _footprint(photo: Photo, shape: tuple[int, ...]) -> FloatArray:
    """Return plane positions of a raster of a photo's pixels, without its very oblique part.

    The raster is coarse inside and dense along the frame, where the common area ends.
    """
    height, width = shape[:2]
    sides = []
    for across, down in ((33, 33), (1025, 2), (2, 1025)):
        columns = np.linspace(-0.5, width - 0.5, across)
        rows = np.linspace(-0.5, height - 0.5, down)
        sides.append(np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    pixels = np.concatenate(sides)
    places = photo.plane_from_pixels(pixels)
    determinant = np.linalg.det(photo.metres_per_pixel(pixels))
    middle = np.array([[(width - 1) / 2, (height - 1) / 2]])
    sign = np.sign(np.linalg.det(photo.metres_per_pixel(middle)))
    limit = (FRAME.coarsest_share * photo.gsd((width, height))) ** 2
    with np.errstate(invalid="ignore"):
        good = np.isfinite(places).all(-1) & (determinant * sign > 0)
        good &= np.abs(determinant) < limit
    return places[good & photo.sees_ahead(places, shape)]


def working_grid(pair: Pair, shape1: tuple[int, ...], box: Bounds, gsd: float) -> Grid:
    """Return the grid over a box; on the lattice of photo 1 if that is square to the wall."""
    grid = Grid.from_bounds(box, gsd=gsd)
    photo = pair.image1
    matrix = photo.plane_from_pixel / photo.plane_from_pixel[2, 2]
    ideal = np.array([[gsd, 0, matrix[0, 2]], [0, -gsd, matrix[1, 2]], [0, 0, 1.0]])
    span = max(shape1[:2])
    straight = photo.lens is None and not photo.refracted
    if straight and np.abs((matrix - ideal)[:, :2]).max() * span < FRAME.same_lattice * gsd:
        column, row = np.rint(np.linalg.inv(matrix)[:2] @ np.array([grid.x0, grid.y0, 1.0]))
        x0, y0 = matrix[:2] @ np.array([column, row, 1.0])
        grid = Grid(x0=float(x0), y0=float(y0), gsd=gsd, width=grid.width, height=grid.height)
    if max(grid.shape) > LONGEST_SIDE:
        about = {"width": grid.width, "height": grid.height, "most": LONGEST_SIDE}
        raise InputError(remark("relief.too_large", **about))
    return grid


def make_frame(
    pair: Pair,
    image1: NDArray[np.uint8],
    image2: NDArray[np.uint8],
    grid: Grid,
    relief_range: tuple[float, float] | None = None,
    *,
    sideways: bool = False,
    of_set: bool = False,
) -> Frame:
    """Bring both photos onto the grid; each is sampled once, through lens and homography.

    Through media their rays are tabulated for the reliefs to expect.
    """
    first, seen1 = _on_grid(pair.image1, image1, grid)
    second, seen2 = _on_grid(pair.image2, image2, grid)
    if not (seen1 & seen2).any():
        raise GeometryError(remark("relief.nothing_within_bounds"))
    fields = None
    if pair.refracted:
        reliefs = relief_range or (0.0, 0.0)
        first_rays, second_rays = (
            RayField.over(photo.foot, grid.bounds, reliefs) for photo in (pair.image1, pair.image2)
        )
        fields = first_rays, second_rays
    return Frame(
        grid=grid, image1=first, image2=second, seen1=seen1, seen2=seen2, pair=pair, fields=fields,
        sideways=sideways, of_set=of_set,
    )  # fmt: skip


def _on_grid(photo: Photo, image: ByteArray, grid: Grid) -> tuple[ByteArray, BoolArray]:
    """Return a photo on the grid and where it has content.

    Through media the rim of a photo is curved and lies within the grid. There the last pixels are
    continued: matching would run along an edge to black (façades 11 and 23 through a port, mean
    error within 10 px of the rim 4.9 and 6.0 to 4.0 and 2.2 mm, measured 90.3 to 92.0 %).
    """
    matrix = np.linalg.inv(photo.plane_from_pixel) @ grid.plane_from_pixel
    matrix = matrix / matrix[2, 2]
    height, width = image.shape
    straight = photo.lens is None and not photo.refracted
    shift = _whole_shift(matrix, grid) if straight else None
    if shift is not None:
        window = (*shift, grid.width, grid.height)
        return cut(image, window), cut(np.ones(image.shape, bool), window)
    ratio = grid.gsd / photo.gsd((width, height))
    scale = 1.0
    if ratio > 1.5:  # averaging first, so that the coarser grid does not alias
        scale = 1 / ratio
        small = (max(16, round(width * scale)), max(16, round(height * scale)))
        image = np.asarray(cv2.resize(image, small, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    factors = np.array([image.shape[1] / width, image.shape[0] / height])
    result = np.empty(grid.shape, dtype=np.uint8)
    inside = np.empty(grid.shape, dtype=bool)
    band = max(1, 2**20 // grid.width)
    for top in range(0, grid.height, band):
        part = grid.window(0, top, grid.width, min(band, grid.height - top))
        places = np.stack(np.meshgrid(part.columns_x, part.rows_y), axis=-1)
        pixels = photo.pixels_from_plane(places)
        rows = slice(top, top + part.height)
        with np.errstate(invalid="ignore"):
            inside[rows] = ((pixels >= 0) & (pixels <= [width - 1, height - 1])).all(-1)
        inside[rows] &= photo.sees_ahead(places, (height, width))
        maps = ((pixels + 0.5) * factors - 0.5).astype(np.float32)
        maps[~np.isfinite(maps)] = -1e4
        result[rows] = cv2.remap(
            image, maps, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
    if not photo.refracted:
        result[~inside] = 0
    return result, inside


def _whole_shift(matrix: FloatArray, grid: Grid) -> tuple[int, int] | None:
    """Return column and row of the grid's corner if the grid is the photo's own lattice."""
    offset = np.rint(matrix[:2, 2])
    lattice = np.array([[1, 0, offset[0]], [0, 1, offset[1]], [0, 0, 1.0]])
    corners = np.array([[0, 0, 1], [grid.width, 0, 1], [0, grid.height, 1], [*grid.shape[::-1], 1]])
    mapped = corners @ matrix.T
    off = mapped[:, :2] / mapped[:, 2:] - (corners @ lattice.T)[:, :2]
    return (int(offset[0]), int(offset[1])) if np.abs(off).max() < FRAME.same_lattice * 10 else None


def zoom_map(frame: Frame, relief: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return where photo 2 shows the pixels of photo 1 at given relief (columns, rows). [px]

    Eq. (6) read the other way round, about the zoom centre: q2 - e = k(r) (q1 - e).
    """
    return shown_at(frame, *offsets(frame.grid.shape), relief)


def shown_at(
    frame: Frame, column: Float32Array, row: Float32Array, relief: Any
) -> tuple[Float32Array, Float32Array]:
    """Return where photo 2 shows pixels of photo 1 at given relief. [px]

    Through media along the ray of photo 1 to the point, back to the plane along that of photo 2.
    """
    if not frame.pair.refracted:
        d1, d2 = frame.distances
        factor = rays.zoom_factor(relief, d1=d1, d2=d2).astype(np.float32)
        x0, y0 = (np.float32(value) for value in frame.centre)
        return factor * (column - x0) + x0, factor * (row - y0) + y0
    across, down = frame.slopes(1, column, row)
    return frame.shown(2, column + relief * across, row + relief * down, relief)


def values_at(band: NDArray[Any], places: NDArray[np.floating], how: int) -> NDArray[Any]:
    """Return a band or picture at (column, row), shape (n, 2) or (h, w, 2); NaN or 0 outside it.

    Parameters
    ----------
    how : int
        OpenCV's interpolation, ``cv2.INTER_NEAREST`` or another.
    """
    outside = np.nan if band.dtype.kind == "f" else 0
    if places.ndim == 3:
        return np.asarray(cv2.remap(band, places, None, how, borderValue=outside))
    values = [np.zeros((0, *band.shape[2:]), band.dtype)]
    # cv2.remap counts the places of one call in 16 bits.
    for part in np.array_split(places.astype(np.float32), len(places) // 30000 + 1):
        if len(part):
            values.append(cv2.remap(band, part[None], None, how, borderValue=outside)[0])
    return np.concatenate(values)
