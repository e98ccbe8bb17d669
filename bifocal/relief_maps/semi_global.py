"""Semi-global matching (Hirschmueller 2008): costs of labels smoothed along eight paths.

In whole numbers: numba's machine code and the road of numpy give the same bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from photocore.arrays import ByteArray
from photocore.compiled import compiled

Costs = NDArray[np.int16]

#: What numpy takes for a cost along all paths, roughly. [s]
_NUMPY = 15e-9
#: Rows and columns from a pixel to the next along each path.
_PATHS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1))


def aggregated(cost: Costs, image: ByteArray, *, one_step: int, jump: int, softness: int) -> Costs:
    """Return the costs of labels summed over eight paths, shape (height, width, labels).

    Parameters
    ----------
    cost : ndarray of int16, shape (height, width, labels)
        Below 3000 less ``jump``, so that the sum has room.
    image : ndarray of uint8, shape (height, width)
        At its edges labels jump more readily.
    one_step : int
        Penalty for a neighbour whose label differs by one.
    jump : int
        Penalty for any other label, ``jump softness / (softness + grey step)``.
    softness : int
        [grey levels]
    """
    cost = np.ascontiguousarray(cost)
    if _all_paths.pays(cost.size * _NUMPY):
        return _all_paths(cost, image, one_step, jump, softness)
    total = np.zeros_like(cost)
    for down, across in _PATHS:
        _add_path(cost, image.astype(np.int16), total, (down, across), (one_step, jump, softness))
    return total


def _add_path(
    cost: Costs, image: Costs, total: Costs, way: tuple[int, int], penalties: tuple[int, int, int]
) -> None:  # fmt: skip
    """Add the costs smoothed along one path to the total, a row of pixels at a time."""
    one_step, jump, softness = penalties
    down, across = way
    if down == 0:  # along rows: the same as along columns of the transposed volume
        cost, image, total = (values.swapaxes(0, 1) for values in (cost, image, total))
        down, across = across, 0
    order = range(len(cost)) if down > 0 else range(len(cost) - 1, -1, -1)
    before = np.empty(0, np.int16)
    for row in order:
        if not len(before):
            before = cost[row].copy()
            total[row] += before
            continue
        shifted, neighbour = before, image[row - down]
        if across:
            shifted, neighbour = np.roll(before, across, axis=0), np.roll(neighbour, across)
        least = shifted.min(1, keepdims=True)
        step = np.abs(image[row] - neighbour)[:, None]
        best = np.minimum(shifted, least + (jump * softness // (softness + step)).astype(np.int16))
        np.minimum(best[:, 1:], shifted[:, :-1] + np.int16(one_step), out=best[:, 1:])
        np.minimum(best[:, :-1], shifted[:, 1:] + np.int16(one_step), out=best[:, :-1])
        before = cost[row] + best - least
        if across:
            edge = 0 if across > 0 else -1
            before[edge] = cost[row, edge]
        total[row] += before


@compiled
def _all_paths(cost, image, one_step, jump, softness):  # type: ignore[no-untyped-def]
    """Return `aggregated`."""
    height, width, labels = cost.shape
    total = np.zeros_like(cost)
    before, now = np.zeros((width, labels), np.int16), np.zeros((width, labels), np.int16)
    padded = np.full(labels + 2, np.int16(32000 - one_step))
    lower, same, upper = padded[:-2], padded[1:-1], padded[2:]
    step = np.int16(one_step)
    for way in range(8):
        down, across = _PATHS[way]
        for i in range(height):
            row = i if down >= 0 else height - 1 - i
            for j in range(width):
                column = j if across >= 0 else width - 1 - j
                own, smooth, sums = cost[row, column], now[column], total[row, column]
                above, beside = row - down, column - across
                if above < 0 or above >= height or beside < 0 or beside >= width:
                    for n in range(labels):
                        smooth[n] = own[n]
                        sums[n] += own[n]
                    continue
                other = before[beside] if down != 0 else now[beside]
                least = np.int16(32000)
                for n in range(labels):
                    same[n] = other[n]
                    least = min(least, other[n])
                edge = abs(np.int32(image[row, column]) - np.int32(image[above, beside]))
                most = np.int16(least + jump * softness // (softness + edge))
                for n in range(labels):
                    best = min(min(same[n], most), np.int16(min(lower[n], upper[n]) + step))
                    value = np.int16(own[n] + best - least)
                    smooth[n] = value
                    sums[n] += value
            if down != 0:
                before, now = now, before
    return total
