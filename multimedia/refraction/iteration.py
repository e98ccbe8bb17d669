r"""The iteration of the papers, step by step as printed, with its epsilon and over-compensation.

`multimedia.refraction.shift` solves the same equations to the last digit and for more set-ups. This
module is for following the papers, for checking other programs, and for teaching.

References
----------
.. [1] Maas, "A modular geometric model for underwater photogrammetry", ISPRS Archives XL-5/W5,
   2015, Sect. 2 and 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from multimedia.refraction.shift import as_layers, axis_ratio
from photocore.arrays import BoolArray, FloatArray, IntArray, as_floats, positive


class ShiftIteration(NamedTuple):
    """What the iteration found.

    Attributes
    ----------
    radius_bar : ndarray, shape (...)
        Shifted radius; NaN where the iteration ran into total reflection. [unit of radius]
    iterations : ndarray of int, shape (...)
        How often the angles were computed.
    converged : ndarray of bool, shape (...)
        Whether the last correction was below the tolerance.
    """

    radius_bar: FloatArray
    iterations: IntArray
    converged: BoolArray


def iterated_radius(
    radius: ArrayLike,
    heights: Sequence[ArrayLike],
    indices: Sequence[float],
    *,
    tolerance: float = 1e-7,
    over_compensation: float | None = 1.0,
    max_iterations: int = 200,
) -> ShiftIteration:
    r"""Shift radially by the iteration of the papers.

    Parameters
    ----------
    radius : array_like, shape (...)
        Horizontal distance R from the camera's nadir to the point.
    heights : sequence of array_like, each of a shape that broadcasts with radius
        Heights of the layers from camera to point: z0, thicknesses, zp.
    indices : sequence of float
        Refractive index of each layer.
    tolerance : float
        Epsilon: the iteration of a point stops when the correction is smaller. The papers take
        0.0001 mm, which is 1e-7 where lengths are in metres. [unit of radius]
    over_compensation : float or None
        Factor on every correction; 1 is the plain iteration. None chooses it for every point as
        `best_over_compensation`.
    max_iterations : int
        Where to give up.

    Returns
    -------
    ShiftIteration

    Raises
    ------
    InputError
        If the tolerance or the factor is not positive, or heights and indices differ in number.

    Notes
    -----
    With :math:`\bar R_{(0)} = R`, repeated for :math:`\beta_1 = \arctan(\bar R / \sum h_i)`,
    :math:`\beta_i = \arcsin(n_1 \sin\beta_1 / n_i)`,
    :math:`\Delta R = R - \sum h_i \tan\beta_i` and :math:`\bar R \leftarrow \bar R + f \Delta R`
    until :math:`|\Delta R| < \epsilon`. The papers print :math:`\Delta R < \epsilon`, which stops
    at once when the correction is negative (docs/errata.md).

    An error shrinks by the factor :math:`1 - f\,\partial R/\partial\bar R` per step: the plain
    iteration is slow where the ray runs mostly in water, hardly improvable where it runs mostly
    in air, and does not converge at all for a camera in the denser medium looking far out.

    Examples
    --------
    A camera 100 mm above 10 mm of glass and 500 mm of water; plain, and with the factor chosen:

    >>> heights, indices = (100.0, 10.0, 500.0), (1.0, 1.5, 1.34)
    >>> plain = iterated_radius(150.0, heights, indices, tolerance=1e-4)
    >>> fast = iterated_radius(150.0, heights, indices, tolerance=1e-4, over_compensation=None)
    >>> int(plain.iterations), int(fast.iterations)
    (11, 4)
    """
    goal = as_floats(radius, "radius")
    layers = as_layers(heights, indices)
    positive(tolerance, "tolerance")
    if over_compensation is None:
        factor = best_over_compensation(goal, layers, indices)
    else:
        factor = np.asarray(positive(over_compensation, "over_compensation"))
    shape = np.broadcast_shapes(goal.shape, *(h.shape for h in layers))
    goal, factor = (np.broadcast_to(a, shape).ravel() for a in (goal, factor))
    layers = [np.broadcast_to(h, shape).ravel() for h in layers]
    whole = np.asarray(sum(layers))

    bar, count = goal.copy(), np.zeros(goal.shape, dtype=np.int64)
    correction = np.full(goal.shape, np.inf)
    for _ in range(max_iterations):
        active = np.flatnonzero(np.abs(correction) >= tolerance)
        if not len(active):
            break
        with np.errstate(invalid="ignore", divide="ignore"):
            beta1 = np.arctan(bar[active] / whole[active])
            reached = np.zeros(len(active))
            for height, index in zip(layers, indices, strict=True):
                beta = np.arcsin(indices[0] / index * np.sin(beta1))
                reached += height[active] * np.tan(beta)
        correction[active] = goal[active] - reached
        bar[active] += factor[active] * correction[active]
        count[active] += 1
    return ShiftIteration(
        bar.reshape(shape), count.reshape(shape), (np.abs(correction) < tolerance).reshape(shape)
    )


def best_over_compensation(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float]
) -> FloatArray:
    r"""Return the factor at which the iteration of a point hardly has anything left to do.

    Parameters
    ----------
    radius, heights, indices
        As in `iterated_radius`.

    Returns
    -------
    factor : ndarray, shape (...)
        Estimate of :math:`\partial\bar R/\partial R`: 1 in one medium, about 1.34 in pure water,
        larger for oblique rays, NaN where radius or a height is NaN.

    Notes
    -----
    The ideal factor is :math:`\partial\bar R/\partial R` at the solution. It is taken where
    paraxial optics puts the point, :math:`\bar R \approx R \sum h_i / \sum (h_i n_1 / n_i)`, with
    the weights :math:`1 / \cos^3\beta_i` of `multimedia.refraction.shift.shift_derivatives`.

    Examples
    --------
    >>> float(best_over_compensation(150.0, (100.0, 10.0, 500.0), (1.0, 1.5, 1.34)).round(3))
    1.337
    """
    layers = as_layers(heights, indices)
    on_axis = axis_ratio(layers, indices)
    whole = np.asarray(sum(layers))
    with np.errstate(invalid="ignore", divide="ignore"):
        tangent = on_axis * as_floats(radius, "radius") / whole
        sine = tangent / np.sqrt(1 + tangent**2)
        steps = sum(
            height * indices[0] / index / (1 - (indices[0] / index * sine) ** 2) ** 1.5
            for height, index in zip(layers, indices, strict=True)
        )
        factor = whole / (1 - sine**2) ** 1.5 / steps
    # Beyond total reflection the estimate fails, and so will the iteration; start it safely.
    factor = np.where(np.isfinite(factor), factor, on_axis)
    return np.where(np.isnan(as_floats(radius, "radius") * whole), np.nan, factor)
