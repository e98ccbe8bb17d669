"""Two rays of a bifocal pair: zoom centre, adjustment, intersection and its covariance.

Everything here lives on the reference plane: an image point is the position q where its ray meets
the plane. A camera is its nadir N (foot on the plane) and its distance d. A point (X, Y, r) is
seen at ``q = N + (P - N) d / (d - r)`` with P = (X, Y), Midulla Eq. (1) written for the plane.
These are the equations of `bifocal.equations` for two nadir points; on an ideal pair, where both
are one, they are the same (tests/papers/test_midulla.py). `magnification`, `reduction`,
`zoom_factor` and `relief_from_zoom` keep the precision of what they are given: images and relief
maps are float32.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bifocal.equations import relief_displacement
from photocore.arrays import FloatArray


class Foot(NamedTuple):
    """A camera reduced to what relief needs: nadir on the plane and distance to it. [m]"""

    nadir: FloatArray
    distance: float


def magnification(relief: Any, distance: Any) -> NDArray[Any]:
    """Return s / s' = d / (d - r): how much farther from the nadir relief is seen, Eq. (1).

    NaN for points level with the camera or behind it (r >= d), which have no image.
    """
    depth = distance - relief
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(depth > 0, distance / depth, np.nan)


def reduction(relief: Any, distance: Any) -> Any:
    """Return s' / s = 1 - r / d, the inverse of `magnification`: s' = s - e with Eq. (1)."""
    return 1 - relief / distance


def plane_position(xyz: FloatArray, camera: Foot) -> FloatArray:
    """Return where the ray to each point meets the reference plane, shape (..., 2). [m]

    Points level with the camera or behind it (r >= d) have no image: NaN.
    """
    factor = magnification(xyz[..., 2], camera.distance)
    return camera.nadir + (xyz[..., :2] - camera.nadir) * factor[..., None]  # Eq. (1)


def zoom_centre(far: Foot, near: Foot) -> FloatArray:
    """Return e = (d1 N2 - d2 N1) / (d1 - d2), where the line through both cameras meets the plane.

    For every point ``q2 - e = k(r) (q1 - e)`` with ``k = d2 (d1 - r) / (d1 (d2 - r))``: the near
    image is a pure zoom of the far one about e, also when the cameras are offset sideways. On an
    ideal pair e is the common nadir.
    """
    d1, d2 = far.distance, near.distance
    return (d1 * near.nadir - d2 * far.nadir) / (d1 - d2)


def zoom_factor(relief: Any, *, d1: float, d2: float) -> NDArray[Any]:
    """Return k(r) = d2 (d1 - r) / (d1 (d2 - r)); NaN for points at or behind the near camera.

    It is the ratio of both `magnification`: s2 / s1 on an ideal pair.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(relief < d2, d2 * (d1 - relief) / (d1 * (d2 - relief)), np.nan)


def relief_from_zoom(factor: Any, *, d1: float, d2: float) -> NDArray[Any]:
    """Return r = d1 d2 (k - 1) / (k d1 - d2), the inverse of `zoom_factor`.

    It is Eq. (6) with k = s2 / s1: `bifocal.equations.relief` of s1 = 1 and s2 = k.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        relief = d1 * d2 * (factor - 1) / (factor * d1 - d2)  # Eq. (6)
        return np.where(factor * d1 > d2, relief, np.nan)


def relief_per_zoom(relief: Any, *, d1: float, d2: float) -> Any:
    """Return dr/dk = d1 d2 (d1 - d2) / (k d1 - d2)², the derivative of `relief_from_zoom`. [m]

    With k d1 - d2 = d2 (d1 - d2) / (d2 - r); at r = 0 it is the base factor B.
    """
    return (d2 - relief) ** 2 * (d1 / (d2 * (d1 - d2)))


def adjust_onto_epipolar_line(
    q1: FloatArray,
    q2: FloatArray,
    covariance1: FloatArray,
    covariance2: FloatArray,
    centre: FloatArray,
    *,
    iterations: int = 4,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Move both positions by the least (weighted) amount that puts them in line with e.

    Parameters
    ----------
    q1, q2 : ndarray, shape (n, 2)
        Plane positions. [m]
    covariance1, covariance2 : ndarray, shape (n, 2, 2)
        Their covariances. [m²]
    centre : ndarray, shape (2,)
        Zoom centre e. [m]
    iterations : int
        Fixed number of correction steps; the second already reaches 1e-9 of the first.

    Returns
    -------
    a1, a2 : ndarray, shape (n, 2)
        Adjusted positions, on one line through e to the last digit of the iteration. [m]
    standardised : ndarray, shape (n,)
        Misfit across the radius over its standard deviation; N(0, 1) for honest picks.

    Notes
    -----
    Two rays meet if and only if e, q1 and q2 are in line (see `zoom_centre`), so the least-squares
    intersection of two rays is the least correction that satisfies one bilinear condition
    ``f = (q1 - e) x (q2 - e) = 0``: redundancy one, the blunder test.
    """
    v1, v2 = q1 - centre, q2 - centre
    a1, a2 = v1, v2
    standardised = np.zeros(len(v1))
    for step in range(iterations):
        # Gradient of f at the current estimate; f expanded about it and evaluated at the data.
        g1 = np.stack([a2[:, 1], -a2[:, 0]], axis=-1)
        g2 = np.stack([-a1[:, 1], a1[:, 0]], axis=-1)
        spread1 = np.einsum("nij,nj->ni", covariance1, g1)
        spread2 = np.einsum("nij,nj->ni", covariance2, g2)
        variance = (g1 * spread1).sum(-1) + (g2 * spread2).sum(-1)
        value = a1[:, 0] * a2[:, 1] - a1[:, 1] * a2[:, 0]
        value = value + (g1 * (v1 - a1)).sum(-1) + (g2 * (v2 - a2)).sum(-1)
        safe = variance > 0  # at the centre itself there is no radial direction: nothing to adjust
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(safe, value / variance, 0.0)[:, None]
            if step == 0:
                standardised = np.where(safe, value / np.sqrt(variance), 0.0)
        a1, a2 = v1 - factor * spread1, v2 - factor * spread2
    return a1 + centre, a2 + centre, standardised


def relief_of_rays(q1: FloatArray, q2: FloatArray, far: Foot, near: Foot) -> FloatArray:
    """Return the relief where two rays through plane positions meet; NaN where undefined. [m]

    Notes
    -----
    Both rays have the same (X, Y) at relief r:
    ``q2 - q1 = r ((q2 - N2) / d2 - (q1 - N1) / d1)``, Midulla Eq. (5) as a vector equation; it is
    solved along its own direction, so no sign or quadrant is special.
    """
    shift = q2 - q1
    rate = (q2 - near.nadir) / near.distance - (q1 - far.nadir) / far.distance
    square = (rate * rate).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(square > 0, (shift * rate).sum(-1) / square, np.nan)  # Eq. (6)


def point_on_ray(q: FloatArray, relief: FloatArray, camera: Foot) -> FloatArray:
    """Return (X, Y, r) of the point at the given relief on the ray through q, shape (..., 3)."""
    xy = q - relief_displacement(q - camera.nadir, relief[..., None], d=camera.distance)  # Eq. (1)
    return np.concatenate([xy, relief[..., None]], axis=-1)


def design_rows(xyz: FloatArray, camera: Foot) -> FloatArray:
    """Return the derivatives of the plane position with respect to (X, Y, r), shape (n, 2, 3)."""
    factor = magnification(xyz[:, 2], camera.distance)
    rows = np.zeros((len(xyz), 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = factor
    by_relief = factor / (camera.distance - xyz[:, 2])
    rows[:, :, 2] = (xyz[:, :2] - camera.nadir) * by_relief[:, None]
    return rows
