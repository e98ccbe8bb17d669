r"""Radial shift through any number of plane-parallel layers, exactly.

A ray from the camera crosses layers of height :math:`h_i` and refractive index :math:`n_i`. With
the angle :math:`\beta_i` to the normal in each (Maas 2015, Eqs. 1 to 3):

.. math:: R = \sum_i h_i \tan\beta_i, \qquad \bar R = \Bigl(\sum_i h_i\Bigr) \tan\beta_1, \qquad
          n_1 \sin\beta_1 = n_2 \sin\beta_2 = \dots

The unknown here is :math:`t = \tan\beta` in the layer of the *lowest* index, because there the
angle is largest and R runs through all values as t does:

.. math:: F(t) = \sum_i \frac{h_i t}{\sqrt{a_i + b_i t^2}} = R, \qquad
          a_i = n_i^2 / n_{min}^2, \quad b_i = a_i - 1 .

F increases and is concave, so Newton's method approaches the root from below whatever the set-up:
it cannot diverge, overshoot into total reflection, or stop at a wrong value.

All heights and radii share one unit, any.

References
----------
.. [1] Maas, "On the accuracy potential in underwater/multimedia photogrammetry", Sensors 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats
from photocore.errors import InputError

#: Elements worked on at a time: the dozen scratch rows stay in the processor's second-level cache.
BLOCK = 4096

#: A Newton step that changes t by less than this share leaves an error of 1.5e-18 (the factor of
#: the quadratic convergence is at most 1.5 for every set-up).
LAST_STEP = 1e-9

#: Seen at most: 12 steps in ordinary set-ups, 60 within 1e-15 of the limit of vision.
MAX_STEPS = 200

_Height = float | FloatArray


class ShiftDerivatives(NamedTuple):
    """The shifted radius and its derivatives; m layers from the camera to the point.

    Attributes
    ----------
    radius_bar : ndarray, shape (...)
        Shifted radius. [unit of the heights]
    d_radius : ndarray, shape (...)
        With respect to R. [-]
    d_heights : ndarray, shape (..., m)
        With respect to every height: z0, thicknesses, zp. [-]
    d_indices : ndarray, shape (..., m)
        With respect to every refractive index. [unit of the heights]
    """

    radius_bar: FloatArray
    d_radius: FloatArray
    d_heights: FloatArray
    d_indices: FloatArray


def shifted_radius(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float]
) -> FloatArray:
    r"""Radius :math:`\bar R` at which the point would lie if its ray went straight on.

    Parameters
    ----------
    radius : array_like, shape (...)
        Horizontal distance R from the camera's nadir to the point, not negative.
    heights : sequence of array_like, each of a shape that broadcasts with radius
        Heights of the layers from camera to point, not negative: z0, thicknesses, zp.
    indices : sequence of float
        Refractive index of each layer.

    Returns
    -------
    radius_bar : ndarray, shape (...)
        Shifted radius. NaN only where no ray exists: a camera that touches the first interface
        (z0 = 0) from the thinnest medium sees nothing beyond a largest radius. [unit of radius]

    Raises
    ------
    InputError
        If a radius or height is negative or the numbers of heights and indices differ.

    Notes
    -----
    Eqs. (1) to (3) of [1]_ without their iteration; see the head of this module. Layers of height
    zero count as absent.

    References
    ----------
    .. [1] Maas 2015, Sensors 15(8), Sect. 2.

    Examples
    --------
    Straight through when all indices are equal:

    >>> float(shifted_radius(0.3, [0.5, 0.01, 0.2], [1.0, 1.0, 1.0]))
    0.3

    One interface, air above water: 45 degrees in air are 32.04 degrees in water, so a point
    1 m + tan(32.04 deg) m off is seen at 2 m:

    >>> round(float(shifted_radius(1.62584, [1.0, 1.0], [1.0, 1.3329])), 4)
    2.0
    """
    radius, layers = _checked(radius, heights, indices)
    return _solve(radius, layers, indices, tangent=False)[0]


def shift_ratio(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float]
) -> FloatArray:
    r"""Ratio :math:`\bar R / R`, with its finite limit on the axis.

    Parameters
    ----------
    radius, heights, indices
        As in `shifted_radius`.

    Returns
    -------
    ratio : ndarray, shape (...)
        At R = 0 the limit :math:`\sum h_i / \sum (h_i n_1 / n_i)`. [-]

    Raises
    ------
    InputError
        As `shifted_radius`.

    Examples
    --------
    Looking straight down, water 1.333 deep seems 1.0 deep, so things 1 m under air 1 m seem
    (1 + 1) / (1 + 1 / 1.333) further out:

    >>> round(float(shift_ratio(0.0, [1.0, 1.0], [1.0, 1.333])), 6)
    1.142735
    """
    radius, layers = _checked(radius, heights, indices)
    radius_bar, _, _ = _solve(radius, layers, indices, tangent=False)
    limit = axis_ratio(layers, indices)
    # Below 1e-150 the square of t is lost, and the limit is exact to the last digit anyway.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(radius > 1e-150, radius_bar / radius, limit)


def axis_ratio(heights: Sequence[ArrayLike], indices: Sequence[float]) -> FloatArray:
    r"""Limit of :math:`\bar R / R` for R to 0; 1 where all heights are zero."""
    whole = sum((as_floats(h, "heights") for h in heights), np.zeros(()))
    reduced = sum(
        (as_floats(h, "heights") * (indices[0] / n) for h, n in zip(heights, indices, strict=True)),
        np.zeros(()),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(reduced > 0, whole / reduced, 1.0)


def shift_derivatives(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float]
) -> ShiftDerivatives:
    r"""Shifted radius with its analytic derivatives.

    Parameters
    ----------
    radius, heights, indices
        As in `shifted_radius`.

    Returns
    -------
    ShiftDerivatives
        Where no ray exists everything is NaN.

    Raises
    ------
    InputError
        As `shifted_radius`.

    Notes
    -----
    Both R and :math:`\bar R` are functions of the invariant :math:`p = n_i \sin\beta_i`. With
    :math:`T_i = \tan\beta_i`, :math:`c_i = \cos\beta_i`:

    .. math:: D = \frac{\partial\bar R}{\partial R}
                = \frac{H / (n_1 c_1^3)}{\sum h_i / (n_i c_i^3)}, \quad
              \frac{\partial\bar R}{\partial h_i} = T_1 - D T_i, \quad
              \frac{\partial\bar R}{\partial n_i}
                = D \frac{h_i T_i}{n_i c_i^2} - [i = 1] \frac{H T_1}{n_1 c_1^2}

    with :math:`H = \sum h_i`.

    Examples
    --------
    Raising the index of the water by 0.001 moves the apparent point outwards by 0.06 mm:

    >>> d = shift_derivatives(300.0, [500.0, 10.0, 200.0], [1.0, 1.5, 1.337])
    >>> round(float(d.d_indices[2]) * 0.001, 2)
    0.06
    """
    radius, layers = _checked(radius, heights, indices)
    radius_bar, t, lowest = _solve(radius, layers, indices, tangent=True)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        tangents = [
            lowest * t / np.sqrt(n**2 + (n - lowest) * (n + lowest) * t**2) for n in indices
        ]
        whole = sum(layers, np.zeros(()))
        slope = sum(
            (
                np.where(height > 0, height / n * (1 + tangent**2) ** 1.5, 0.0)
                for height, n, tangent in zip(layers, indices, tangents, strict=True)
            ),
            np.zeros(()),
        )
        first = (1 + tangents[0] ** 2) / indices[0]
        d_radius = whole * first * np.sqrt(1 + tangents[0] ** 2) / slope
        d_heights = [tangents[0] - d_radius * tangent for tangent in tangents]
        d_indices = [
            np.where(height > 0, d_radius * height * tangent * (1 + tangent**2) / n, 0.0)
            for height, n, tangent in zip(layers, indices, tangents, strict=True)
        ]
        d_indices[0] = tangents[0] * first * (d_radius * layers[0] - whole)
    shape = radius_bar.shape
    return ShiftDerivatives(
        radius_bar,
        np.broadcast_to(d_radius, shape).copy(),
        np.stack([np.broadcast_to(d, shape) for d in d_heights], axis=-1),
        np.stack([np.broadcast_to(d, shape) for d in d_indices], axis=-1),
    )


def _checked(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float]
) -> tuple[FloatArray, list[FloatArray]]:
    """Return radius and heights as arrays, refusing what no set-up can mean."""
    radius = as_floats(radius, "radius")
    layers = [as_floats(height, f"heights[{i}]") for i, height in enumerate(heights)]
    if len(layers) != len(indices) or not layers:
        raise InputError(
            f"heights and indices: expected one refractive index per layer, found "
            f"{len(layers)} heights and {len(indices)} indices."
        )
    for name, array in [("radius", radius), *((f"heights[{i}]", h) for i, h in enumerate(layers))]:
        if array.size and array.min() < 0:
            raise InputError(f"{name}: a distance cannot be negative, found {array.min():g}.")
    return radius, layers


def _solve(
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
    present = [
        (h, n) for h, n in zip(heights, indices, strict=True) if not isinstance(h, float) or h > 0
    ]
    lowest = min([indices[0], *(n for _, n in present)])
    straight = sum((h for h, n in present if n == lowest), 0.0)
    bent = [(h, (n / lowest) ** 2, (n - lowest) * (n + lowest) / lowest**2)
            for h, n in present if n > lowest]  # fmt: skip
    first = (indices[0] / lowest) ** 2, (indices[0] - lowest) * (indices[0] + lowest) / lowest**2

    t = _tangent_of_lowest(radius, straight, bent)
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
    steepest = x.max(initial=0.0)
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
    value, slope = np.empty_like(t), np.empty_like(t)
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
        if not np.greater(value, term, out=_flags(t)).any():
            break
    return t


def _flags(t: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return scratch for a comparison."""
    return np.empty(t.shape, dtype=bool)
