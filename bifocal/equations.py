r"""Midulla's equations (1) to (7), one function each, in the order of the paper.

What runs is this or `bifocal.rays`, which writes the same equations for two nadir points and for
arrays of any precision; tests hold the two, and the dense matching built on them, equal.

All lengths on the image share one unit, all lengths on the object another; the equations hold for
any. Relief r is positive towards the cameras, displacement e positive outwards. Camera 1 is the
far one: d1 > d2.

References
----------
.. [1] P. Midulla, "Bifocal pairs of images for low-cost survey in close range photogrammetry".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from bifocal.remarks import remark
from photocore.arrays import FloatArray, all_positive, as_floats, check_shapes
from photocore.errors import GeometryError
from photocore.series import keeps_index


@keeps_index
def relief_displacement(s: ArrayLike, r: ArrayLike, *, d: ArrayLike) -> FloatArray:
    r"""Relief displacement e of points of known relief.

    Parameters
    ----------
    s : array_like, shape (...)
        Distance from the nadir point to the displaced image point. [mm]
    r : array_like, shape (...)
        Relief, positive towards the camera. [m]
    d : float or array_like, shape (...)
        Distance of the projection centre to the reference plane. [m]

    Returns
    -------
    e : ndarray, shape (...)
        Displacement, positive outwards. [unit of s]

    Raises
    ------
    InputError
        If d is not a positive number.

    Notes
    -----
    Eq. (1) of [1]_, :math:`e = s r / d`; Eq. (3) is this, once per image.

    References
    ----------
    .. [1] Midulla, Sect. 2.3.

    Examples
    --------
    A point 1 m before the wall, 4 mm off the nadir, camera at 16 m:

    >>> float(relief_displacement(4.0, 1.0, d=16.0))
    0.25
    """
    # Eq. (1)
    s, r, d = as_floats(s, "s"), as_floats(r, "r"), all_positive(d, "d", unit="m")
    check_shapes(s=s, r=r, d=d)
    return np.asarray(s * r / d)


@keeps_index
def relief_from_displacement(s: ArrayLike, e: ArrayLike, *, d: ArrayLike) -> FloatArray:
    r"""Relief of points whose displacement on one image is known.

    Parameters
    ----------
    s, e : array_like, shape (...)
        Distance from the nadir to the displaced point, and its displacement. [mm]
    d : float or array_like, shape (...)
        Distance of the projection centre to the reference plane. [m]

    Returns
    -------
    r : ndarray, shape (...)
        Relief; NaN at the nadir point (s = 0). [m]

    Raises
    ------
    InputError
        If d is not a positive number.

    Notes
    -----
    Eq. (2) of [1]_, :math:`r = d e / s`; Eq. (4) is this, once per image.

    References
    ----------
    .. [1] Midulla, Sect. 2.3.

    Examples
    --------
    >>> float(relief_from_displacement(4.0, 0.25, d=16.0))
    1.0
    """
    s, e, d = as_floats(s, "s"), as_floats(e, "e"), all_positive(d, "d", unit="m")
    check_shapes(s=s, e=e, d=d)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(s == 0, np.nan, d * e / s)  # Eq. (2)


@keeps_index
def relief(s1: ArrayLike, s2: ArrayLike, *, d1: ArrayLike, d2: ArrayLike) -> FloatArray:
    r"""Relief of points seen at radial distances s1 and s2 on a bifocal pair.

    Parameters
    ----------
    s1, s2 : array_like, shape (...)
        Distance from the nadir point to the same point on images 1 and 2, free of lens
        distortion. [mm, or any unit common to both]
    d1, d2 : float or array_like, shape (...)
        Distance of projection centres 1 and 2 to the reference plane, d1 > d2. [m]

    Returns
    -------
    r : ndarray, shape (...)
        Relief, positive towards the cameras. NaN where undefined: at the nadir point, for a
        negative radial distance, and where the two rays do not meet before the near camera
        (s1 / d1 >= s2 / d2). [unit of d1, d2]

    Raises
    ------
    GeometryError
        If d1 is not above d2: camera 1 is the far one.
    InputError
        If d1 or d2 is not a positive number.

    Notes
    -----
    Eq. (6) of [1]_ solved for r; exact, not an approximation for small relief:

    .. math:: r = (s_2 - s_1) / (s_2 / d_2 - s_1 / d_1)

    References
    ----------
    .. [1] Midulla, Sect. 2.4.

    Examples
    --------
    A point 2 m from the nadir, standing out 1 m, with 35 mm / 17.5 m and 19 mm / 9.5 m:

    >>> round(float(relief(35 * 2 / 16.5, 19 * 2 / 8.5, d1=17.5, d2=9.5)), 9)
    1.0
    """
    s1, s2 = as_floats(s1, "s1"), as_floats(s2, "s2")
    d1, d2 = _distances(d1, d2)
    check_shapes(s1=s1, s2=s2, d1=d1, d2=d2)
    rate = s2 / d2 - s1 / d1
    with np.errstate(divide="ignore", invalid="ignore"):
        # r - d2 = -s1 (d1 - d2) / (d1 rate): only a positive rate meets before camera 2.
        return np.where((s1 > 0) & (rate > 0), (s2 - s1) / rate, np.nan)  # Eq. (6)


@keeps_index
def relief_displacements(
    s1: ArrayLike, s2: ArrayLike, *, d1: ArrayLike, d2: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    r"""Relief displacements e1 and e2 of points seen on a bifocal pair.

    Parameters
    ----------
    s1, s2 : array_like, shape (...)
        As in `relief`. [mm]
    d1, d2 : float or array_like, shape (...)
        As in `relief`. [m]

    Returns
    -------
    e1, e2 : ndarray, shape (...)
        Displacements, positive outwards; e2 = e1 + (s2 - s1). NaN where `relief` is. [unit of s]

    Raises
    ------
    GeometryError, InputError
        As `relief`.

    Notes
    -----
    Eq. (5) of [1]_, :math:`e_1 = s_1 r / d_1` and :math:`e_1 + \Delta s = s_2 r / d_2`, solved for
    both unknowns.

    References
    ----------
    .. [1] Midulla, Sect. 2.4.

    Examples
    --------
    >>> e1, e2 = relief_displacements(35 * 2 / 16.5, 19 * 2 / 8.5, d1=17.5, d2=9.5)
    >>> round(float(e1), 6), round(float(e2), 6)
    (0.242424, 0.470588)
    """
    r = relief(s1, s2, d1=d1, d2=d2)
    return relief_displacement(s1, r, d=d1), relief_displacement(s2, r, d=d2)  # Eq. (5)


@keeps_index
def plane_coordinates(
    s: ArrayLike, e: ArrayLike, theta: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    r"""Corrected image coordinates x', y' of a displaced point.

    Parameters
    ----------
    s : array_like, shape (...)
        Radial distance measured on one image. [mm]
    e : array_like, shape (...)
        Relief displacement on the same image. [mm]
    theta : array_like, shape (...)
        Direction of the point seen from the nadir, clockwise from +y. [rad]

    Returns
    -------
    x, y : ndarray, shape (...)
        Coordinates of the orthogonal projection on the image: :math:`s' = s - e` in components.
        Times the scale number / 1000 they are metres on the wall. [unit of s]

    Notes
    -----
    Eq. (7) of [1]_: :math:`x = s' \sin\theta`, :math:`y = s' \cos\theta`. The sine belongs to x
    because theta is an azimuth, not the mathematical angle (docs/errata.md).

    References
    ----------
    .. [1] Midulla, Sect. 2.6.

    Examples
    --------
    >>> x, y = plane_coordinates(5.0, 1.0, 0.0)
    >>> float(x), float(y)
    (0.0, 4.0)
    """
    s, e, theta = as_floats(s, "s"), as_floats(e, "e"), as_floats(theta, "theta")
    check_shapes(s=s, e=e, theta=theta)
    s_prime = s - e
    return np.asarray(s_prime * np.sin(theta)), np.asarray(s_prime * np.cos(theta))  # Eq. (7)


def _distances(d1: ArrayLike, d2: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return both distances, the far camera's first; one for all points or one for each."""
    far, near = all_positive(d1, "d1", unit="m"), all_positive(d2, "d2", unit="m")
    check_shapes(d1=far, d2=near)
    if (far > near).all():
        return far, near
    both = np.broadcast_arrays(far, near)
    one, other = (float(array[~(both[0] > both[1])].flat[0]) for array in both)
    if one == other:
        raise GeometryError(remark("equations.one_distance", one=one))
    raise GeometryError(remark("equations.exchanged", one=one, other=other))
