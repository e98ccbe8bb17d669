"""Which rays of two cameras meet: targets on epipolar curves of each other, found in the object."""

from __future__ import annotations

import numpy as np

from photocore.arrays import FloatArray, IntArray

#: Pairs of rays worked on at a time, so that they stay in the processor's cache.
_BLOCK = 50_000


def meeting_rays(
    first: tuple[FloatArray, FloatArray],
    second: tuple[FloatArray, FloatArray],
    width: tuple[FloatArray, float],
    other: tuple[FloatArray, float],
) -> tuple[IntArray, IntArray]:
    """Return which rays of two cameras meet before them, as numbers in the first and the second.

    Parameters
    ----------
    first, second : tuple of ndarray, shape (n, 3) and (m, 3)
        Origins and unit directions of the rays.
    width, other : tuple
        How far a ray may miss: where it starts, (n,) and (m,), and more per length.

    Notes
    -----
    In Pluecker's coordinates the distance of two lines is a product of six numbers each. Ordered
    by the first, then the second.
    """
    if not len(first[0]) * len(second[0]):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    base = np.nanmean(np.where(np.isfinite(first[0]), first[0], np.nan), axis=0)
    lines = [
        np.column_stack([origins - base, directions, wide])
        for (origins, directions), (wide, _) in ((first, width), (second, other))
    ]
    return _within(lines[0], lines[1], width[1], other[1])


def _within(
    first: FloatArray, second: FloatArray, per1: float, per2: float
) -> tuple[IntArray, IntArray]:
    """Return the numbers of pairs of rays that meet: rows of origin, direction and width."""
    o2, d2 = second[:, :3], second[:, 3:6]
    moments = np.hstack([np.cross(o2, d2), d2]).T
    along2, pairs = np.einsum("ni,ni->n", o2, d2), []
    step = max(1, _BLOCK // len(second))
    for start in range(0, len(first), step):
        o, d, wide = np.split(first[start : start + step], (3, 6), axis=1)
        with np.errstate(all="ignore"):
            side = np.hstack([d, np.cross(o, d)]) @ moments
            cosine = d @ d2.T
            square = 1.0 - cosine * cosine
            one = d @ o2.T - np.einsum("ni,ni->n", o, d)[:, None]
            two = along2 - o @ d2.T
            far1, far2 = (one - cosine * two) / square, (cosine * one - two) / square
            allowed = wide + per1 * far1 + second[:, 6] + per2 * far2
            meet = (far1 > 0) & (far2 > 0) & (side * side <= square * allowed * allowed)
        rows, columns = np.nonzero(meet)
        pairs.append((rows + start, columns))
    rows, columns = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return rows, columns
