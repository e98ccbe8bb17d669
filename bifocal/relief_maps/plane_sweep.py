"""A plane sweep: photo 2 zoomed by one hypothesis of relief after the other, compared with photo 1.

The pyramid of optical flow cannot carry what is narrower than its own parallax, such as the bars of
a railing; a comparison of 5 x 5 px at every relief that may be can.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal import rays
from bifocal.relief_maps import semi_global
from bifocal.relief_maps.frame import Frame, offsets, shown_at, zoom_map
from bifocal.relief_maps.tuning import SWEEP
from photocore.arrays import ByteArray, Float32Array
from photocore.compiled import compiled

#: Half width of the window of the census. [px]
HALF = 2
_PLACES = tuple(
    (down, across)
    for down in range(2 * HALF + 1)
    for across in range(2 * HALF + 1)
    if (down, across) != (HALF, HALF)
)
#: What numpy takes to compare a pixel at one hypothesis, roughly. [s]
_NUMPY = 20e-9


class Swept(NamedTuple):
    """What a sweep found in a box of photo 1: relief [m], and its cost in the sum of all paths."""

    relief: Float32Array
    cost: Float32Array


def swept(frame: Frame, rows: slice, columns: slice, low: float, high: float) -> Swept | None:
    """Return the relief that fits best in a box of photo 1, or None where there is no parallax.

    Parameters
    ----------
    frame : Frame
    rows, columns : slice
        The box.
    low, high : float
        Least and greatest relief tried. [m]

    Notes
    -----
    The cost is AD-census (Mei et al. 2011): of the 24 pixels around how many are darker than the
    middle in one photo only, and the difference of grey values, cut. Hypotheses are uniform in
    parallax, `SWEEP.step` apart where that is greatest.
    """
    d1, d2 = frame.distances
    box = np.array([[columns.start, columns.stop], [rows.start, rows.stop]])
    reach = float(np.linalg.norm(np.abs(box - frame.centre[:, None]).max(1)))
    ends = rays.zoom_factor(np.array([low, high]), d1=d1, d2=d2)
    count = int((ends[1] - ends[0]) * reach / SWEEP.step) + 1
    if count < SWEEP.fewest:
        return None
    zooms = np.linspace(ends[0], ends[1], count)
    first = _bordered(frame.image1, rows, columns)
    cost = _costs(first, _moved(frame, frame.image2, (rows, columns), zooms, cv2.INTER_LINEAR))
    seen = frame.seen2.view(np.uint8)
    if not _moved(frame, seen, (rows, columns), zooms[[0, -1]], cv2.INTER_NEAREST).all():
        content = _moved(frame, seen, (rows, columns), zooms, cv2.INTER_NEAREST)
        cost[np.moveaxis(content[:, HALF:-HALF, HALF:-HALF], 0, -1) == 0] = SWEEP.outside
    total = semi_global.aggregated(
        cost, frame.image1[rows, columns], one_step=SWEEP.one_step, jump=SWEEP.jump,
        softness=SWEEP.softness,
    )  # fmt: skip
    best = total.argmin(-1)
    least, shift = _lowest(total, best)
    relief = rays.relief_from_zoom(ends[0] + (best + shift) * (zooms[1] - zooms[0]), d1=d1, d2=d2)
    # At either end the best may lie beyond.
    end = (best == 0) | (best == count - 1)
    return Swept(np.where(end, np.nan, relief).astype(np.float32), least)


def misfit(frame: Frame, relief: Float32Array) -> Float32Array:
    """Return the cost of a sweep at given relief, shape (height, width)."""
    moved = cv2.remap(
        frame.image2, *zoom_map(frame, relief), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    rows, columns = (slice(0, length) for length in frame.grid.shape)
    first, second = (_bordered(image, rows, columns) for image in (frame.image1, moved))
    return _costs(first, second[None])[..., 0].astype(np.float32)


def _lowest(total: semi_global.Costs, best: NDArray[np.intp]) -> tuple[Float32Array, Float32Array]:
    """Return the least cost, and where the parabola through it and both beside has its vertex."""
    inner = np.clip(best, 1, total.shape[-1] - 2)
    left, middle, right = (
        np.take_along_axis(total, (inner + i)[..., None], -1)[..., 0].astype(np.float32)
        for i in (-1, 0, 1)
    )
    bend = np.maximum(left + right - 2 * middle, 1)
    shift = np.where(inner == best, np.clip((left - right) / (2 * bend), -0.5, 0.5), np.float32(0))
    return np.take_along_axis(total, best[..., None], -1)[..., 0].astype(np.float32), shift


def _bordered(image: ByteArray, rows: slice, columns: slice) -> ByteArray:
    """Return a box of an image with what the census needs around it."""
    sides = rows.start, image.shape[0] - rows.stop, columns.start, image.shape[1] - columns.stop
    top, bottom, left, right = (min(side, HALF) for side in sides)
    part = image[rows.start - top : rows.stop + bottom, columns.start - left : columns.stop + right]
    top, bottom, left, right = (HALF - side for side in (top, bottom, left, right))
    return cv2.copyMakeBorder(part, top, bottom, left, right, cv2.BORDER_REPLICATE)


def _moved(
    frame: Frame, image: ByteArray, box: tuple[slice, slice], zooms: NDArray[np.float64], how: int
) -> ByteArray:
    """Return what photo 2 shows of a bordered box at every zoom, shape (n, height, width)."""
    rows, columns = box
    size = (columns.stop - columns.start + 2 * HALF, rows.stop - rows.start + 2 * HALF)
    corner = np.array([columns.start - HALF, rows.start - HALF], float)
    stack = np.empty((len(zooms), size[1], size[0]), np.uint8)
    flags = how | cv2.WARP_INVERSE_MAP
    border = cv2.BORDER_REPLICATE if how == cv2.INTER_LINEAR else cv2.BORDER_CONSTANT
    if frame.pair.refracted:
        d1, d2 = frame.distances
        x, y = offsets((size[1], size[0]), -corner)
        for zoom, moved in zip(zooms, stack, strict=True):
            relief = np.float32(rays.relief_from_zoom(zoom, d1=d1, d2=d2))
            moved[:] = cv2.remap(image, *shown_at(frame, x, y, relief), how, borderMode=border)
        return stack
    for zoom, moved in zip(zooms, stack, strict=True):
        start = frame.centre + zoom * (corner - frame.centre)
        matrix = np.array([[zoom, 0, start[0]], [0, zoom, start[1]]])
        moved[:] = cv2.warpAffine(image, matrix, size, flags=flags, borderMode=border)
    return stack


def _costs(first: ByteArray, second: ByteArray) -> semi_global.Costs:
    """Return how badly bordered boxes fit one of photo 1, shape (height, width, n)."""
    inner = np.s_[HALF:-HALF, HALF:-HALF]
    grey = np.ascontiguousarray(first[inner])
    height, width = grey.shape
    darker = np.stack([first[y : y + height, x : x + width] < grey for y, x in _PLACES])
    cost = np.empty((height, width, len(second)), np.int16)
    weights = (SWEEP.census, SWEEP.grey, SWEEP.most_grey)
    if _compare.pays(cost.size * _NUMPY):
        _compare(grey, darker.view(np.uint8), second, cost, *weights)
        return cost
    for number, moved in enumerate(second):
        middle = moved[inner]
        differ = np.zeros((height, width), np.uint8)
        for own, (y, x) in zip(darker, _PLACES, strict=True):
            differ += (moved[y : y + height, x : x + width] < middle) ^ own
        off = np.minimum(cv2.absdiff(grey, np.ascontiguousarray(middle)), np.uint8(weights[2]))
        cost[..., number] = weights[0] * differ.astype(np.int16) + weights[1] * off.astype(np.int16)
    return cost


@compiled
def _compare(grey, darker, second, cost, census, share, most):  # type: ignore[no-untyped-def]
    """Fill in `_costs`."""
    height, width = grey.shape
    differ = np.empty(width, np.uint8)
    for row in range(height):
        for number in range(len(second)):
            moved = second[number]
            middle = moved[row + 2, 2 : 2 + width]
            differ[:] = 0
            for place in range(24):
                there = place if place < 12 else place + 1
                across = there % 5
                other = moved[row + there // 5, across : across + width]
                own = darker[place, row]
                for column in range(width):
                    differ[column] += np.uint8(other[column] < middle[column]) ^ own[column]
            line = grey[row]
            for column in range(width):
                a, b = np.int16(line[column]), np.int16(middle[column])
                off = min(abs(a - b), most)
                cost[row, column, number] = census * differ[column] + share * off
