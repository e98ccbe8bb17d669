"""Cameras of a façade under water: what they look through, and how it moves with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.media import MediaPath
from bifocal.model.homography import apply_homography
from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from bifocal.orientation.features import Features
from bifocal.rays import (
    Foot,
    design_rows,
    object_rays,
    plane_position,
    point_on_ray,
    relief_of_rays,
    seen_distance,
)
from multimedia import Layers
from photocore.arrays import FloatArray
from photocore.camera import (
    Pinhole,
    ProjectedPoints,
    project_with_jacobian,
    ray_on_plane,
    triangulate,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraMedia:
    """Media before one camera, parallel to the reference plane.

    Attributes
    ----------
    layers : Layers
    z0 : float
        Camera centre to the first interface, as stated. [m]
    height : float or None
        First interface over the reference plane, where it stays with the object: glass of a tank,
        surface of water. None for a port, which moves with the camera. [m]
    """

    layers: Layers
    z0: float
    height: float | None

    def z0_at(self, distance: float) -> float:
        """Return the way to the first interface from a camera at a distance to the plane. [m]"""
        return self.z0 if self.height is None else distance - self.height

    def foot(self, camera: Pinhole) -> Foot:
        """Return the camera with its media, at the place where it is."""
        distance = float(camera.centre[2])
        path = MediaPath(layers=self.layers, z0=self.z0_at(distance), distance=distance)
        return Foot(camera.centre[:2], distance, path)


def media_of(pair: Pair) -> tuple[CameraMedia | None, CameraMedia | None]:
    """Return what both cameras of a pair look through; None in air.

    Whether it is a port, or stays with the object, follows from z0: of a port both are alike, else
    both first interfaces are as high over the reference plane.
    """
    photos = (pair.image1, pair.image2)
    if pair.layers is None:
        return None, None
    z0 = [photo.z0 or 0.0 for photo in photos]
    heights = [photo.distance - first for photo, first in zip(photos, z0, strict=True)]
    stays = abs(heights[0] - heights[1]) < abs(z0[0] - z0[1])
    first, second = (
        CameraMedia(layers=pair.layers, z0=own, height=height if stays else None)
        for own, height in zip(z0, heights, strict=True)
    )
    return first, second


def project_through(camera: Pinhole, media: CameraMedia | None, xyz: FloatArray) -> ProjectedPoints:
    """Return `photocore.camera.project_with_jacobian` through media; NaN where no ray leads.

    Notes
    -----
    The camera looks at the apparent position q of a point on the reference plane, a straight ray
    away. With t = (q - N) / d the derivative of q by d is ``t - dq/dr`` before a port, and
    ``t - dq/d(X, Y) t`` where the interface keeps its place over the plane.
    """
    if media is None:
        return project_with_jacobian(camera, xyz)
    foot = media.foot(camera)
    assert foot.media is not None
    if foot.media.z0 < 0:
        xyz = np.full_like(xyz, np.nan)
    q = plane_position(xyz, foot)
    rows = design_rows(xyz, foot)
    view = project_with_jacobian(camera, np.column_stack([q, np.zeros(len(q))]))
    by_q = view.by_point[:, :, :2]
    by_camera = view.by_camera.copy()
    tangent = ((q - foot.nadir) / foot.distance)[:, :, None]
    along = rows[:, :, 2:] if media.height is None else rows[:, :, :2] @ tangent
    moved = np.concatenate([np.eye(2) - rows[:, :, :2], tangent - along], axis=2)
    by_camera[:, :, 7:] += by_q @ moved
    return ProjectedPoints(view.pixels, by_q @ rows, by_camera)


def place_on_plane(camera: Pinhole, media: CameraMedia | None, pixels: FloatArray) -> FloatArray:
    """Return where rays meet the reference plane, shape (n, 3), their relief zero. [m]"""
    straight = ray_on_plane(camera, pixels)
    if media is None:
        return straight
    straight[:, :2] = object_rays(straight[:, :2], media.foot(camera)).position
    straight[:, 2] = np.where(np.isfinite(straight[:, 0]), 0.0, np.nan)
    return straight


def meeting_point(
    cameras: Sequence[Pinhole],
    media: Sequence[CameraMedia | None],
    pixels: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return where the rays of both cameras of a pair meet, shape (n, 3). [m]"""
    first, second = cameras
    if media[0] is None or media[1] is None:
        return triangulate(first, second, *pixels)
    feet = [one.foot(camera) for one, camera in zip(media, cameras, strict=True) if one]
    q1, q2 = (ray_on_plane(c, p)[:, :2] for c, p in zip(cameras, pixels, strict=True))
    return point_on_ray(q1, relief_of_rays(q1, q2, *feet), feet[0])


def highest_relief(cameras: Sequence[Pinhole], media: Sequence[CameraMedia | None]) -> float:
    """Return the relief at which the last interface lies before the lower of cameras. [m]

    Infinite in air.
    """
    feet = [one.foot(camera) for one, camera in zip(media, cameras, strict=True) if one]
    return min((f.distance - f.media.depth for f in feet if f.media), default=float("inf"))


def straightened(photo: Photo, features: Features) -> Features:
    """Return features where a camera in air would show them near enough for one epipolar geometry.

    Points of the wall are seen exactly so, all others to second order; in air nothing changes.
    """
    if photo.layers is None:
        return features
    return replace(
        features,
        pixels=apply_homography(
            np.linalg.inv(_near_axis(photo)), photo.plane_from_pixels(features.pixels)
        ),
    )


def bent_again(photo: Photo, pixels: FloatArray) -> FloatArray:
    """Return the raw pixels of straightened features."""
    if photo.layers is None:
        return pixels
    return photo.pixels_from_plane(apply_homography(_near_axis(photo), pixels))


def _near_axis(photo: Photo) -> FloatArray:
    """Return the homography to the plane that holds near the axis through media, shape (3, 3)."""
    share = seen_distance(photo.foot) / photo.distance
    about = np.diag([share, share, 1.0])
    about[:2, 2] = photo.nadir * (1 - share)
    return np.asarray(about @ photo.plane_from_pixel)
