"""Which rays of two cameras meet: targets on epipolar curves of each other, found in the object."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photocore.arrays import BoolArray, FloatArray, IntArray

#: Pairs of rays that are sieved at a time, so that they stay in the processor's cache, and pairs
#: left over that are worked on at a time.
_SIEVED, _BLOCK = 200_000, 50_000
#: Multiple of the largest distance that single precision may round a moment by, at most.
_ROUNDING = 4e-6


def meeting_rays(
    first: tuple[FloatArray, FloatArray],
    second: tuple[FloatArray, FloatArray],
    width: tuple[FloatArray, float],
    other: tuple[FloatArray, float],
) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
    """Yield which rays of two cameras meet before them, block by block.

    Parameters
    ----------
    first, second : tuple of ndarray, shape (n, 3) and (m, 3)
        Origins and unit directions of the rays.
    width, other : tuple
        How far a ray may miss: where it starts, (n,) and (m,), and more per length.

    Yields
    ------
    one, two : ndarray of int, shape (p,)
        Numbers in the first and the second.
    points : ndarray, shape (p, 3)
        Half way between the rays.

    Notes
    -----
    In Pluecker's coordinates the moment of two lines, their distance times the sine of their
    angle, is a product of six numbers each. It may be the allowed miss times that sine, and the
    way along either ray times the sine is no longer than from origin to origin: a bound of two
    parts, one a ray, that all pairs are held against in single precision. What remains is tested
    as it is. Ordered by the first, then the second.
    """
    (o1, d1), (o2, d2) = first, second
    if not len(o1) * len(o2):
        return
    base = np.nanmean(np.where(np.isfinite(o2), o2, np.nan), axis=0)
    o1, o2 = o1 - base, o2 - base
    away1, away2 = (np.linalg.norm(o, axis=1) for o in (o1, o2))
    per_length = width[1] + other[1]
    slack = _ROUNDING * sum(np.nan_to_num(away).max() for away in (away1, away2))
    bound1 = width[0] + per_length * away1 + slack
    bound2 = other[0] + per_length * away2
    # What all have of the first part goes to the second. A sum is then at most this multiple of
    # its second part, by which the moments may be divided.
    shared = np.nanmin(bound1)
    bound2 += shared + np.finfo(float).tiny
    bound1 = (1.0 + (bound1 - shared) / np.nanmin(bound2)).astype(np.float32)[:, None]
    lines = np.hstack([d1, np.cross(o1, d1)]).astype(np.float32)
    moments = (np.hstack([np.cross(o2, d2), d2]) / bound2[:, None]).astype(np.float32).T
    ones: list[IntArray] = []
    twos: list[IntArray] = []
    step = max(1, _SIEVED // len(o2))
    for start in range(0, len(o1), step):
        side = lines[start : start + step] @ moments
        np.abs(side, out=side)
        rows, columns = np.divmod(np.flatnonzero(side <= bound1[start : start + step]), len(o2))
        ones.append(rows + start)
        twos.append(columns)
        if sum(map(len, ones)) >= _BLOCK or start + step >= len(o1):
            one, two = np.concatenate(ones), np.concatenate(twos)
            ones, twos = [], []
            allowed = width[0][one] + other[0][two], width[1], other[1]
            meet, points = _meetings((o1[one], d1[one]), (o2[two], d2[two]), allowed)
            yield one[meet], two[meet], points[meet] + base


def _meetings(
    first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray],
    allowed: tuple[FloatArray, float, float],
) -> tuple[BoolArray, FloatArray]:  # fmt: skip
    """Return which pairs of rays meet before their cameras, and where they are nearest."""
    (o1, d1), (o2, d2) = first, second
    between, (wide, per1, per2) = o2 - o1, allowed
    cosine = np.einsum("ni,ni->n", d1, d2)
    one, two = np.einsum("ni,ni->n", between, d1), np.einsum("ni,ni->n", between, d2)
    with np.errstate(all="ignore"):
        square = (1.0 - cosine) * (1.0 + cosine)
        far1, far2 = (one - cosine * two) / square, (cosine * one - two) / square
        near1, near2 = o1 + far1[:, None] * d1, o2 + far2[:, None] * d2
        gap = near2 - near1
        limit = wide + per1 * far1 + per2 * far2
        meet = (far1 > 0) & (far2 > 0) & (np.einsum("ni,ni->n", gap, gap) <= limit * limit)
    return meet, 0.5 * (near1 + near2)
