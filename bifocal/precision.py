r"""Precision in closed form: error propagation through Midulla's equations.

Symbols as in `bifocal.equations`. ``sigma_1`` and ``sigma_2`` are the standard deviations of the
radial distances s1 and s2, in the unit of s; ``B = d1 d2 / (d1 - d2)`` is the base factor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from bifocal.equations import relief
from bifocal.rays import reduction
from photocore.arrays import FloatArray, as_floats, positive
from photocore.errors import GeometryError


def base_factor(*, d1: float, d2: float) -> float:
    """Return B = d1 d2 / (d1 - d2): metres of relief per unit of relative radial shift.

    Raises
    ------
    GeometryError
        If d1 is not greater than d2.

    Examples
    --------
    The paper's pairs, 35/19 mm and 35/28 mm:

    >>> round(base_factor(d1=17.5, d2=9.5), 2), round(base_factor(d1=17.5, d2=14), 2)
    (20.78, 70.0)
    """
    d1, d2 = positive(d1, "d1", unit="m"), positive(d2, "d2", unit="m")
    if d1 <= d2:
        raise GeometryError(f"d1 must be greater than d2, got {d1:g} m and {d2:g} m.")
    return d1 * d2 / (d1 - d2)


def sigma_relief(
    s1: ArrayLike, s2: ArrayLike, *, d1: float, d2: float, sigma_1: float, sigma_2: float
) -> FloatArray:
    r"""Return the standard deviation of the relief from that of the radial distances.

    Parameters
    ----------
    s1, s2 : array_like, shape (...)
        Radial distances. [mm]
    d1, d2 : float
        Distances to the reference plane. [m]
    sigma_1, sigma_2 : float
        Standard deviations of s1 and s2. [unit of s]

    Returns
    -------
    sigma_r : ndarray, shape (...)
        NaN where the relief is. [m]

    Notes
    -----
    From Eq. (6) with :math:`q = s_2/d_2 - s_1/d_1`:

    .. math:: \sigma_r = \sqrt{(1 - r/d_1)^2 \sigma_1^2 + (1 - r/d_2)^2 \sigma_2^2} / |q|

    At r = 0, all error in one image: :math:`\sigma_r = \sigma B / s'`.

    Examples
    --------
    1 px of 3.69 mm on the wall in both photos, at the RMS radius of the frame (3.93 m):

    >>> near = sigma_relief(3.93, 3.93, d1=17.5, d2=9.5, sigma_1=0.00369, sigma_2=0.00369)
    >>> round(float(near) * 1000, 1)
    27.6
    """
    _, by_1, by_2 = _differentials(as_floats(s1, "s1"), as_floats(s2, "s2"), d1, d2)
    return np.asarray(np.hypot(by_1 * sigma_1, by_2 * sigma_2))


def point_covariance(
    s1: ArrayLike, s2: ArrayLike, theta: ArrayLike, *, d1: float, d2: float, sigma_1: float,
    sigma_2: float, metres: float,
) -> FloatArray:  # fmt: skip
    r"""Return the covariance of X, Y and r from the precision of the picks.

    Parameters
    ----------
    s1, s2 : array_like, shape (n,)
        Radial distances at the scale of image 1. [mm]
    theta : array_like, shape (n,)
        Direction of the point, clockwise from +y, taken from image 1. [rad]
    d1, d2 : float
        Distances to the reference plane, in either order. [m]
    sigma_1, sigma_2 : float
        Standard deviations of s1 and s2; sigma_1 also across the radius. [mm]
    metres : float
        Metres on the reference plane per millimetre of image 1.

    Returns
    -------
    covariance : ndarray, shape (n, 3, 3)
        NaN where the relief or the direction is. [m²]

    Notes
    -----
    With :math:`f_i = 1 - r/d_i` and :math:`q = s_2/d_2 - s_1/d_1`, Eqs. (6) and (7) give along the
    radius :math:`\delta s' = f_1 (s_2/d_2) \delta s_1/q - f_2 (s_1/d_1) \delta s_2/q` and
    :math:`\delta r = -f_1 \delta s_1/q + f_2 \delta s_2/q`; across it the point moves by
    :math:`f_1 \sigma_1`, since the direction is that of image 1.

    Examples
    --------
    On the plane, 4 mm right of the nadir, 0.004 mm of precision, 35/19 mm: X is good to 5 mm, Y to
    2 mm, r to 29 mm.

    >>> found = point_covariance([4], [4], [np.pi / 2], d1=17.5, d2=9.5, sigma_1=0.004,
    ...                          sigma_2=0.004, metres=0.5)
    >>> (1000 * np.sqrt(np.diagonal(found[0]))).round(1).tolist()
    [5.0, 2.0, 29.4]
    """
    s1, s2, theta = as_floats(s1, "s1"), as_floats(s2, "s2"), as_floats(theta, "theta")
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = s2 / d2 - s1 / d1
        r = np.where((s1 > 0) & (rate * (d1 - d2) > 0), (s2 - s1) / rate, np.nan)
        first = ((1 - r / d1) * sigma_1 / rate) ** 2
        second = ((1 - r / d2) * sigma_2 / rate) ** 2
    along = (first * (s2 / d2) ** 2 + second * (s1 / d1) ** 2) * metres**2
    across = ((1 - r / d1) * sigma_1 * metres) ** 2
    mixed = -(first * (s2 / d2) + second * (s1 / d1)) * metres
    sin, cos = np.sin(theta), np.cos(theta)
    xy = (along - across) * sin * cos
    rows = [
        [along * sin**2 + across * cos**2, xy, mixed * sin],
        [xy, along * cos**2 + across * sin**2, mixed * cos],
        [mixed * sin, mixed * cos, first + second + 0.0 * theta],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def sigma_displacements(
    s1: ArrayLike, s2: ArrayLike, *, d1: float, d2: float, sigma_1: float, sigma_2: float
) -> tuple[FloatArray, FloatArray]:
    r"""Return the standard deviations of the relief displacements e1 and e2.

    Parameters
    ----------
    s1, s2, d1, d2, sigma_1, sigma_2
        As in `sigma_relief`.

    Returns
    -------
    sigma_e1, sigma_e2 : ndarray, shape (...)
        NaN where the relief is. [unit of s]

    Notes
    -----
    Total differentials of Eq. (1), :math:`e_i = s_i r / d_i`, with r of Eq. (6): its
    :math:`\partial r/\partial s_1 = -(1 - r/d_1)/q`, :math:`\partial r/\partial s_2 =
    (1 - r/d_2)/q`.

    Examples
    --------
    On the plane s1 = s2 and q = s / B: the sigma of e1 is d2 / (d1 - d2) times that of s2 - s1,
    that of e2 d1 / (d1 - d2) times. 17.5 m, 9.5 m, picks of 1 um: 1.414 um times 19/16 and 35/16.

    >>> e1, e2 = sigma_displacements(4, 4, d1=17.5, d2=9.5, sigma_1=1, sigma_2=1)
    >>> round(float(e1), 3), round(float(e2), 3)
    (1.679, 3.094)
    """
    s1, s2 = as_floats(s1, "s1"), as_floats(s2, "s2")
    r, by_1, by_2 = _differentials(s1, s2, d1, d2)
    e1 = np.hypot((r + s1 * by_1) * sigma_1, s1 * by_2 * sigma_2) / d1
    e2 = np.hypot(s2 * by_1 * sigma_1, (r + s2 * by_2) * sigma_2) / d2
    return np.asarray(e1), np.asarray(e2)


def uncertainty_radius(
    sigma_r_max: ArrayLike, *, d1: float, d2: float, sigma_m: float, r: ArrayLike = 0.0
) -> FloatArray:
    r"""Return the radius of the area of uncertainty for a wanted precision of relief.

    Parameters
    ----------
    sigma_r_max : array_like, shape (...)
        Largest acceptable standard deviation of the relief. [m]
    d1, d2 : float
        Distances to the reference plane. [m]
    sigma_m : float
        Standard deviation of the radial shift s2 - s1 on the plane: sqrt(2) times that of one
        pick. [m, or px: the result has the same unit]
    r : array_like
        Relief of the points. [m]

    Returns
    -------
    radius : ndarray, shape (...)
        s' on the plane within which the relief is less precise than wanted. [unit of sigma_m]

    Notes
    -----
    Midulla, Sect. 2.5 (a) made a number: at r = 0, :math:`s_u = \sigma_m B / \sigma_{r,max}`.

    Examples
    --------
    0.05 px, 1 cm, 35/19 mm: 104 px, 6 % of the half diagonal of a 6 MP frame.

    >>> round(float(uncertainty_radius(0.01, d1=17.5, d2=9.5, sigma_m=0.05)))
    104
    """
    wanted = as_floats(sigma_r_max, "sigma_r_max")
    r = as_floats(r, "r")
    base_factor(d1=d1, d2=d2)  # refuses d1 <= d2
    # Equal parts of sigma_m in both images, as sigma_relief with s_i = s' d_i / (d_i - r).
    spread = np.hypot(reduction(r, d1), reduction(r, d2)) / np.sqrt(2.0)
    factor = (d1 - r) * (d2 - r) / (d1 - d2) * spread
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(wanted > 0, sigma_m * factor / wanted, np.nan)


def false_relief_of_scale(mismatch: ArrayLike, *, d1: float, d2: float) -> FloatArray:
    """Return the constant false relief that a relative scale mismatch of the photos reads as. [m].

    Examples
    --------
    1 % of mismatch is 0.21 m for 35/19 mm and 0.70 m for 35/28 mm:

    >>> round(float(false_relief_of_scale(0.01, d1=17.5, d2=9.5)), 2)
    0.21
    >>> round(float(false_relief_of_scale(0.01, d1=17.5, d2=14)), 2)
    0.7
    """
    return np.asarray(as_floats(mismatch, "mismatch") * base_factor(d1=d1, d2=d2))


def _differentials(
    s1: FloatArray, s2: FloatArray, d1: float, d2: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return r of Eq. (6) and its derivatives by s1 and s2; NaN where it is undefined."""
    r = relief(s1, s2, d1=d1, d2=d2)
    rate = np.where(np.isnan(r), np.nan, s2 / d2 - s1 / d1)
    return r, -reduction(r, d1) / rate, reduction(r, d2) / rate
