r"""Snell's law for angles and for direction vectors; Maas 2015, Eq. (3).

References
----------
.. [1] Maas, "On the accuracy potential in underwater/multimedia photogrammetry", Sensors 2015.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats, as_points


def refracted_angle(beta: ArrayLike, *, n_from: ArrayLike, n_to: ArrayLike) -> FloatArray:
    r"""Angle to the normal after an interface.

    Parameters
    ----------
    beta : array_like, shape (...)
        Angle to the normal before it. [rad]
    n_from, n_to : array_like, shape (...)
        Refractive indices before and after.

    Returns
    -------
    beta_after : ndarray, shape (...)
        NaN where the light is totally reflected. [rad]

    Notes
    -----
    Eq. (3) of [1]_: :math:`n_1 \sin\beta_1 = n_2 \sin\beta_2`.

    References
    ----------
    .. [1] Maas 2015, Sect. 2.

    Examples
    --------
    >>> round(float(np.degrees(refracted_angle(np.radians(30), n_from=1.0, n_to=1.3368))), 4)
    21.9642
    """
    sine = as_floats(n_from, "n_from") / as_floats(n_to, "n_to") * np.sin(as_floats(beta, "beta"))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.arcsin(sine))


def critical_angle(*, n_from: ArrayLike, n_to: ArrayLike) -> FloatArray:
    r"""Angle to the normal beyond which light is totally reflected.

    Parameters
    ----------
    n_from, n_to : array_like, shape (...)
        Refractive indices before and after the interface.

    Returns
    -------
    angle : ndarray, shape (...)
        A right angle where the second medium is the denser one: nothing is reflected totally. [rad]

    Examples
    --------
    The circle of vision of a diver looking up:

    >>> round(float(np.degrees(critical_angle(n_from=1.333, n_to=1.0))), 2)
    48.61
    """
    ratio = as_floats(n_to, "n_to") / as_floats(n_from, "n_from")
    return np.asarray(np.arcsin(np.minimum(ratio, 1.0)))


def refracted_direction(
    direction: ArrayLike, normal: ArrayLike, *, n_from: ArrayLike, n_to: ArrayLike
) -> FloatArray:
    r"""Direction of a ray after an interface of any tilt.

    Parameters
    ----------
    direction : array_like, shape (..., 3)
        Direction of travel, any length.
    normal : array_like, shape (..., 3)
        Normal of the interface, any length, either side.
    n_from, n_to : array_like, shape (...)
        Refractive indices before and after.

    Returns
    -------
    refracted : ndarray, shape (..., 3)
        Unit vectors; NaN where the light is totally reflected.

    Raises
    ------
    InputError
        If the last axis is not 3.

    Notes
    -----
    The part of :math:`n d` along the interface is kept, the part along the normal follows from the
    length. It is formed as :math:`\sqrt{c^2 + (n_2^2 - n_1^2)}` of the old part c, not through
    angles, so rays along the normal and near grazing lose no digits.

    Examples
    --------
    >>> d = refracted_direction([0.6, 0.0, -0.8], [0, 0, 1], n_from=1.0, n_to=1.5)
    >>> [round(float(v), 6) for v in d]
    [0.4, 0.0, -0.916515]
    """
    ray = as_points(direction, "direction", dimension=3)
    axis = as_points(normal, "normal", dimension=3)
    n1 = as_floats(n_from, "n_from")[..., None]
    n2 = as_floats(n_to, "n_to")[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
        axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
        before = n1 * np.sum(ray * axis, axis=-1, keepdims=True)
        after = np.copysign(np.sqrt(before**2 + (n2 - n1) * (n2 + n1)), before)
        # after - before, without the cancellation between nearly equal media
        change = np.where(n1 == n2, 0.0, (n2 - n1) * (n2 + n1) / (after + before))
        return np.asarray((n1 * ray + change * axis) / n2)
