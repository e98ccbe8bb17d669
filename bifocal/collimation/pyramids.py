"""Photos in halving sizes, and both photos rectified to the wall on one grid of pixels."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np

from bifocal.model import Bounds, Grid, Pair, Photo
from bifocal.orthophotos import LensTable, SourcePhoto, footprint
from photocore.arrays import BoolArray, ByteArray, Float32Array
from photocore.errors import GeometryError
from photocore.images import ImageArray, to_eight_bit

#: Side of a tile. [px]
TILE = 512
#: The wall pictures are never more pixels than this; coarser instead of larger.
MOST_PIXELS = 400_000_000


def max_level(size: tuple[int, int]) -> int:
    """Return the level of the full size, level 0 being one pixel.

    Examples
    --------
    >>> max_level((6000, 4000)), max_level((512, 512))
    (13, 9)
    """
    return math.ceil(math.log2(max(*size, 1)))


def level_size(size: tuple[int, int], level: int) -> tuple[int, int]:
    """Return width and height of a level."""
    factor = 2 ** (max_level(size) - level)
    return -(-size[0] // factor), -(-size[1] // factor)


@dataclass(slots=True)
class Pyramid:
    """A picture in halving sizes, read when first asked for.

    Parameters
    ----------
    size : tuple of int
        Width and height. [px]
    load : callable
        Returns the picture, shape (h, w, 3) RGB or (h, w), 8 or 16 bits.
    """

    size: tuple[int, int]
    load: Callable[[], ImageArray]
    _levels: list[ByteArray] = field(default_factory=list)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def halved(self, times: int) -> ByteArray:
        """Return the picture halved so many times: means of 2 x 2 pixels, edges repeated.

        Pixel c of it has its centre at 2**times (c + 0.5) - 0.5 of the original.
        """
        with self._lock:
            if not self._levels:
                self._levels.append(np.ascontiguousarray(to_eight_bit(self.load())))
            while len(self._levels) <= times:
                self._levels.append(_half(self._levels[-1]))
            return self._levels[times]

    def tile(self, level: int, column: int, row: int) -> ByteArray:
        """Return a tile, smaller at the right and lower edge."""
        image = self.halved(max_level(self.size) - level)
        return image[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE]


def _half(image: ByteArray) -> ByteArray:
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        image = np.asarray(
            cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE), np.uint8
        )
    size = (image.shape[1] // 2, image.shape[0] // 2)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def wall_grid(pair: Pair, sizes: tuple[tuple[int, int], tuple[int, int]]) -> Grid:
    """Return the grid on the wall on which both photos are shown: what either of them covers.

    Raises
    ------
    GeometryError
        If both photos look past the horizon of the wall, or show nothing in common.
    """
    photos = (pair.image1, pair.image2)
    boxes = [box for photo, size in zip(photos, sizes, strict=True) if (box := _box(photo, size))]
    if not boxes:
        raise GeometryError(
            "neither photo covers a finite part of the wall; orient the photos again."
        )
    if len(boxes) == 2 and not _overlap(*boxes):
        raise GeometryError("the photos show nothing in common on the wall; orient them again.")
    low, high = np.min(boxes, axis=0), np.max(boxes, axis=0)
    bounds = (float(low[0]), float(low[1]), float(high[2]), float(high[3]))
    gsd = min(photo.gsd(size) for photo, size in zip(photos, sizes, strict=True))
    area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1]) / gsd**2
    return Grid.from_bounds(bounds, gsd=gsd * max(1.0, math.sqrt(area / MOST_PIXELS)))


def _box(photo: Photo, size: tuple[int, int]) -> Bounds | None:
    try:
        return footprint(photo, size)
    except GeometryError:
        return None


def _overlap(first: Bounds, second: Bounds) -> bool:
    return (
        min(first[2], second[2]) > max(first[0], second[0])
        and min(first[3], second[3]) > max(first[1], second[1])
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class RectifiedPhoto:
    """A photo seen square to the wall: tiles of it on the grid of the wall.

    Attributes
    ----------
    pyramid : Pyramid
        The photo as taken.
    grid : Grid
        Of the finest level.
    """

    pyramid: Pyramid
    grid: Grid
    _source: SourcePhoto
    _gsd: float

    @classmethod
    def of(cls, photo: Photo, number: int, pyramid: Pyramid, grid: Grid) -> RectifiedPhoto:
        """Return it; nothing is read yet."""
        lens = LensTable.of_photo(photo, pyramid.size) if photo.lens is not None else None
        source = SourcePhoto(
            photo=photo, image=np.zeros((1, 1), np.uint8), factor=1, size=pyramid.size,
            number=number, lens=lens,
        )  # fmt: skip
        return cls(pyramid, grid, source, photo.gsd(pyramid.size))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height on the wall. [px]"""
        return self.grid.width, self.grid.height

    def tile(self, level: int, column: int, row: int) -> ByteArray:
        """Return a tile; black where the photo shows nothing."""
        width, height = level_size(self.size, level)
        factor = 2 ** (max_level(self.size) - level)
        left, top = column * TILE, row * TILE
        grid = Grid(
            x0=self.grid.x0 + self.grid.gsd * (factor * (left + 0.5) - 0.5),
            y0=self.grid.y0 - self.grid.gsd * (factor * (top + 0.5) - 0.5),
            gsd=self.grid.gsd * factor,
            width=min(TILE, width - left),
            height=min(TILE, height - top),
        )
        at, down = self._source.pixel_map(grid, np.zeros(grid.shape, np.float32))
        outside = ~self._source.inside(at, down)
        finer = max(0.0, math.log2(grid.gsd / self._gsd))
        times = min(round(finer), max_level(self.pyramid.size))
        image = self.pyramid.halved(times)
        at, down = ((c + np.float32(0.5)) / np.float32(2**times) - np.float32(0.5)
                    for c in (at, down))  # fmt: skip
        image, at, down = _window(image, at, down, outside)
        picture = cv2.remap(image, at, down, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        picture[outside] = 0
        return np.asarray(picture, dtype=np.uint8)


def _window(
    image: ByteArray,
    column: Float32Array,
    row: Float32Array,
    outside: BoolArray,
) -> tuple[ByteArray, Float32Array, Float32Array]:
    """Return the part of a picture that a tile needs: cv2.remap takes no more than 32767 px."""
    if outside.all():
        zero = np.zeros_like(column)
        return image[:1, :1], zero, zero
    column, row = (
        np.where(outside, column[~outside][0], column),
        np.where(outside, row[~outside][0], row),
    )
    c0, r0 = (max(0, math.floor(float(f.min())) - 4) for f in (column, row))
    c1, r1 = (math.ceil(float(f.max())) + 5 for f in (column, row))
    part = np.ascontiguousarray(image[r0:r1, c0:c1])
    return part, column - np.float32(c0), row - np.float32(r0)
