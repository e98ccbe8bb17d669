"""People, cars, machines: what stood before the wall in one photo and not in the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface, measured_on
from bifocal.orthophotos.rectify import SourcePhoto
from bifocal.orthophotos.tuning import MOVED
from bifocal.orthophotos.visibility import hidden_from, tidied
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MovedThing:
    """A region of the picture in which photo 1 shows something that photo 2 does not.

    Attributes
    ----------
    mask : ndarray of bool
        On ``grid``.
    grid : Grid
    area : float
        [m2]
    drawn_from_second : bool
        Whether photo 2 is sure to be the one without it; else it may be drawn, and is listed.
    """

    mask: BoolArray
    grid: Grid
    area: float
    drawn_from_second: bool

    @property
    def place(self) -> tuple[float, float]:
        """X and Y of its middle. [m]"""
        left, bottom, right, top = self.grid.bounds
        return (left + right) / 2, (bottom + top) / 2

    def on(self, grid: Grid) -> BoolArray | None:
        """Return its pixels on another grid; None if it has none there."""
        left, bottom, right, top = self.grid.bounds
        x0, y0, x1, y1 = grid.bounds
        if left >= x1 or right <= x0 or bottom >= y1 or top <= y0:
            return None
        columns = ((grid.columns_x - self.grid.x0) / self.grid.gsd).astype(np.float32)
        rows = ((self.grid.y0 - grid.rows_y) / self.grid.gsd).astype(np.float32)
        flags = self.mask.astype(np.float32)
        return cv2.remap(flags, *np.meshgrid(columns, rows), cv2.INTER_LINEAR) > 0.5


def moved_things(
    views: Sequence[SourcePhoto], surface: Surface, grid: Grid
) -> tuple[MovedThing, ...]:
    """Return what moved between two photos, as far as it lies where hardly anything was measured.

    A region in which the photos differ, exposure aside, is a thing that moved if nothing in it is
    found again in the other photo a few pixels aside: panes that mirror keep their bars. It stood
    in the photo whose edges the difference has.
    """
    pixel = views[0].photo.gsd(views[0].size)
    coarse = Grid.from_bounds(grid.bounds, gsd=max(grid.gsd, MOVED.pixels * pixel))
    measured = measured_on(surface, coarse)
    if measured is None:
        return ()
    relief = surface.window(coarse)
    (first, seen1), (second, seen2) = (_smooth(view, surface, coarse, relief) for view in views)
    both = seen1 & seen2
    if not both.any():
        return ()
    second = _in_tones_of(first, second, both)
    off = np.where(both, np.abs(first - second).mean(axis=-1), np.float32(0))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    strangeness = _Strangeness.to(first[both & (off < MOVED.rim)])
    core = _opened(off > MOVED.core, disc)
    near = _opened((off > MOVED.rim) & ~(measured & (off < MOVED.core)), disc)
    near = cv2.morphologyEx(near.astype(np.uint8), cv2.MORPH_CLOSE, disc)
    _, label, stats, _ = cv2.connectedComponentsWithStats(near, connectivity=8)
    things = []
    for number in np.unique(label[core & (near > 0)]):
        left, top, width, height, area = stats[number]
        if area * coarse.gsd**2 < MOVED.area:
            continue
        part = coarse.window(left - 4, top - 4, width + 8, height + 8)
        padded = [
            np.ascontiguousarray(_padded(of, (left, top, width, height)))
            for of in (first, second, (label == number).astype(np.uint8), measured, both)
        ]
        one, other, blob, valid, common = padded
        rings, _ = cv2.findContours(blob, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        full = cv2.drawContours(np.zeros_like(blob), rings, -1, 1, cv2.FILLED)
        if valid[full > 0].mean() > MOVED.measured or _likeness(one, other, full) > MOVED.likeness:
            continue
        share = _share_of_edges(one, other, full, common > 0)
        # Of the wall are the colours of the wall: what is stranger to it is the thing.
        stranger = strangeness(one, full) - strangeness(other, full)
        share += MOVED.strange * stranger
        if share < 1 - MOVED.sure:
            continue
        mask = cv2.dilate(full, disc) > 0
        things.append(MovedThing(
            mask=mask, grid=part, area=float(full.sum()) * coarse.gsd**2,
            drawn_from_second=share > MOVED.sure,
        ))  # fmt: skip
    return tuple(things)


def _smooth(
    view: SourcePhoto, surface: Surface, grid: Grid, relief: Float32Array
) -> tuple[Float32Array, BoolArray]:
    """Return a photo on a coarse grid, blurred, of 255 levels, and what it sees."""
    column, row = view.pixel_map(grid, relief)
    image = view.sample(column, row, "linear").astype(np.float32)
    image *= np.float32(255 / np.iinfo(view.image.dtype).max)
    image = cv2.GaussianBlur(image, (0, 0), MOVED.blur).reshape(*grid.shape, -1)
    hidden = tidied(hidden_from(surface, grid, view.photo.foot, relief))
    return image, view.inside(column, row) & ~hidden


def _in_tones_of(first: Float32Array, second: Float32Array, both: BoolArray) -> Float32Array:
    """Return the second photo with the median and the spread of the first in each band."""
    out = second.copy()
    for band in range(first.shape[2]):
        low = [np.quantile(image[..., band][both], (0.25, 0.5, 0.75)) for image in (first, second)]
        gain = np.clip((low[0][2] - low[0][0]) / max(low[1][2] - low[1][0], 1.0), 0.5, 2.0)
        out[..., band] = (second[..., band] - low[1][1]) * gain + low[0][1]
    return out


class _Strangeness(NamedTuple):
    """How rare colours are on a wall."""

    rarity: FloatArray

    @classmethod
    def to(cls, colours: Float32Array) -> _Strangeness:
        """Return it for colours of the wall, shape (n, bands)."""
        count = np.histogramdd(colours, bins=8, range=[(0, 256)] * colours.shape[1])[0] + 1.0
        return cls(-np.log(count / count.sum()))

    def __call__(self, image: Float32Array, where: ByteArray) -> float:
        """Return the mean rarity of an image's colours at some pixels. [nats]"""
        cells = np.clip(image[where > 0] / 32, 0, 7).astype(int)
        return float(self.rarity[tuple(cells.T)].mean())


def _opened(mask: BoolArray, disc: ByteArray) -> BoolArray:
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0


def _padded(image: NDArray[Any], box: tuple[int, int, int, int]) -> NDArray[Any]:
    """Return a box (left, top, width, height) of an image with 4 px around, zero outside."""
    left, top, width, height = box
    part = image[max(top - 4, 0) : top + height + 4, max(left - 4, 0) : left + width + 4]
    before = (max(4 - top, 0), max(4 - left, 0))
    size = (height + 8, width + 8, *image.shape[2:])
    out = np.zeros(size, np.uint8 if image.dtype == bool else image.dtype)
    out[before[0] : before[0] + part.shape[0], before[1] : before[1] + part.shape[1]] = part
    return out


def _likeness(first: Float32Array, second: Float32Array, full: ByteArray) -> float:
    """Return the median correlation of blocks within a region with the best place beside them."""
    half, reach = MOVED.block // 2, MOVED.reach
    first, second = (image.mean(axis=-1) for image in (first, second))
    edge = half + reach
    sides = (edge,) * 4
    wide, whole = (cv2.copyMakeBorder(i, *sides, cv2.BORDER_REPLICATE) for i in (first, second))
    best = []
    step = max(half + 1, math.isqrt(int(full.sum()) // MOVED.blocks))
    for row, column in np.argwhere(full[::step, ::step]) * step:
        below, right = row + reach, column + reach
        block = whole[below : below + MOVED.block, right : right + MOVED.block]
        around = wide[row : row + 2 * edge + 1, column : column + 2 * edge + 1]
        if max(block.std(), around.std()) < MOVED.contrast:
            continue
        flat = block.std() < MOVED.contrast / 3
        match = 0.0 if flat else float(cv2.matchTemplate(around, block, cv2.TM_CCOEFF_NORMED).max())
        best.append(match)
    return float(np.median(best)) if len(best) >= 3 else 1.0


def _share_of_edges(
    first: Float32Array, second: Float32Array, full: ByteArray, common: BoolArray
) -> float:
    """Return how much of the difference's edges along a region's rim are photo 1's, 0 to 1."""
    square = np.ones((5, 5), np.uint8)
    rim = (cv2.dilate(full, square) > 0) & (cv2.erode(full, square) == 0) & common
    along = total = 0.0
    for axis in ((1, 0), (0, 1)):
        of_first, of_difference = (cv2.Sobel(i, cv2.CV_32F, *axis) for i in (first, first - second))
        along += float((of_first * of_difference)[rim].sum())
        total += float((of_difference**2)[rim].sum())
    return float(np.clip(along / max(total, 1e-6), 0, 1))
