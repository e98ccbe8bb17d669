"""Two rays of a bifocal pair: zoom centre, adjustment, intersection and its covariance.

Everything here lives on the reference plane: an image point is the position q where its ray meets
the plane. A camera is its nadir N (foot on the plane) and its distance d. A point (X, Y, r) is
seen at ``q = N + (P - N) d / (d - r)`` with P = (X, Y), Midulla Eq. (1) written for the plane.
Through other media q is the apparent position, where the ray would meet the plane if it went
straight on, and `bifocal.media` bends it.
These are the equations of `bifocal.equations` for two nadir points; on an ideal pair, where both
are one, they are the same (tests/papers/test_midulla.py). `magnification`, `reduction`,
`zoom_factor` and `relief_from_zoom` keep the precision of what they are given: images and relief
maps are float32.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bifocal.equations import relief_displacement
from bifocal.media import MediaPath, ObjectRays
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, inverse_2x2


class Foot(NamedTuple):
    """A camera reduced to what relief needs: nadir on the plane and distance to it. [m]

    Attributes
    ----------
    nadir : ndarray, shape (2,)
        Foot of the projection centre on the reference plane. [m]
    distance : float
        Of the projection centre from the plane. [m]
    media : MediaPath or None
        What its rays cross on their way; None in air.
    """

    nadir: FloatArray
    distance: float
    media: MediaPath | None = None


def foot_of(camera: Pinhole, path: MediaPath | None = None) -> Foot:
    """Return a camera and its path reduced to what relief needs."""
    return Foot(camera.centre[:2], float(camera.centre[2]), path)


#: Where two rays meet: positions (n, 2) to what must be zero and its gradients by both positions.
Meeting = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


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

    Points level with the camera or behind it (r >= d) have no image: NaN. Through media it is
    where the ray would meet it if it went straight on; NaN before the last interface.
    """
    if camera.media is not None:
        return camera.nadir + camera.media.apparent(xyz[..., :2] - camera.nadir, xyz[..., 2])
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
    meeting: Meeting | None = None,
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
    meeting : callable, optional
        Condition of positions counted from the centre; by default `in_line`, that of straight
        rays.
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
    meeting = meeting or in_line
    v1, v2 = q1 - centre, q2 - centre
    a1, a2 = v1, v2
    standardised = np.zeros(len(v1))
    for step in range(iterations):
        # Gradient of f at the current estimate; f expanded about it and evaluated at the data.
        value, g1, g2 = meeting(a1, a2)
        spread1 = np.einsum("nij,nj->ni", covariance1, g1)
        spread2 = np.einsum("nij,nj->ni", covariance2, g2)
        variance = (g1 * spread1).sum(-1) + (g2 * spread2).sum(-1)
        value = value + (g1 * (v1 - a1)).sum(-1) + (g2 * (v2 - a2)).sum(-1)
        safe = variance > 0  # at the centre itself there is no radial direction: nothing to adjust
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(safe, value / variance, 0.0)[:, None]
            if step == 0:
                standardised = np.where(safe, value / np.sqrt(variance), 0.0)
        a1, a2 = v1 - factor * spread1, v2 - factor * spread2
    return a1 + centre, a2 + centre, standardised


def in_line(a1: FloatArray, a2: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return ``f = a1 x a2`` of positions from the zoom centre, and its gradients by both."""
    g1 = np.stack([a2[:, 1], -a2[:, 0]], axis=-1)
    g2 = np.stack([-a1[:, 1], a1[:, 0]], axis=-1)
    return a1[:, 0] * a2[:, 1] - a1[:, 1] * a2[:, 0], g1, g2


def meeting_of(far: Foot, near: Foot, centre: FloatArray) -> Meeting:
    """Return the condition that both rays of positions counted from a centre meet.

    Notes
    -----
    ``A1 + r S1 = A2 + r S2`` has a solution r if and only if ``f = (S1 - S2) x (A2 - A1) = 0``;
    in air that is `in_line` but for a factor.
    """
    if far.media is None or near.media is None:
        return in_line
    shift1, shift2 = centre - far.nadir, centre - near.nadir
    paths = far.media, near.media

    def meeting(a1: FloatArray, a2: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        rays1, place1, slope1 = paths[0].trace_with_jacobian(a1 + shift1)
        rays2, place2, slope2 = paths[1].trace_with_jacobian(a2 + shift2)
        rate = rays1.slope - rays2.slope
        gap = (rays2.position + near.nadir) - (rays1.position + far.nadir)
        # d(rate x gap) = d rate x gap + rate x d gap
        by_rate = np.stack([gap[:, 1], -gap[:, 0]], axis=-1)[:, None, :]
        by_gap = np.stack([-rate[:, 1], rate[:, 0]], axis=-1)[:, None, :]
        g1 = (by_rate @ slope1 - by_gap @ place1)[:, 0]
        g2 = (by_gap @ place2 - by_rate @ slope2)[:, 0]
        return rate[:, 0] * gap[:, 1] - rate[:, 1] * gap[:, 0], g1, g2

    return meeting


def object_rays(q: FloatArray, camera: Foot) -> ObjectRays:
    """Return the rays through plane positions as lines over relief, seen from the plane's origin.

    Their ``position`` is where they meet the reference plane, q itself in air; ``slope`` the change
    of (X, Y) per metre of relief.
    """
    if camera.media is None:
        return ObjectRays(q, (camera.nadir - q) / camera.distance)
    place, slope = camera.media.trace(q - camera.nadir)
    return ObjectRays(camera.nadir + place, slope)


def apparent_of_plane(positions: FloatArray, camera: Foot) -> FloatArray:
    """Return plane positions q of what lies on the reference plane: in air the same."""
    if camera.media is None:
        return positions
    away = positions - camera.nadir
    return camera.nadir + camera.media.apparent(away, np.zeros(away.shape[:-1]))


def apparent_magnification(radius: FloatArray, relief: FloatArray, camera: Foot) -> FloatArray:
    """Return (q - N) / (P - N) of points at radii from the nadir: `magnification` in air."""
    if camera.media is None:
        return magnification(relief, camera.distance)
    steepness = camera.media.steepness(radius, camera.distance - relief)
    return np.asarray(steepness * camera.distance)


def straight(camera: Foot) -> Foot:
    """Return the straight camera that sees as this one does near the axis of its interfaces.

    In air the camera itself; through media it lies on their axis through the centre.
    """
    if camera.media is None:
        return camera
    return Foot(camera.nadir + camera.media.apparent_move[:2], camera.media.near_axis)


def seen_distance(camera: Foot) -> float:
    """Return the distance at which the wall seems to lie near the axis; in air the true one. [m]

    The scale near the axis is c over it: ``z0 + sum t n1/n + H n1/nm`` through media.
    """
    if camera.media is None:
        return camera.distance
    media = camera.media
    first = media.layers.indices[0]
    heights = (media.z0, *media.layers.thicknesses, camera.distance - media.last_interface)
    reduced = zip(heights, media.layers.indices, strict=True)
    return float(sum(height * first / index for height, index in reduced))


def is_before(xyz: FloatArray, camera: Foot) -> BoolArray:
    """Return which points lie before the camera, in its last medium; False for NaN."""
    if camera.media is None:
        return np.asarray(xyz[..., 2] < camera.distance)
    return camera.media.holds(xyz[..., :2] - camera.nadir, xyz[..., 2])


def relief_of_rays(q1: FloatArray, q2: FloatArray, far: Foot, near: Foot) -> FloatArray:
    """Return the relief where two rays through plane positions meet; NaN where undefined. [m]

    Notes
    -----
    Both rays have the same (X, Y) at relief r:
    ``q2 - q1 = r ((q2 - N2) / d2 - (q1 - N1) / d1)``, Midulla Eq. (5) as a vector equation; it is
    solved along its own direction, so no sign or quadrant is special. Through media both rays are
    ``A + r S`` (`bifocal.media`) and the same holds of ``A2 - A1 = r (S1 - S2)``: linear in r.
    """
    rays1, rays2 = object_rays(q1, far), object_rays(q2, near)
    shift = rays2.position - rays1.position
    rate = rays1.slope - rays2.slope
    square = (rate * rate).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(square > 0, (shift * rate).sum(-1) / square, np.nan)  # Eq. (6)


def point_on_ray(q: FloatArray, relief: FloatArray, camera: Foot) -> FloatArray:
    """Return (X, Y, r) of the point at the given relief on the ray through q, shape (..., 3)."""
    if camera.media is not None:
        place, slope = object_rays(q, camera)
        return np.concatenate([place + relief[..., None] * slope, relief[..., None]], axis=-1)
    xy = q - relief_displacement(q - camera.nadir, relief[..., None], d=camera.distance)  # Eq. (1)
    return np.concatenate([xy, relief[..., None]], axis=-1)


def design_rows(xyz: FloatArray, camera: Foot) -> FloatArray:
    """Return the derivatives of the plane position with respect to (X, Y, r), shape (n, 2, 3).

    Through media the inverse of ``d(A + r S)/dq`` times ``(1, 1, -S)``.
    """
    if camera.media is not None:
        away = plane_position(xyz, camera) - camera.nadir
        ray, place, slope = camera.media.trace_with_jacobian(away)
        by_q = inverse_2x2(place + xyz[:, 2, None, None] * slope)
        return np.concatenate([by_q, -by_q @ ray.slope[..., None]], axis=-1)
    factor = magnification(xyz[:, 2], camera.distance)
    rows = np.zeros((len(xyz), 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = factor
    by_relief = factor / (camera.distance - xyz[:, 2])
    rows[:, :, 2] = (xyz[:, :2] - camera.nadir) * by_relief[:, None]
    return rows


def orientation_rows(xyz: FloatArray, camera: Foot) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of plane positions by the camera's distance and nadir.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Points. [m]
    camera : Foot
        The camera; its homography and z0 stay as they are.

    Returns
    -------
    by_distance : ndarray, shape (n, 2)
    by_nadir : ndarray, shape (n, 2, 2)
    """
    if camera.media is None:
        depth = camera.distance - xyz[:, 2]
        by_distance = -(xyz[:, :2] - camera.nadir) * (xyz[:, 2] / depth**2)[:, None]
        return by_distance, (-xyz[:, 2] / depth)[:, None, None] * np.eye(2)
    away = plane_position(xyz, camera) - camera.nadir
    by_away, moved = camera.media.moved_by_distance(away, xyz[:, 2])
    inverse = inverse_2x2(by_away)
    return -(inverse @ moved[..., None])[..., 0], np.eye(2) - inverse
