"""From a photo to a window of the orthophoto by one combined map: relief, homography, lens."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from bifocal.model.grid import Bounds, Grid, bounds_of
from bifocal.model.image import ImageArray, as_photo
from bifocal.model.photo import Photo
from bifocal.orthophotos.ortho_image import Interpolation
from bifocal.orthophotos.tuning import RECTIFICATION
from bifocal.rays import apparent_magnification, plane_position
from bifocal.remarks import remark
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.cli import Progress, no_progress
from photocore.errors import GeometryError, InputError
from photocore.large_photos import ROWS, LargePhoto, Pixels

#: cv2.remap addresses pixels with 16 bits.
_REMAP_LIMIT = 32_000
#: Of a photo read by windows no more than this is held at once. [px]
_WINDOW = 16_000_000


@dataclass(frozen=True, slots=True, eq=False)
class ChromaticShift:
    """Radial stretch of the red and the blue image against the green one.

    Attributes
    ----------
    red, blue : tuple of float
        a0, a1 of ``rho' = rho (1 + a0 + a1 (rho / R)^2)``, R half the diagonal.
    centre : tuple of float
        Column and row about which they stretch. [px]
    radius : float
        R. [px]
    """

    red: tuple[float, float]
    blue: tuple[float, float]
    centre: tuple[float, float]
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SourcePhoto:
    """A photo made ready for orthophotos of a certain pixel size.

    Attributes
    ----------
    photo : Photo
    image : ndarray or LargePhoto, shape (h, w, 3) or (h, w)
        Its pixels, reduced by ``factor``.
    factor : int
        Original pixels per pixel of ``image`` along a side.
    size : tuple of int
        Width and height of the original. [px]
    number : int
        1 or 2.
    chromatic : ChromaticShift, optional
        Shift of the colours to undo.
    """

    photo: Photo
    image: Pixels
    factor: int
    size: tuple[int, int]
    number: int
    lens: LensTable | None = None
    chromatic: ChromaticShift | None = None

    @classmethod
    def prepare(
        cls,
        photo: Photo,
        image: Pixels,
        *,
        number: int,
        gsd: float | None = None,
        chromatic: ChromaticShift | None = None,
        progress: Progress = no_progress,
    ) -> SourcePhoto:
        """Return it; a photo much finer than ``gsd`` is reduced first, against aliasing.

        Raises
        ------
        InputError
            If the image is not a photo of 8 or 16 bits per channel.
        """
        image = image if isinstance(image, LargePhoto) else as_photo(image)
        size = (image.shape[1], image.shape[0])
        factor = 1
        if gsd is not None:
            factor = max(1, math.floor(gsd / photo.gsd(size) + 0.25))
        factor = min(factor, max(1, min(size) // 2))
        if factor > 1:
            image = _reduced(image, factor, progress)
        lens = LensTable.of_photo(photo, size) if photo.lens is not None else None
        return cls(
            photo=photo, image=image, factor=factor, size=size, number=number, lens=lens,
            chromatic=chromatic,
        )  # fmt: skip

    def pixel_map(self, grid: Grid, relief: Float32Array) -> tuple[Float32Array, Float32Array]:
        """Return column and row of the photo for every pixel of a window; NaN where none."""
        column, row = _project(self.photo, self.size, grid, relief)
        if self.lens is not None:
            column, row = self.lens.distort(column, row)
        return column.astype(np.float32), row.astype(np.float32)

    def inside(self, column: Float32Array, row: Float32Array) -> BoolArray:
        """Return which positions lie within the photo; NaN does not."""
        width, height = self.size
        inside: BoolArray = (column >= -0.5) & (column <= width - 0.5)
        inside &= row >= -0.5
        inside &= row <= height - 0.5
        return inside

    def sample(
        self, column: Float32Array, row: Float32Array, interpolation: Interpolation
    ) -> ImageArray:
        """Return the photo's colours at positions, shape (h, w, 3) or (h, w)."""
        if self.chromatic is None or self.image.ndim == 2 or isinstance(self.image, LargePhoto):
            return self._remap(self.image, column, row, interpolation)
        shift = self.chromatic
        x, y = column - np.float32(shift.centre[0]), row - np.float32(shift.centre[1])
        square = (x * x + y * y) * np.float32(shift.radius**-2)
        bands = []
        for band, (a0, a1) in enumerate((shift.red, (0.0, 0.0), shift.blue)):
            stretch = np.float32(a0) + np.float32(a1) * square
            plane = np.ascontiguousarray(self.image[:, :, band])
            moved = (column + x * stretch, row + y * stretch)
            bands.append(self._remap(plane, *moved, interpolation))
        return np.stack(bands, axis=-1)

    def _remap(
        self,
        image: Pixels,
        column: Float32Array,
        row: Float32Array,
        interpolation: Interpolation,
    ) -> ImageArray:
        flag = {
            "nearest": cv2.INTER_NEAREST,
            "linear": cv2.INTER_LINEAR,
            "cubic": cv2.INTER_CUBIC,
            "lanczos": cv2.INTER_LANCZOS4,
        }[interpolation]
        if self.factor > 1:
            # Corners stay corners: the centre of the first reduced pixel is (factor - 1) / 2.
            column, row = (
                (c + np.float32(0.5)) / np.float32(self.factor) - np.float32(0.5)
                for c in (column, row)
            )
        return _remapped(image, column, row, flag=flag)


def _remapped(image: Pixels, column: Float32Array, row: Float32Array, *, flag: int) -> ImageArray:
    """Return the colours of a photo at positions, of a large one by as many windows as it takes."""
    if isinstance(image, LargePhoto):
        rows, columns = _limits(image.shape, column, row)
        area = (rows.stop - rows.start) * (columns.stop - columns.start)
        axis = 0 if len(column) > 1 else 1
        if area > _WINDOW and column.size > 1:  # rows first: they lie together in the file
            halves = (np.array_split(positions, 2, axis) for positions in (column, row))
            parts = [_remapped(image, *half, flag=flag) for half in zip(*halves, strict=True)]
            return np.concatenate(parts, axis)
    if isinstance(image, LargePhoto) or max(image.shape[:2]) > _REMAP_LIMIT:
        image, column, row = _part(image, column, row)
    return cv2.remap(image, column, row, flag, borderMode=cv2.BORDER_REPLICATE)


def footprint(photo: Photo, size: tuple[int, int]) -> Bounds:
    """Return the box on the reference plane that a photo covers: xmin, ymin, xmax, ymax. [m]

    Raises
    ------
    GeometryError
        If the photo looks past the horizon of the plane.
    """
    rim = _rim(size, outwards=0.5, points=33)
    ideal = rim if photo.lens is None else photo.lens.undistort(rim)
    # The denominator of the homography changes sign where the photo meets the horizon.
    depth = ideal @ photo.plane_from_pixel[2, :2] + photo.plane_from_pixel[2, 2]
    plane = photo.plane_from_pixels(rim)
    if not np.isfinite(plane).all() or depth.min() * depth.max() <= 0:
        raise GeometryError(remark("ortho.horizon"))
    return bounds_of(plane)


def _rim(size: tuple[int, int], *, outwards: float, points: int) -> FloatArray:
    """Return pixels along the four edges of a photo, so far outside the outermost centres."""
    low, high = -outwards, np.array(size) - 1.0 + outwards
    corners = np.array([[low, low], [high[0], low], high, [low, high[1]], [low, low]])
    return np.concatenate([np.linspace(a, b, points) for a, b in pairwise(corners)])


def _project(
    photo: Photo, size: tuple[int, int], grid: Grid, relief: Float32Array
) -> tuple[FloatArray, FloatArray]:
    """Return the ideal (column, row) of every pixel of a window, in double precision.

    Notes
    -----
    ``q = N + (P - N) k`` with ``k = d / (d - r)``, Midulla Eq. (1) on the plane; the homography
    is linear in (q, 1), so it becomes ``a + k (b (X - Nx) + c (Y - Ny))`` in each of its rows.
    """
    if photo.leans:
        return _project_leaning(photo, size, grid, relief)
    matrix = np.linalg.inv(photo.plane_from_pixel)
    nx, ny = photo.nadir
    x, y = grid.columns_x - nx, grid.rows_y - ny
    relief = relief.astype(np.float64)
    radius = np.zeros(()) if not photo.refracted else np.hypot(x[None, :], y[:, None])
    k = apparent_magnification(radius, relief, photo.foot)  # Eq. (1), through media Maas Eq. (2)
    constant = matrix @ np.array([nx, ny, 1.0])
    reach = max(np.abs(x).max(), np.abs(y).max())
    tilt = np.abs(matrix[2, :2]).max() * reach * max(1.0, float(np.fmax.reduce(k, axis=None)))
    square = tilt < 1e-13 * abs(constant[2])

    def row_of(i: int) -> FloatArray:
        value = (matrix[i, 0] * x)[None, :] + (matrix[i, 1] * y)[:, None]
        value *= k
        value += constant[i]
        return value

    if square:
        matrix, constant = matrix / constant[2], constant / constant[2]
        return row_of(0), row_of(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / row_of(2)
    # A homography also maps what lies behind the camera; the photo is on the side of its middle,
    # and the last row of the inverse is one over that of the homography.
    middle = float(photo.plane_from_pixel[2] @ np.array([size[0] / 2, size[1] / 2, 1.0]))
    scale[scale * middle <= 0] = np.nan
    return row_of(0) * scale, row_of(1) * scale


def _project_leaning(
    photo: Photo, size: tuple[int, int], grid: Grid, relief: Float32Array
) -> tuple[FloatArray, FloatArray]:
    """Return `_project` through interfaces that lean, where nothing is radial about the nadir."""
    x, y = np.broadcast_arrays(grid.columns_x[None, :], grid.rows_y[:, None])
    xyz = np.stack([x, y, relief.astype(np.float64)], axis=-1)
    q = plane_position(xyz, photo.foot)
    matrix = np.linalg.inv(photo.plane_from_pixel)
    homogeneous = q @ matrix[:, :2].T + matrix[:, 2]
    middle = float(photo.plane_from_pixel[2] @ np.array([size[0] / 2, size[1] / 2, 1.0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(homogeneous[..., 2] * middle > 0, 1.0 / homogeneous[..., 2], np.nan)
    return homogeneous[..., 0] * scale, homogeneous[..., 1] * scale


def _reduced(image: Pixels, factor: int, progress: Progress = no_progress) -> ImageArray:
    """Return an image averaged over squares of ``factor`` pixels; incomplete squares at the end."""
    height, width = image.shape[:2]
    if isinstance(image, LargePhoto):
        band = factor * max(1, ROWS // factor)
        parts = []
        for top in range(0, height, band):
            parts.append(_reduced(image[top : top + band, :], factor))
            progress(min(top + band, height), height, "photo reduced")
        return np.concatenate(parts)
    high, wide = -(-height // factor) * factor, -(-width // factor) * factor
    padded = cv2.copyMakeBorder(image, 0, high - height, 0, wide - width, cv2.BORDER_REPLICATE)
    return cv2.resize(padded, (wide // factor, high // factor), interpolation=cv2.INTER_AREA)


def _limits(shape: tuple[int, ...], column: Float32Array, row: Float32Array) -> tuple[slice, slice]:
    """Return the rows and columns of a very large photo that positions need."""
    margin = 8

    def limits(positions: Float32Array, length: int) -> slice:
        low, high = (f.reduce(positions, axis=None) for f in (np.fmin, np.fmax))
        if np.isnan(low):
            return slice(0, 1)
        first = int(np.clip(math.floor(low) - margin, 0, length - 1))
        return slice(first, int(np.clip(math.ceil(high) + margin, first + 1, length)))

    return limits(row, shape[0]), limits(column, shape[1])


def _part(
    image: Pixels, column: Float32Array, row: Float32Array
) -> tuple[ImageArray, Float32Array, Float32Array]:
    """Cut out of a very large photo what a window needs."""
    rows, columns = _limits(image.shape, column, row)
    if max(columns.stop - columns.start, rows.stop - rows.start) > _REMAP_LIMIT:
        raise InputError("the orthophoto is too coarse for this photo; choose a finer --gsd.")
    return image[rows, columns], column - np.float32(columns.start), row - np.float32(rows.start)


@dataclass(frozen=True, slots=True, eq=False)
class LensTable:
    """Where ideal pixels are seen through the lens, tabulated."""

    shift: Float32Array
    left: float
    top: float

    @classmethod
    def of_photo(cls, photo: Photo, size: tuple[int, int]) -> LensTable:
        """Tabulate over the ideal pixels that the photo shows."""
        assert photo.lens is not None
        ideal = photo.lens.undistort(_rim(size, outwards=1.0, points=65))
        low = np.floor(np.nanmin(ideal, axis=0)) - RECTIFICATION.lens_step
        high = np.ceil(np.nanmax(ideal, axis=0)) + RECTIFICATION.lens_step
        if not (np.isfinite(low).all() and (high - low).max() < 20 * max(size)):
            raise GeometryError(remark("ortho.lens_beyond_bounds"))
        x = np.arange(low[0], high[0] + RECTIFICATION.lens_step, RECTIFICATION.lens_step)
        y = np.arange(low[1], high[1] + RECTIFICATION.lens_step, RECTIFICATION.lens_step)
        points = np.stack(np.meshgrid(x, y), axis=-1)
        shift = (photo.lens.distort(points) - points).astype(np.float32)
        return cls(np.ascontiguousarray(shift), float(low[0]), float(low[1]))

    def distort(self, column: FloatArray, row: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return raw positions of ideal ones; NaN where the photo cannot show them."""
        u = ((column - self.left) * (1 / RECTIFICATION.lens_step)).astype(np.float32)
        v = ((row - self.top) * (1 / RECTIFICATION.lens_step)).astype(np.float32)
        outside = (math.nan, math.nan)
        shift = cv2.remap(self.shift, u, v, cv2.INTER_LINEAR, borderValue=outside)
        return column + shift[:, :, 0], row + shift[:, :, 1]
