"""A plane sweep: photo 2 zoomed by one hypothesis of relief after the other, compared with photo 1.

The pyramid of optical flow cannot carry what is narrower than its own parallax, such as the bars of
a railing; a comparison of 5 x 5 px at every relief that may be can.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal import rays
from bifocal.relief_maps import semi_global
from bifocal.relief_maps.frame import Frame, offsets, shown_at
from photocore.arrays import ByteArray, Float32Array, FloatArray, IntArray
from photocore.compiled import compiled


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepTuning:
    """A plane sweep over a tile."""

    #: Parallax between two hypotheses of a sweep, where it is greatest. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 0.75
    #: px 64.0 and 6.18, 1 px 61.0 and 6.37 (a third less to compare), 1.5 px 53.8 and 7.00.
    step: float = 1.0
    #: Cost of a pixel of 24 around that is darker than the middle in one photo only.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 5
    #: 64.7 and 6.06, 10 61.0 and 6.37.
    census: int = 5
    #: Cost of a difference of grey values. [1/grey level]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]:
    #: beside a census of 10, 6 61.0 and 6.37, 12 64.1 and 6.05.
    grey: int = 6
    #: Differences of grey values count up to this one. [grey levels]
    most_grey: int = 30
    #: Cost of a hypothesis that lies outside photo 2.
    outside: int = 200
    #: Penalty for the next hypothesis at a neighbour.
    one_step: int = 20
    #: Penalty for any other hypothesis at a neighbour of the same grey value.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 200
    #: 59.0 and 6.49, 400 61.0 and 6.37, 800 59.5 and 6.51.
    jump: int = 400
    #: A step of grey values that halves the penalty. [grey levels]
    softness: int = 12
    #: Hypotheses tried on either side of one that values of relief vote for.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 1
    #: 61.1 and 6.09, 2 62.8 and 6.01.
    near: int = 2
    #: Values of relief that make a hypothesis worth trying. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 8 px
    #: 62.8 and 6.01, 20 px 60.9 and 6.17.
    votes: int = 8
    #: Cost of the gap between hypotheses that are no neighbours: none goes through it.
    between: int = 1000


SWEEP = SweepTuning()
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


Box = tuple[slice, slice]


class Swept(NamedTuple):
    """What a sweep found in a box of photo 1: relief [m], and its cost in the sum of all paths."""

    relief: Float32Array
    cost: Float32Array


class Hypotheses(NamedTuple):
    """Reliefs to try, on a lattice that is uniform in parallax: zooms by 1 + step number.

    Attributes
    ----------
    step : float
    numbers : ndarray of int, shape (n,)
        Rising; relief may jump between two that are not neighbours, at one price.
    """

    step: float
    numbers: IntArray

    @classmethod
    def between(cls, frame: Frame, box: Box, low: float, high: float) -> Hypotheses:
        """Return all hypotheses between two reliefs. [m]"""
        step = _step(frame, box)
        first, last = ((_zoom(frame, relief) - 1) / step for relief in (low, high))
        return cls(step, np.arange(np.floor(first), np.ceil(last) + 1).astype(np.int64))

    @classmethod
    def near(cls, frame: Frame, box: Box, relief: Float32Array) -> Hypotheses:
        """Return the hypotheses that enough values of relief [m] are near to."""
        step = _step(frame, box)
        number = np.rint((_zoom(frame, relief) - 1) / step).astype(np.int64)
        if not len(number):
            return cls(step, number)
        start = int(number.min()) - SWEEP.near
        votes = np.bincount(number - start, minlength=int(number.max()) - start + SWEEP.near + 1)
        chosen = (votes >= SWEEP.votes).astype(np.uint8)
        chosen = cv2.dilate(chosen[None], np.ones((1, 2 * SWEEP.near + 1), np.uint8))[0]
        return cls(step, np.flatnonzero(chosen) + start)

    @property
    def slots(self) -> IntArray:
        """Places of the hypotheses among costs, an empty one where numbers are left out."""
        return np.arange(len(self.numbers)) + np.cumsum(np.diff(self.numbers, prepend=0) > 1)


def _step(frame: Frame, box: Box) -> float:
    """Return the difference of zoom that shifts the far end of a box by `SWEEP.step`."""
    ends = np.array([[box[1].start, box[1].stop], [box[0].start, box[0].stop]])
    reach = float(np.linalg.norm(np.abs(ends - frame.centre[:, None]).max(1)))
    return float(SWEEP.step) / reach


def _zoom(frame: Frame, relief: Any) -> Any:
    d1, d2 = frame.distances
    return rays.zoom_factor(relief, d1=d1, d2=d2)


def swept(frame: Frame, box: Box, tried: Hypotheses) -> Swept:
    """Return the relief that fits best in a box of photo 1; NaN where none of those tried may.

    Notes
    -----
    The cost is AD-census (Mei et al. 2011): of the 24 pixels around how many are darker than the
    middle in one photo only, and the difference of grey values, cut.
    """
    slots, zooms = tried.slots, np.asarray(1 + tried.step * tried.numbers, np.float64)
    moved = _moved(frame, frame.image2, box, zooms, cv2.INTER_LINEAR)
    cost = _costs(_bordered(frame.image1, box), moved, slots)
    mask = frame.seen2.view(np.uint8)
    if not _moved(frame, mask, box, zooms[[0, -1]], cv2.INTER_NEAREST).all():
        content = _moved(frame, mask, box, zooms, cv2.INTER_NEAREST)[:, HALF:-HALF, HALF:-HALF]
        for slot, inside in zip(slots, content, strict=True):
            cost[:, slot][inside == 0] = SWEEP.outside
    total = semi_global.aggregated(
        cost, frame.image1[box], one_step=SWEEP.one_step, jump=SWEEP.jump, softness=SWEEP.softness
    )
    best = _best(total)
    least, shift = _lowest(total, best)
    number = np.full(cost.shape[1], np.nan)
    number[slots] = tried.numbers
    # At the ends of what was tried the best may lie beyond.
    padded = np.pad(number, 1, constant_values=np.nan)
    number[np.isnan(padded[:-2] + padded[2:])] = np.nan
    d1, d2 = frame.distances
    relief = rays.relief_from_zoom(1 + tried.step * (number[best] + shift), d1=d1, d2=d2)
    return Swept(relief.astype(np.float32), least)


def misfit(frame: Frame, box: Box, relief: Float32Array) -> Float32Array:
    """Return the cost of a sweep of a box at given relief, mean of 3 x 3 px, (height, width)."""
    corner = box[1].start - HALF, box[0].start - HALF
    bordered = cv2.copyMakeBorder(relief, HALF, HALF, HALF, HALF, cv2.BORDER_REPLICATE)
    maps = _shown(frame, corner, bordered)
    moved = cv2.remap(frame.image2, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    cost = _costs(_bordered(frame.image1, box), moved[None], np.zeros(1, np.int64))
    return cv2.blur(cost[:, 0].astype(np.float32), (3, 3))


def _best(total: semi_global.Costs) -> NDArray[np.intp]:
    """Return the first of the labels of least cost, (height, width): `argmin(1)`, but faster."""
    least, best = total[:, 0].copy(), np.zeros((len(total), total.shape[2]), np.int16)
    for label in range(1, total.shape[1]):
        cost = total[:, label]
        np.maximum(best, (cost < least) * np.int16(label), out=best)
        np.minimum(least, cost, out=least)
    return best.astype(np.intp)


def _lowest(total: semi_global.Costs, best: NDArray[np.intp]) -> tuple[Float32Array, Float32Array]:
    """Return the least cost, and where the parabola through it and both beside has its vertex."""
    inner = np.clip(best, 1, total.shape[1] - 2)
    left, middle, right = (
        np.take_along_axis(total, (inner + i)[:, None], 1)[:, 0].astype(np.float32)
        for i in (-1, 0, 1)
    )
    bend = np.maximum(left + right - 2 * middle, 1)
    shift = np.clip((left - right) / (2 * bend), -0.5, 0.5)
    return middle, shift


def _bordered(image: ByteArray, box: Box) -> ByteArray:
    """Return a box of an image with what the census needs around it."""
    rows, columns = box
    sides = rows.start, image.shape[0] - rows.stop, columns.start, image.shape[1] - columns.stop
    top, bottom, left, right = (min(side, HALF) for side in sides)
    part = image[rows.start - top : rows.stop + bottom, columns.start - left : columns.stop + right]
    top, bottom, left, right = (HALF - side for side in (top, bottom, left, right))
    return cv2.copyMakeBorder(part, top, bottom, left, right, cv2.BORDER_REPLICATE)


def _moved(frame: Frame, image: ByteArray, box: Box, zooms: FloatArray, how: int) -> ByteArray:
    """Return what photo 2 shows of a bordered box at every zoom, shape (n, height, width)."""
    rows, columns = box
    size = (columns.stop - columns.start + 2 * HALF, rows.stop - rows.start + 2 * HALF)
    corner = np.array([columns.start - HALF, rows.start - HALF], float)
    stack = np.empty((len(zooms), size[1], size[0]), np.uint8)
    flags = how | cv2.WARP_INVERSE_MAP
    border = cv2.BORDER_REPLICATE if how == cv2.INTER_LINEAR else cv2.BORDER_CONSTANT
    d1, d2 = frame.distances
    centre = frame.centre
    for zoom, moved in zip(zooms, stack, strict=True):
        if frame.pair.refracted:
            relief = np.full(stack.shape[1:], rays.relief_from_zoom(zoom, d1=d1, d2=d2), np.float32)
            maps = _shown(frame, (columns.start - HALF, rows.start - HALF), relief)
            cv2.remap(image, *maps, how, dst=moved, borderMode=border)
            continue
        start = centre + zoom * (corner - centre)
        matrix = np.array([[zoom, 0, start[0]], [0, zoom, start[1]]])
        cv2.warpAffine(image, matrix, size, dst=moved, flags=flags, borderMode=border)
    return stack


def _shown(
    frame: Frame, corner: tuple[int, int], relief: Float32Array
) -> tuple[Float32Array, Float32Array]:
    """Return where photo 2 shows the pixels of a box of photo 1 that starts at a corner. [px]"""
    x, y = offsets(relief.shape, (-corner[0], -corner[1]))
    return shown_at(frame, x, y, relief)


def places(
    frame: Frame, at: tuple[NDArray[np.intp], NDArray[np.intp]], relief: Float32Array
) -> tuple[IntArray, IntArray, Float32Array]:
    """Return columns and rows at which photo 2 shows pixels of photo 1, and their parallax [px/m].

    Parameters
    ----------
    frame : Frame
    at : tuple of ndarray of int, shape (n,)
        Rows and columns of the pixels.
    relief : ndarray of float32, shape (n,)
        [m]
    """
    column, row = (axis.astype(np.float32) for axis in at[::-1])
    places = shown_at(frame, column, row, relief)
    to_column, to_row = (np.rint(np.nan_to_num(axis, nan=-1)).astype(np.int64) for axis in places)
    reach = np.hypot(column - np.float32(frame.centre[0]), row - np.float32(frame.centre[1]))
    return to_column, to_row, np.asarray(reach / frame.pair.base_factor, np.float32)


def _costs(first: ByteArray, second: ByteArray, slots: IntArray) -> semi_global.Costs:
    """Return how badly bordered boxes fit one of photo 1 at their slots, (height, n, width)."""
    inner = np.s_[HALF:-HALF, HALF:-HALF]
    grey = np.ascontiguousarray(first[inner])
    height, width = grey.shape
    darker = np.stack([first[y : y + height, x : x + width] < grey for y, x in _PLACES])
    cost = np.full((height, slots[-1] + 1, width), SWEEP.between, np.int16)
    weights = (SWEEP.census, SWEEP.grey, SWEEP.most_grey)
    if _compare.pays(cost.size * _NUMPY):
        _compare(grey, darker.view(np.uint8), second, slots, cost, *weights)
        return cost
    for slot, moved in zip(slots, second, strict=True):
        middle = moved[inner]
        differ = np.zeros((height, width), np.uint8)
        for bits, (y, x) in zip(darker, _PLACES, strict=True):
            differ += (moved[y : y + height, x : x + width] < middle) ^ bits
        off = np.minimum(cv2.absdiff(grey, np.ascontiguousarray(middle)), np.uint8(weights[2]))
        cost[:, slot] = weights[0] * differ.astype(np.int16) + weights[1] * off.astype(np.int16)
    return cost


@compiled
def _compare(grey, darker, second, slots, cost, census, share, most):  # type: ignore[no-untyped-def]
    """Fill in `_costs`."""
    height, width = grey.shape
    differ = np.empty(width, np.uint8)
    for row in range(height):
        for number in range(len(second)):
            moved = second[number]
            middle = moved[row + 2, 2 : 2 + width]
            differ[:] = 0
            for place in range(24):
                cell = place if place < 12 else place + 1
                across = cell % 5
                beside = moved[row + cell // 5, across : across + width]
                bits = darker[place, row]
                for column in range(width):
                    differ[column] += np.uint8(beside[column] < middle[column]) ^ bits[column]
            line, out = grey[row], cost[row, slots[number]]
            for column in range(width):
                a, b = np.int16(line[column]), np.int16(middle[column])
                off = min(abs(a - b), most)
                out[column] = census * differ[column] + share * off
