r"""Root of F(t) = R: the numerical core of the radial shift, in numpy.

See `multimedia.refraction.shift` for the equations. All works on rows of a few thousand elements
with scratch that stays in the processor's cache.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photocore import double_double as twofold
from photocore.arrays import FloatArray

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

_Height = float | FloatArray


def solve(
    radius: FloatArray, heights: list[FloatArray], indices: Sequence[float], *, tangent: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the shifted radius and, if asked for, t and the index of the layer t belongs to."""
    fixed = [h.item() if h.size == 1 else None for h in heights]
    varying = [h for h, f in zip(heights, fixed, strict=True) if f is None]
    shape = np.broadcast_shapes(radius.shape, *(h.shape for h in heights))
    outputs = [np.empty(shape) for _ in range(3 if tangent else 1)]
    operands = [np.broadcast_to(a, shape) for a in (radius, *varying)] + outputs
    flags = [["readonly"]] * (1 + len(varying)) + [["writeonly"]] * len(outputs)
    # nditer hands out contiguous rows of any broadcast without ever expanding it as a whole.
    with (
        np.errstate(all="ignore"),
        np.nditer(
            operands,
            flags=["external_loop", "buffered", "zerosize_ok"],
            op_flags=flags,  # type: ignore[arg-type]  # numpy wants literals
            buffersize=BLOCK,
        ) as rows,
    ):
        for row in rows:
            moving = iter(row[1 : 1 + len(varying)])
            layers = [next(moving) if f is None else f for f in fixed]
            result = _solve_row(row[0], layers, indices)
            for target, values in zip(row[1 + len(varying) :], result, strict=False):
                target[...] = values
    if not tangent:
        return outputs[0], outputs[0], outputs[0]
    return outputs[0], outputs[1], outputs[2]


def _solve_row(
    radius: FloatArray, heights: list[_Height], indices: Sequence[float]
) -> tuple[FloatArray, FloatArray, float | FloatArray]:
    """Return shifted radius, t and the lowest index for one row of elements."""
    # Only zero is absent: an unknown height (NaN) stays, and makes the result unknown.
    present = [
        (h, n) for h, n in zip(heights, indices, strict=True) if not isinstance(h, float) or h != 0
    ]
    lowest = min([indices[0], *(n for _, n in present)])
    straight = sum((h for h, n in present if n == lowest), 0.0)
    bent = [(h, (n / lowest) ** 2, (n - lowest) * (n + lowest) / lowest**2)
            for h, n in present if n > lowest]  # fmt: skip
    first = (indices[0] / lowest) ** 2, (indices[0] - lowest) * (indices[0] + lowest) / lowest**2

    t = _tangent_of_lowest(radius, straight, bent)
    _finish_ill_conditioned(t, radius, present, lowest)
    whole = sum((h for h, _ in present), 0.0)
    if first[1] == 0:
        radius_bar = whole * t
    else:
        radius_bar = t * t
        radius_bar *= first[1]
        radius_bar += first[0]
        np.sqrt(radius_bar, out=radius_bar)
        np.divide(t, radius_bar, out=radius_bar)
        radius_bar *= whole

    belongs: float | FloatArray = lowest
    gone = np.flatnonzero(straight == 0) if isinstance(straight, np.ndarray) else ()
    if len(gone) and lowest < indices[0]:
        # Here the layer of the lowest index has no height: it is absent, the next one limits.
        part = [h[gone] if isinstance(h, np.ndarray) else h for h in heights]
        part = [0.0 if n == lowest else h for h, n in zip(part, indices, strict=True)]
        belongs = np.full(radius.shape, lowest)
        radius_bar[gone], t[gone], belongs[gone] = _solve_row(radius[gone], part, indices)
    return radius_bar, t, belongs


def _tangent_of_lowest(
    radius: FloatArray, straight: _Height, bent: list[tuple[_Height, float, float]]
) -> FloatArray:
    """Return the root t of ``straight t + sum(h t / sqrt(a + b t²)) = radius``; NaN where none is.

    Parameters
    ----------
    radius : ndarray, shape (n,)
        R.
    straight : float or ndarray, shape (n,)
        Height of the layers of the lowest index.
    bent : list of (height, a, b)
        The other layers.
    """
    if not bent:
        return radius / straight
    # F(t) = A t - B t³ + ..., so t = x + (B / A) x³ + ... with x = R / A.
    linear = straight + sum(h * a**-0.5 for h, a, _ in bent)
    inverse = 1.0 / linear
    x = radius * inverse
    steepest = _largest(x)
    t = x * x
    if steepest < 0.6:
        t *= sum(h * (0.5 * b * a**-1.5) for h, a, b in bent)
        t *= inverse
        t += 1.0
        t *= x
    else:
        # F(t) <= straight t + sum(h / sqrt(b)): for oblique rays the better lower bound.
        ceiling = sum(h * b**-0.5 for h, _, b in bent)
        t = np.fmax(x, (radius - ceiling) / straight)
        if np.any(straight == 0):
            t = np.where(straight == 0, np.where(radius < ceiling, x, np.nan), t)

    square, root, term = np.empty_like(t), np.empty_like(t), np.empty_like(t)
    value, slope, flags = np.empty_like(t), np.empty_like(t), np.empty(t.shape, dtype=bool)
    for _ in range(MAX_STEPS):
        np.multiply(t, t, out=square)
        value[...] = straight
        slope[...] = straight
        for height, a, b in bent:
            np.multiply(square, b, out=root)
            root += a
            np.sqrt(root, out=root)
            np.divide(1.0, root, out=root)  # s = 1 / sqrt(a + b t²)
            np.multiply(root, height, out=term)
            value += term  # F / t gains h s
            root *= root
            root *= a
            term *= root
            slope += term  # F' gains h a s³
        value *= t
        np.subtract(radius, value, out=value)
        value /= slope
        t += value
        np.abs(value, out=value)
        np.multiply(t, LAST_STEP, out=term)
        if not np.greater(value, term, out=flags).any():
            break
    return t


def _finish_ill_conditioned(
    t: FloatArray,
    radius: FloatArray,
    present: list[tuple[_Height, float]],
    lowest: float,
) -> None:
    """Polish, in place, roots whose relative error is many times that of R.

    ``R / (t F')`` is the condition number of t. It exceeds `BENIGN` only at steep t, so ordinary
    blocks leave after one comparison.
    """
    if not _largest(t) ** 2 > BENIGN:
        return
    slope = np.full(t.shape, 0.0)
    for height, n in present:
        slope += height * (n / lowest) ** 2 * _cosine_ratio(t, n, lowest) ** 3
    where = np.flatnonzero((radius > BENIGN * t * slope) & (t < 1e100))
    if not len(where):
        return
    part = [(h[where] if isinstance(h, np.ndarray) else h, n) for h, n in present]
    root, goal, slope = t[where], radius[where], slope[where]
    for _ in range(8):
        step = _residual(root, goal, part, lowest) / slope
        root = root + step
        slope = sum(
            (h * (n / lowest) ** 2 * _cosine_ratio(root, n, lowest) ** 3 for h, n in part),
            np.zeros(()),
        )
        if not (np.abs(step) > 1e-12 * root).any():
            break
    t[where] = root


def _largest(values: FloatArray) -> float:
    """Return the largest value, at least 0; one NaN must not decide how its neighbours fare."""
    return float(np.fmax.reduce(values, initial=0.0))


def _cosine_ratio(t: FloatArray, n: float, lowest: float) -> FloatArray:
    """Return 1 / sqrt(a + b t²) of one layer."""
    a, b = (n / lowest) ** 2, (n - lowest) * (n + lowest) / lowest**2
    return np.asarray(1 / np.sqrt(a + b * t * t))


def _residual(
    t: FloatArray, radius: FloatArray, present: list[tuple[_Height, float]], lowest: float
) -> FloatArray:
    """Return R - F(t), formed with twice the digits."""
    rest = twofold.exact(radius)
    square = twofold.product(t, t)
    for height, n in present:
        excess = twofold.subtract(twofold.product(n, n), twofold.product(lowest, lowest))
        below = twofold.square_root(
            twofold.add(twofold.product(n, n), twofold.multiply(excess, square))
        )
        above = twofold.multiply(twofold.product(height, lowest), twofold.exact(t))
        rest = twofold.subtract(rest, twofold.divide(above, below))
    return rest.high
