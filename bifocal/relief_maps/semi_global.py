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


def aggregated(cost: Costs, image: ByteArray, *, one_step: int, jump: int, softness: int) -> Costs:
    """Return the costs of labels summed over eight paths, shape (height, labels, width).

    Parameters
    ----------
    cost : ndarray of int16, shape (height, labels, width)
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
    jumps = (jump * softness // (softness + np.arange(256))).astype(np.int16)
    step = np.int16(one_step)
    across = np.ascontiguousarray(cost.transpose(2, 1, 0))
    rows = _paths(cost, image, jumps, step, (-1, 0, 1))
    columns = _paths(across, np.ascontiguousarray(image.T), jumps, step, (0,))
    rows += columns.transpose(2, 1, 0)
    return rows


def _paths(
    cost: Costs, image: ByteArray, jumps: Costs, one_step: np.int16, shifts: tuple[int, ...]
) -> Costs:
    """Return the sum along paths down and up that shift by so many columns a row."""
    total = np.zeros_like(cost)
    ways = [(down, shift) for down in (1, -1) for shift in shifts]
    if _add_path.pays(cost.size * len(ways) * _NUMPY / 8):
        for down, shift in ways:
            _add_path(cost, image, total, jumps, one_step, down, shift)
        return total
    height, labels, width = cost.shape
    grey = image.astype(np.int16)
    for down, shift in ways:
        order = range(height) if down > 0 else range(height - 1, -1, -1)
        # Beyond the rims all is 0; beyond the first and the last label, out of reach.
        before = np.zeros((labels + 2, width + 2), np.int16)
        before[[0, -1]] = 32000 - one_step
        inner, columns = np.s_[1:-1, 1:-1], slice(1 - shift, width + 1 - shift)
        for row in order:
            least = before[1:-1, columns].min(0)
            start = row == order[0]
            edge = np.zeros(width, np.int16) if start else np.abs(
                grey[row] - np.roll(grey[row - down], shift)
            )  # fmt: skip
            best = np.minimum(before[:-2, columns], before[2:, columns]) + one_step
            np.minimum(best, before[1:-1, columns], out=best)
            np.minimum(best, least + jumps[edge], out=best)
            before[inner] = cost[row] + best - least
            total[row] += before[inner]
    return total


@compiled
def _add_path(cost, image, total, jumps, one_step, down, shift):  # type: ignore[no-untyped-def]
    """Add the costs smoothed along one path to the total, all columns of a row at a time."""
    height, labels, width = cost.shape
    before = np.zeros((labels + 2, width + 2), np.int16)
    now = np.zeros((labels + 2, width + 2), np.int16)
    for rim in (before, now):
        rim[0] = 32000 - one_step
        rim[-1] = 32000 - one_step
    least, most = np.zeros(width, np.int16), np.zeros(width, np.int16)
    start = 1 - shift
    for i in range(height):
        row = i if down > 0 else height - 1 - i
        least[:] = before[1, start : start + width]
        for label in range(2, labels + 1):
            same = before[label, start : start + width]
            for x in range(width):
                least[x] = min(least[x], same[x])
        for x in range(width):
            edge = np.int32(0)
            if i > 0:
                edge = abs(
                    np.int32(image[row, x]) - np.int32(image[row - down, (x - shift) % width])
                )
            most[x] = np.int16(least[x] + jumps[edge])
        for label in range(1, labels + 1):
            lower = before[label - 1, start : start + width]
            same = before[label, start : start + width]
            upper = before[label + 1, start : start + width]
            costs, sums = cost[row, label - 1], total[row, label - 1]
            smooth = now[label, 1 : 1 + width]
            for x in range(width):
                best = np.int16(min(lower[x], upper[x]) + one_step)
                best = min(min(best, same[x]), most[x])
                value = np.int16(costs[x] + best - least[x])
                smooth[x] = value
                sums[x] += value
        before, now = now, before
