r"""Root of F(t) = R: the numerical core of the radial shift.

The unknown t is the tangent of the ray in the medium of the *lowest* index, because there the angle
is largest and R runs through all values as t does. With :math:`k_i = n_{min} / n_i` and
:math:`q_i = 1 - k_i^2`, Snell's law (Maas 2015, Eq. 3) turns Eqs. (1) and (2) into

.. math:: F(t) = t \sum_i \frac{h_i k_i}{\sqrt{1 + q_i t^2}} = R, \qquad
          F'(t) = \sum_i \frac{h_i k_i}{(1 + q_i t^2)^{3/2}}, \qquad
          \bar R = \frac{k_1 t \sum h_i}{\sqrt{1 + q_1 t^2}} .

F increases and is concave, so Newton's method approaches the root from below whatever the set-up:
it cannot diverge, overshoot into total reflection, or stop at a wrong value.

`layer_terms`, `first_tangent` and `apparent_radius` are these formulas, once for all that use them:
the rows of numpy here and the workbook's columns (`multimedia.refraction.unrolled`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from photocore import double_double as dd
from photocore.arrays import FloatArray, contiguous_rows

#: Elements worked on at a time: the dozen scratch rows stay in the processor's second-level cache.
BLOCK = 4096

#: A Newton step that changes t by less than this share leaves an error of 1.5e-18 (the factor of
#: the quadratic convergence is at most 1.5 for every set-up).
LAST_STEP = 1e-9

#: Seen at most: 12 steps in ordinary set-ups, 45 within 1e-15 of the limit of vision.
MAX_STEPS = 60

#: Where an error in R grows more than this much in t, float64 leaves more than 2e-15: t is then
#: finished with twice the digits. Only thin layers beyond the others' critical angle do that.
BENIGN = 4.0

#: The cubic first guess may overshoot beyond this; R over its slope at the axis never does.
NEAR_AXIS = 0.6

Height = float | FloatArray
#: Shifted radius, t, and the index of the layer t belongs to, of one row.
Row = tuple[FloatArray, FloatArray, Height]
RowSolver = Callable[[FloatArray, list[Height], Sequence[float]], tuple[Height, ...]]


def layer_terms(square: FloatArray, reduced: Height, bend: float) -> tuple[FloatArray, FloatArray]:
    """Return what a layer adds to F(t) / t and to F'(t), from t², h k and q."""
    cosine2 = 1.0 / (1.0 + bend * square)
    value = reduced * np.sqrt(cosine2)
    return value, value * cosine2


def first_tangent(x: FloatArray, bulge: Height) -> FloatArray:
    """Return t from x = R / A, F(t) = A t - B t³ + ..., to third order: x + (B / A) x³."""
    return x * (1.0 + x * x * bulge)


def apparent_radius(t: FloatArray, whole: Height, k: float, q: float) -> FloatArray:
    """Return R bar from t, the height of all layers, and k and q of the first: Maas Eq. (2)."""
    return whole * (k * t / np.sqrt(1.0 + q * t * t))


def ratios(index: float, lowest: float) -> tuple[float, float]:
    """Return k = n_min / n and q = 1 - k², the latter without cancellation."""
    return lowest / index, (index - lowest) * (index + lowest) / index**2


def solve(
    radius: FloatArray,
    heights: list[FloatArray],
    indices: Sequence[float],
    *,
    results: int = 1,
    row_solver: RowSolver | None = None,
    block: int = BLOCK,
) -> FloatArray:
    """Return the shifted radius, or whatever a row solver makes, shape (results, ...).

    Parameters
    ----------
    radius : ndarray, shape (...)
        R, not negative.
    heights : list of ndarray
        Height of each layer, of shapes that broadcast with radius.
    indices : sequence of float
        Refractive index of each layer.
    results : int
        How many of the row solver's results are wanted.
    row_solver : callable, optional
        What solves a row of at most ``block`` elements, by default `solve_row`.
    block : int
        Elements of a row.
    """
    fixed = [h.item() if h.size == 1 else None for h in heights]
    varying = [h for h, f in zip(heights, fixed, strict=True) if f is None]
    shape = np.broadcast_shapes(radius.shape, *(h.shape for h in heights))
    outputs = np.empty((results, *shape))
    targets = [outputs[k, ...] for k in range(results)]
    count = 1 + len(varying)
    with np.errstate(all="ignore"):
        if len(shape) == 1 and shape[0] <= block and all(len(h) == shape[0] for h in varying):
            # One row as it is: for a few points the walk would take as long as the work.
            moving = iter(varying)
            layers = [next(moving) if f is None else f for f in fixed]
            goal = radius if radius.shape == shape else np.broadcast_to(radius, shape)
            solution = (row_solver or solve_row)(goal, layers, indices)
            for target, values in zip(targets, solution, strict=False):
                target[...] = values
            return outputs
        for row in contiguous_rows((radius, *varying), targets, size=block):
            moving = iter(row[1:count])
            layers = [next(moving) if f is None else f for f in fixed]
            solution = (row_solver or solve_row)(row[0], layers, indices)
            for target, values in zip(row[count:], solution, strict=False):
                target[...] = values
    return outputs


def solve_row(radius: FloatArray, heights: list[Height], indices: Sequence[float]) -> Row:
    """Return shifted radius, t and the lowest index for one row of elements."""
    # Only zero is absent: an unknown height (NaN) stays, and makes the result unknown.
    present = [
        (h, n) for h, n in zip(heights, indices, strict=True) if not isinstance(h, float) or h != 0
    ]
    lowest = min([indices[0], *(n for _, n in present)])
    straight = sum((h for h, n in present if n == lowest), 0.0)
    bent = [(h * k, q) for h, n in present for k, q in (ratios(n, lowest),) if q > 0]

    t = _root(radius, straight, bent)
    _finish_ill_conditioned(t, radius, present, straight, bent, lowest)
    whole = sum((h for h, _ in present), 0.0)
    # In the layer of t itself nothing can overflow: t may be anything there.
    radius_bar = (
        whole * t
        if indices[0] == lowest
        else apparent_radius(t, whole, *ratios(indices[0], lowest))
    )
    belongs: Height = lowest
    gone = np.flatnonzero(straight == 0) if isinstance(straight, np.ndarray) else ()
    if len(gone) and lowest < indices[0]:
        # Here the layer of the lowest index has no height: it is absent, the next one limits.
        part = [h[gone] if isinstance(h, np.ndarray) else h for h in heights]
        part = [0.0 if n == lowest else h for h, n in zip(part, indices, strict=True)]
        belongs = np.full(radius.shape, lowest)
        radius_bar[gone], t[gone], belongs[gone] = solve_row(radius[gone], part, indices)
    return radius_bar, t, belongs


def ray_sums(
    t: FloatArray, straight: Height, bent: Iterable[tuple[Height, float]]
) -> tuple[FloatArray, FloatArray]:
    """Return F(t) / t and F'(t) from the height of straight layers and (h k, q) of bending ones."""
    square = t * t
    value = slope = np.asarray(straight)
    for reduced, bend in bent:
        by_value, by_slope = layer_terms(square, reduced, bend)
        value = value + by_value
        slope = slope + by_slope
    return value, slope


def _root(radius: FloatArray, straight: Height, bent: list[tuple[Height, float]]) -> FloatArray:
    """Return the root t of F(t) = radius; NaN where none is."""
    if not bent:
        return radius / straight
    linear = straight + sum(reduced for reduced, _ in bent)
    x = radius / linear
    if _largest(x) < NEAR_AXIS:
        t = first_tangent(x, 0.5 * sum(reduced * q for reduced, q in bent) / linear)
    else:
        # F(t) <= straight t + sum(h k / sqrt(q)): for oblique rays the better lower bound.
        ceiling = sum(reduced * q**-0.5 for reduced, q in bent)
        t = np.fmax(x, (radius - ceiling) / straight)
        if np.any(straight == 0):
            t = np.where(straight == 0, np.where(radius < ceiling, x, np.nan), t)
    for _ in range(MAX_STEPS):
        value, slope = ray_sums(t, straight, bent)
        step = (radius - value * t) / slope
        t += step
        if not (np.abs(step) > LAST_STEP * t).any():
            break
    return t


def _finish_ill_conditioned(
    t: FloatArray,
    radius: FloatArray,
    present: list[tuple[Height, float]],
    straight: Height,
    bent: list[tuple[Height, float]],
    lowest: float,
) -> None:
    """Polish, in place, roots whose relative error is many times that of R.

    ``R / (t F')`` is the condition number of t. It exceeds `BENIGN` only at steep t, so ordinary
    blocks leave after one comparison.
    """
    if not _largest(t) ** 2 > BENIGN:
        return
    slope = ray_sums(t, straight, bent)[1]
    where = np.flatnonzero((radius > BENIGN * t * slope) & (t < 1e100))
    if not len(where):
        return

    def part(height: Height) -> Height:
        return height[where] if isinstance(height, np.ndarray) else height

    layers, bends = [(part(h), n) for h, n in present], [(part(h), q) for h, q in bent]
    root, goal, slope = t[where], radius[where], slope[where]
    for _ in range(8):
        step = _residual(root, goal, layers, lowest) / slope
        root = root + step
        slope = ray_sums(root, part(straight), bends)[1]
        if not (np.abs(step) > 1e-12 * root).any():
            break
    t[where] = root


def _largest(values: FloatArray) -> float:
    """Return the largest value, at least 0; one NaN must not decide how its neighbours fare."""
    return float(np.fmax.reduce(values, initial=0.0))


def _residual(
    t: FloatArray, radius: FloatArray, present: list[tuple[Height, float]], lowest: float
) -> FloatArray:
    """Return R - F(t), formed with twice the digits."""
    rest = dd.exact(radius)
    square = dd.product(t, t)
    for height, n in present:
        excess = dd.subtract(dd.product(n, n), dd.product(lowest, lowest))
        below = dd.square_root(dd.add(dd.product(n, n), dd.multiply(excess, square)))
        above = dd.multiply(dd.product(height, lowest), dd.exact(t))
        rest = dd.subtract(rest, dd.divide(above, below))
    return rest.high
