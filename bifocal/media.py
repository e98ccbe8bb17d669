r"""Straight rays bent on their way: a camera of a pair that looks through plane-parallel media.

The one module of `bifocal` that knows `multimedia`. It carries a camera's ray from its own medium
into the object's and back. On the measured side the ray is known, so nothing is iterated: with
:math:`\tau_i = \tan\beta_i` along the interfaces, Snell's law (Maas 2015, Eq. 3) gives

.. math:: \tau_i = k_i \tau_1, \qquad k_i = n_1 / \sqrt{n_i^2 + (n_i^2 - n_1^2) \tau_1^2},

and the ray in the object's medium is the straight line ``(X, Y) = A + r S`` over relief r, with
:math:`A = N + \tau_1 (z_0 + \sum t_i k_i + H k_m)`, :math:`S = -\tau_1 k_m` and H the way from the
last interface to the reference plane. Without media A = q and S = -(q - N) / d.

References
----------
.. [1] Maas, "On the accuracy potential in underwater/multimedia photogrammetry", Sensors 2015.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypedDict

import numpy as np

from multimedia import Camera, FlatInterface, Layers, radial_shift_ratio
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, by_rotation, project_with_jacobian

#: What a path is differentiated by after its indices and thicknesses: the way to the first
#: interface [m], a small turn of the interfaces about the axes of the plane frame [rad].
PLACING = ("z0", "lean X", "lean Y", "lean Z")
#: A point on the last interface is behind it, whatever the last digit says. Relative.
_ROUNDING = 1e-14


class MediaOfPhoto(TypedDict, total=False):
    """What a photo states of the media before its camera; nothing in air."""

    layers: Layers | None
    z0: float | None
    interface_normal: FloatArray | None


class ObjectRays(NamedTuple):
    """Rays in the object's medium, as lines over relief.

    Attributes
    ----------
    position : ndarray, shape (..., 2)
        Where they meet the reference plane, from the nadir. [m]
    slope : ndarray, shape (..., 2)
        Change of (X, Y) per metre of relief.
    """

    position: FloatArray
    slope: FloatArray


class RadialRays(NamedTuple):
    """What media parallel to the plane make of tan beta_1 = t of rays, shape (...).

    Attributes
    ----------
    arm : ndarray
        Radius at which the ray meets the reference plane, over t. [m]
    bend : ndarray
        Tangent in the object's medium, over t.
    pace, turn : ndarray
        Derivatives of radius and tangent by t. [m, -]
    """

    arm: FloatArray
    bend: FloatArray
    pace: FloatArray
    turn: FloatArray


class PointViews(NamedTuple):
    """Pixels (n, 2) with derivatives by point (n, 2, 3), camera (n, 2, 10) and media (n, 2, k).

    The camera's `PARAMETERS`, its homography and z0 kept; of the media what
    `bifocal.model.orientation_precision.names_of` counts of one photo, nothing in air.
    """

    pixels: FloatArray
    by_point: FloatArray
    by_camera: FloatArray
    by_media: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MediaPath:
    """What lies between one camera and the reference plane.

    Attributes
    ----------
    layers : Layers
        The media.
    z0 : float
        Camera centre to the first interface, along its normal. [m]
    distance : float
        Camera centre to the reference plane. [m]
    rotation : ndarray, shape (3, 3), or None
        Axes of the interfaces in the plane frame, one a row, their normal towards the camera the
        last; None where they are parallel to the reference plane.
    """

    layers: Layers
    z0: float
    distance: float
    rotation: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.rotation is not None:
            self.rotation.setflags(write=False)

    @property
    def last_interface(self) -> float:
        """Camera centre to the last interface, along its normal. [m]"""
        return self.z0 + self.layers.thickness

    @property
    def highest(self) -> float:
        """Relief of the last interface over the nadir. [m]"""
        cosine = 1.0 if self.rotation is None else float(self.rotation[2, 2])
        return self.distance - self.last_interface / cosine

    def holds(self, offset: FloatArray, relief: FloatArray) -> BoolArray:
        """Return which points, (X, Y) from the nadir and r, lie behind the last interface."""
        below = self.distance - relief
        if self.rotation is not None:
            below = below * self.rotation[2, 2] - offset @ self.rotation[2, :2]
        return np.asarray(below - self.last_interface >= -_ROUNDING * self.distance)

    def trace(self, away: FloatArray) -> ObjectRays:
        """Return the rays of apparent positions (from the nadir, on the reference plane).

        Parameters
        ----------
        away : ndarray, shape (..., 2)
            Where the straight ray of the first medium meets the reference plane. [m]

        Returns
        -------
        ObjectRays
            NaN beyond total reflection, and where a ray does not come down to the plane.
        """
        return self._traced(away)[0]

    def trace_with_jacobian(self, away: FloatArray) -> tuple[ObjectRays, FloatArray, FloatArray]:
        """Return `trace` and the derivatives of position and slope by ``away``, (..., 2, 2)."""
        rays, tangent, (arm, by_arm), (bend, by_bend) = self._traced(away)
        outer = tangent[..., :, None] * tangent[..., None, :]
        unit = np.eye(2)
        of_arm = arm[..., None, None] * unit + (2 * by_arm)[..., None, None] * outer
        of_slope = bend[..., None, None] * unit + (2 * by_bend)[..., None, None] * outer
        if self.rotation is None:
            return rays, of_arm / self.distance, of_slope / -self.distance
        by_away = self._tangent_by_away(away, tangent)
        start, way = of_arm @ by_away, of_slope @ by_away
        turn = self.rotation
        along = self._along(tangent * bend[..., None])
        # E = C + Q^T (e, -depth), w = Q^T (t, -1); slope = w_xy / w_z, A = E_xy - E_z slope.
        by_way = turn[:2].T @ way  # (..., 3, 2)
        by_start = turn[:2].T @ start
        down = along[..., 2, None, None]
        by_slope = (by_way[..., :2, :] - rays.slope[..., :, None] * by_way[..., 2:, :]) / down
        back = self._turned_back(tangent * arm[..., None], -self.last_interface)
        height = back[..., 2] + self.distance
        by_position = (
            by_start[..., :2, :]
            - rays.slope[..., :, None] * by_start[..., 2:, :]
            - height[..., None, None] * by_slope
        )
        return rays, by_position, by_slope

    def moved_by_distance(
        self, away: FloatArray, relief: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return how rays at a relief move with ``away`` (n, 2, 2) and with the distance (n, 2).

        The apparent positions and z0 are kept: a camera farther off looks along steeper rays.
        """
        rays, place, slope = self.trace_with_jacobian(away)
        by_away = place + relief[:, None, None] * slope
        # The ray depends on away / d; the way behind the last interface grows by what d does.
        turned = -(by_away @ away[..., None])[..., 0] / self.distance
        return by_away, turned - rays.slope

    def _traced(
        self, away: FloatArray
    ) -> tuple[
        ObjectRays, FloatArray, tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]
    ]:
        """Return rays, tan beta_1 along the interfaces, arm and k_m with derivatives by its square.

        The arm carries the tangent to the reference plane, or with tilted interfaces to the last
        of them.
        """
        tangent = away / self.distance if self.rotation is None else self._tangent(away)
        (arm, by_arm), (bend, by_bend) = self._ways((tangent * tangent).sum(-1))
        if self.rotation is None:
            rays = ObjectRays(tangent * arm[..., None], tangent * -bend[..., None])
        else:
            rays = self._lines(tangent * arm[..., None], tangent * bend[..., None])
        return rays, tangent, (arm, by_arm), (bend, by_bend)

    def radial_rays(self, tangent: FloatArray) -> RadialRays:
        """Return what interfaces parallel to the reference plane make of tan beta_1."""
        square = tangent * tangent
        (arm, by_arm), (bend, by_bend) = self._ways(square)
        return RadialRays(arm, bend, arm + 2 * square * by_arm, bend + 2 * square * by_bend)

    def _ways(
        self, square: FloatArray
    ) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """Return arm and k_m of tan² beta_1, each with its derivative by it."""
        first = self.layers.indices[0]
        heights = [*self.layers.thicknesses, self.distance - self.last_interface]
        if self.rotation is not None:
            heights[-1] = 0.0
        arm, by_arm = np.full_like(square, self.z0), np.zeros_like(square)
        bend, by_bend = np.ones_like(square), np.zeros_like(square)
        with np.errstate(invalid="ignore", divide="ignore"):
            for index, height in zip(self.layers.indices[1:], heights, strict=True):
                excess = (index - first) * (index + first)
                cosine = 1.0 / np.sqrt(index**2 + excess * square)
                bend = first * cosine  # Maas Eq. (3)
                by_bend = -0.5 * excess * bend * cosine * cosine
                arm = arm + height * bend
                by_arm = by_arm + height * by_bend
        return (arm, by_arm), (bend, by_bend)

    def apparent(self, offset: FloatArray, relief: FloatArray) -> FloatArray:
        """Return where straight rays in the first medium would show points, from the nadir.

        Parameters
        ----------
        offset : ndarray, shape (..., 2)
            (X, Y) of the points from the nadir. [m]
        relief : ndarray, shape (...)
            [m]

        Returns
        -------
        ndarray, shape (..., 2)
            Apparent position on the reference plane; NaN for points that are not behind the last
            interface, and where no ray leads. [m]

        Notes
        -----
        Maas 2015, Eqs. (1) and (2): the radial shift, in the frame of the interfaces.
        """
        below = self.distance - relief
        if self.rotation is None:
            radius = np.hypot(offset[..., 0], offset[..., 1])
            return np.asarray(offset * (self.steepness(radius, below) * self.distance)[..., None])
        point = np.concatenate([offset, -below[..., None]], axis=-1) @ self.rotation.T
        along, below = point[..., :2], -point[..., 2]
        with np.errstate(invalid="ignore", divide="ignore"):
            radius = np.hypot(along[..., 0], along[..., 1])
            tangent = along * self.steepness(radius, below)[..., None]
            way = self._turned_back(tangent, -1.0)
            return np.where(
                way[..., 2:] < 0, way[..., :2] * (-self.distance / way[..., 2:]), np.nan
            )

    def steepness(self, radius: FloatArray, below: FloatArray) -> FloatArray:
        """Return tan beta_1 per metre of radius, of rays to points so far below the camera. [1/m]

        NaN for points before the last interface. Radii count from the foot of the camera's normal.
        """
        behind = below - self.last_interface
        behind = np.where(behind >= -_ROUNDING * self.distance, np.maximum(behind, 0.0), np.nan)
        ratio = radial_shift_ratio(radius, z0=self.z0, zp=behind, layers=self.layers)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(ratio / below)

    @property
    def apparent_move(self) -> FloatArray:
        """Where rays near the axis of the interfaces come from, seen from the centre, (3,). [m]

        In the object's medium they run as from a point on that axis which lies
        ``z0 n_m / n_1 + sum t_i n_m / n_i`` before the last interface.
        """
        *before, last = self.layers.indices
        heights = [self.z0, *self.layers.thicknesses]
        reduced = sum(h * last / index for h, index in zip(heights, before, strict=True))
        normal = np.array([0.0, 0.0, 1.0]) if self.rotation is None else self.rotation[2]
        return np.asarray((reduced - self.last_interface) * normal)

    @property
    def near_axis(self) -> float:
        """Distance of a straight camera whose rays run alike near the axis. [m]"""
        return self.distance + float(self.apparent_move[2])

    def _turned_back(self, along: FloatArray, down: float) -> FloatArray:
        """Return vectors of the interfaces' frame in the plane frame, shape (..., 3)."""
        assert self.rotation is not None
        return np.asarray(along @ self.rotation[:2] + down * self.rotation[2])

    def _along(self, tangent: FloatArray) -> FloatArray:
        """Return directions of the plane frame from tangents along the interfaces."""
        return self._turned_back(tangent, -1.0)

    def _tangent(self, away: FloatArray) -> FloatArray:
        """Return tan beta_1 along tilted interfaces; NaN for rays that do not run towards them."""
        assert self.rotation is not None
        way = away @ self.rotation[:, :2].T - self.distance * self.rotation[:, 2]
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(way[..., 2:] < 0, way[..., :2] / -way[..., 2:], np.nan)

    def _tangent_by_away(self, away: FloatArray, tangent: FloatArray) -> FloatArray:
        """Return the derivative of `_tangent`, shape (..., 2, 2)."""
        assert self.rotation is not None
        down = away @ self.rotation[2, :2] - self.distance * self.rotation[2, 2]
        change = self.rotation[:2, :2] + tangent[..., :, None] * self.rotation[2, :2]
        return np.asarray(change / -down[..., None, None])

    def _lines(self, start: FloatArray, tangent: FloatArray) -> ObjectRays:
        """Return rays that leave tilted interfaces as lines over relief."""
        place, way = self._turned_back(start, -self.last_interface), self._along(tangent)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.where(way[..., 2:] < 0, way[..., :2] / way[..., 2:], np.nan)
        return ObjectRays(place[..., :2] - (place[..., 2:] + self.distance) * slope, slope)


def interface_axes(normal: FloatArray) -> FloatArray:
    """Return the axes of interfaces of a unit normal, one a row, the normal last, shape (3, 3)."""
    across = np.cross(normal, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    return np.stack([np.cross(across, normal), across, normal])


def media_words(layers: Layers) -> str:
    """Return media in words, the camera's first.

    Examples
    --------
    >>> media_words(Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.01,)))
    'n = 1, 1.49 (10 mm), 1.337'
    """
    first, *inner, last = layers.indices
    glass = [f"{n:g} ({1000 * t:g} mm)" for n, t in zip(inner, layers.thicknesses, strict=True)]
    return f"n = {', '.join([f'{first:g}', *glass, f'{last:g}'])}"


def view(camera: Pinhole, path: MediaPath | None, xyz: FloatArray) -> PointViews:
    """Return the pixels of points, straight in air or bent on their path, with their derivatives.

    Parameters
    ----------
    camera : Pinhole
        Its centre stands over the reference plane.
    path : MediaPath or None
        What lies between it and the plane, of the camera's own distance; None in air.
    xyz : ndarray, shape (n, 3)
        Points. [m]

    Returns
    -------
    PointViews
        All NaN where a point is before the last interface or behind the camera, no ray leads to it,
        or the first interface begins behind the camera.

    Notes
    -----
    `multimedia.FlatInterface` tells where a point seems to be: there a camera in air sees it. A
    camera that moves keeps z0, a turn leaves the interfaces; what turns them alone is the
    difference between a turn of all and of the camera. A layer grows away from the camera.
    """
    if path is None:
        seen = project_with_jacobian(camera, xyz)
        return PointViews(*seen, np.zeros((len(xyz), 2, 0)))
    normal = np.array([0.0, 0.0, 1.0]) if path.rotation is None else path.rotation[2]
    if path.z0 < 0:
        xyz = np.full_like(xyz, np.nan)
    slack = _ROUNDING * path.distance
    depth = max(path.last_interface, path.layers.thickness) + slack
    interface = FlatInterface(
        layers=path.layers, point=-depth * normal, normal=normal, moves_with_camera=True
    )
    over_plane = Camera(centre=camera.centre, rotation=np.eye(3), principal_distance=1.0)
    thin, count = len(path.layers.thicknesses), len(path.layers.indices)
    names = (*interface.parameter_names[-count - thin :], "offset")
    sight = interface.sight(over_plane, xyz - 2 * slack * normal, exterior=False, names=names)
    seen = project_with_jacobian(camera, camera.centre + sight.vectors)
    moved = sight.derivatives(seen.by_point)
    by_thickness, by_index = moved.by_media[..., :thin], moved.by_media[..., thin:-1]
    nearer = moved.by_media[..., -1:]
    by_camera = seen.by_camera
    leaning = by_rotation(moved.by_point, xyz - camera.centre) - by_camera[:, :, 4:7]
    by_camera[:, :, 7:] = -moved.by_point
    by_media = np.concatenate([by_index, by_thickness - nearer, -nearer, leaning], axis=2)
    return PointViews(seen.pixels, moved.by_point, by_camera, by_media)
