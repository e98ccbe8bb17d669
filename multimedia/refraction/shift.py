r"""Radial shift through any number of plane-parallel layers, exactly.

A ray from the camera crosses layers of height :math:`h_i` and refractive index :math:`n_i`. With
the angle :math:`\beta_i` to the normal in each (Maas 2015, Eqs. 1 to 3):

.. math:: R = \sum_i h_i \tan\beta_i, \qquad \bar R = \Bigl(\sum_i h_i\Bigr) \tan\beta_1, \qquad
          n_1 \sin\beta_1 = n_2 \sin\beta_2 = \dots

`multimedia.refraction.tangent` finds the root of the first equation, exactly.

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

from multimedia.refraction.shift_slopes import BLOCK, slopes_row
from multimedia.refraction.tangent import solve
from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats
from photocore.errors import InputError


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
    radius: ArrayLike,
    heights: Sequence[ArrayLike],
    indices: Sequence[float],
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
        Shifted radius. NaN where radius, a height or an index is NaN, and where no ray exists: a
        camera that touches the first interface (z0 = 0) from the thinnest medium sees nothing
        beyond a largest radius. [unit of radius]

    Raises
    ------
    InputError
        If a radius or height is negative, or the numbers of heights and indices differ.

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
    return np.asarray(solve(*_checked(radius, heights, indices), indices)[0])


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
    return ratio_of(*_checked(radius, heights, indices), indices)


def ratio_of(radius: FloatArray, layers: list[FloatArray], indices: Sequence[float]) -> FloatArray:
    """Return `shift_ratio` of what is known to be possible."""
    radius_bar = np.asarray(solve(radius, layers, indices)[0])
    whole = np.asarray(sum(layers))
    if (radius > 1e-9 * whole).all():
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(radius_bar / radius)
    limit = _axis_limit(layers, indices)
    # The ratio leaves its limit with (R / whole)², which is beyond the last digit here.
    # "Not far" rather than "near", so that an unknown radius or height (NaN) gets no limit.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(radius <= 1e-9 * whole, limit, radius_bar / radius)


def axis_ratio(heights: Sequence[ArrayLike], indices: Sequence[float]) -> FloatArray:
    r"""Limit of :math:`\bar R / R` for R to 0; 1 where all heights are zero."""
    return _axis_limit(as_layers(heights, indices), indices)


def _axis_limit(layers: list[FloatArray], indices: Sequence[float]) -> FloatArray:
    """Return `axis_ratio` of what is known to be possible."""
    whole = np.asarray(sum(layers))
    reduced = np.asarray(sum(h * (indices[0] / n) for h, n in zip(layers, indices, strict=True)))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(reduced == 0, 1.0, whole / reduced)


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
        Where no ray exists, or radius or a height is NaN, everything is NaN.

    Raises
    ------
    InputError
        As `shifted_radius`.

    Notes
    -----
    Closed forms in blocks, see `multimedia.refraction.shift_slopes`.

    Examples
    --------
    Raising the index of the water by 0.001 moves the apparent point outwards by 0.06 mm:

    >>> d = shift_derivatives(300.0, [500.0, 10.0, 200.0], [1.0, 1.5, 1.337])
    >>> round(float(d.d_indices[2]) * 0.001, 2)
    0.06
    """
    radius, layers = _checked(radius, heights, indices)
    count = len(layers)
    solution = solve(
        radius, layers, indices, row_solver=slopes_row, results=2 + 2 * count, block=BLOCK
    )
    unknown = np.isnan(solution[0])
    if unknown.any():
        solution[:, unknown] = np.nan
    return ShiftDerivatives(
        np.asarray(solution[0]),
        np.asarray(solution[1]),
        np.moveaxis(solution[2 : 2 + count], 0, -1),
        np.moveaxis(solution[2 + count :], 0, -1),
    )


def as_layers(heights: Sequence[ArrayLike], indices: Sequence[float]) -> list[FloatArray]:
    """Return the heights of layers as arrays.

    Raises
    ------
    InputError
        If there are none, or not as many indices.
    """
    layers = [as_floats(height, f"heights[{i}]") for i, height in enumerate(heights)]
    if len(layers) != len(indices) or not layers:
        raise InputError(remark("layers.one_index_each", heights=len(layers), count=len(indices)))
    return layers


def _checked(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float]
) -> tuple[FloatArray, list[FloatArray]]:
    """Return radius and heights as arrays, refusing what no set-up can mean."""
    radius, layers = as_floats(radius, "radius"), as_layers(heights, indices)
    for name, array in [("radius", radius), *((f"heights[{i}]", h) for i, h in enumerate(layers))]:
        least = np.fmin.reduce(array, axis=None, initial=np.inf)
        if least < 0:
            raise InputError(f"{name}: a distance cannot be negative, found {least:g}.")
    if np.isnan(np.asarray(indices, dtype=np.float64)).any():
        radius = np.full_like(radius, np.nan)
    return radius, layers
