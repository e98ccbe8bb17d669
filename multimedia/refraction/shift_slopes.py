r"""Derivatives of the radial shift, from the tangent that its root has found.

Both R and :math:`\bar R` are functions of the invariant :math:`p = n_i \sin\beta_i`. With
:math:`r_i = 1 / (n_i \cos\beta_i)`, so that :math:`\tan\beta_i = p r_i`, and
:math:`s_i = n_i^2 r_i^3 = d\tan\beta_i / dp`:

.. math:: D = \frac{\partial\bar R}{\partial R} = \frac{H s_1}{\sum h_i s_i}, \quad
          \frac{\partial\bar R}{\partial h_i} = p (r_1 - D r_i), \quad
          \frac{\partial\bar R}{\partial n_i} = \frac{D p}{n_i} h_i s_i \; (i > 1), \quad
          \frac{\partial\bar R}{\partial n_1} = -\frac{D p}{n_1} \sum_{i > 1} h_i s_i .

The derivatives by the heights are formed from :math:`r_i - r_1`, and these from
:math:`n_1^2 - n_i^2`, so that they keep their digits where the media hardly differ, and are zero
where they do not:

.. math:: \frac{\partial\bar R}{\partial h_i} = \frac{p}{\sum h_j s_j} \sum_j h_j
          \left[ s_1 (r_j - r_i) + p^2 r_1 r_j (r_j^2 - r_1^2) \right] .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multimedia.refraction.tangent import Height, solve_row
from photocore.arrays import FloatArray

#: Elements worked on at a time: with some 50 scratch rows each new one costs more than the cache
#: saves (1e6 points, 3 layers: 92 ns a point in rows of 4096, 69 in rows of 16384).
BLOCK = 1 << 14

#: Squares of indices that differ by more than this share leave r_j - r_i all its digits but one.
APART = 0.05


def slopes_row(
    radius: FloatArray, heights: list[Height], indices: Sequence[float]
) -> tuple[FloatArray, ...]:
    """Return shifted radius, its derivative by R, those by the heights, those by the indices."""
    radius_bar, t, lowest = solve_row(radius, heights, indices)
    return radius_bar, *shift_slopes(t, lowest, heights, indices)


def shift_slopes(
    t: FloatArray, lowest: Height, heights: Sequence[Height], indices: Sequence[float]
) -> list[FloatArray]:
    """Return the derivatives by R, by every height and by every index, each of the shape of t.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Tangent of the ray in the medium of the lowest index.
    lowest : float or ndarray, shape (n,)
        That index.
    heights : sequence of float or ndarray, shape (n,)
    indices : sequence of float
    """
    square = t * t
    base = lowest * lowest / (1.0 + square)  # (n cos)^2 in the medium of t
    invariant = np.sqrt(base)
    invariant *= t
    r = [_inverse_root(base + (n - lowest) * (n + lowest)) for n in indices]
    r2 = [x * x for x in r]
    present = [_is_present(h) for h in heights]
    steep = [x2 * x for x2, x in zip(r2, r, strict=True)]
    first = steep[0] * indices[0] ** 2  # s_1, also where the layer has no height
    share = [
        _times(h, x, everywhere, n * n)
        for h, n, x, everywhere in zip(heights, indices, steep, present, strict=True)
    ]
    others = sum(share[1:], 0.0)
    slope = share[0]
    slope += others
    np.divide(1.0, slope, out=slope)
    d_radius = first * slope
    d_radius *= sum(heights[1:], heights[0])
    # sum h_j r_j (r_j^2 - r_1^2), which all heights share
    rise: Height = 0.0
    for j in range(1, len(indices)):
        if indices[j] != indices[0]:
            lift = r[j] + r[0]
            lift *= _gap(0, j, r, r2, indices)
            lift *= r[j]
            rise = rise + _times(heights[j], lift, present[j])
    rise = rise * invariant
    rise *= invariant
    rise *= r[0]
    outward = d_radius * invariant
    invariant *= slope
    d_heights = []
    for i in range(len(indices)):
        apart: Height = 0.0
        for j in range(len(indices)):
            if indices[j] != indices[i]:
                gap = _gap(i, j, r, r2, indices)
                apart = _times(heights[j], gap, present[j]) + apart
        apart = apart * first
        apart += rise
        apart *= invariant
        d_heights.append(apart)
    d_indices = [outward * (others / -indices[0])]
    for x, n in zip(share[1:], indices[1:], strict=True):
        x /= n
        x *= outward
        d_indices.append(x)
    return [d_radius, *d_heights, *d_indices]


def _gap(
    i: int, j: int, r: Sequence[FloatArray], r2: Sequence[FloatArray], indices: Sequence[float]
) -> FloatArray:
    """Return r_j - r_i without cancellation."""
    split = (indices[i] - indices[j]) * (indices[i] + indices[j])
    if abs(split) > APART * indices[i] ** 2:
        return r[j] - r[i]
    gap = r2[i] * r2[j]
    gap *= split
    gap /= r[i] + r[j]
    return gap


def _is_present(height: Height) -> bool:
    """Return whether a layer has a height everywhere (or one that is not known)."""
    return bool(height != 0) if isinstance(height, float) else bool(np.all(height != 0))


def _times(height: Height, term: FloatArray, everywhere: bool, factor: float = 1.0) -> FloatArray:
    """Return the product, in place of the term; an absent layer does nothing to the ray."""
    if isinstance(height, float):
        term *= height * factor
    else:
        term *= height
        if factor != 1.0:
            term *= factor
    return term if everywhere else np.where(np.asarray(height) == 0, 0.0, term)


def _inverse_root(square: FloatArray) -> FloatArray:
    """Return one over the root, in place."""
    np.sqrt(square, out=square)
    np.divide(1.0, square, out=square)
    return square
