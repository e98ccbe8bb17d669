"""Features and rays of a façade under water: as near to straight ones as matching needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bifocal.matching.features import Features
from bifocal.model.homography import apply_homography
from bifocal.model.pair_media import PairMedia
from bifocal.model.photo import Photo
from bifocal.rays import object_rays, point_on_ray, relief_of_rays, seen_distance
from photocore.arrays import FloatArray
from photocore.camera.pinhole import Pinhole, ray_on_plane, triangulate


def place_on_plane(
    camera: Pinhole, media: PairMedia, number: int, pixels: FloatArray
) -> FloatArray:
    """Return where rays of camera 0 or 1 meet the reference plane, (n, 3), relief zero. [m]"""
    place = ray_on_plane(camera, pixels)
    if media:
        place[:, :2] = object_rays(place[:, :2], media.foot(number, camera)).position
        place[:, 2] = np.where(np.isfinite(place[:, 0]), 0.0, np.nan)
    return place


def meeting_point(
    cameras: Sequence[Pinhole], media: PairMedia, pixels: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return where the rays of both cameras of a pair meet, shape (n, 3). [m]"""
    first, second = cameras
    if not media:
        return triangulate(first, second, *pixels)
    far, near = (media.foot(k, camera) for k, camera in enumerate(cameras))
    q1, q2 = (ray_on_plane(c, p)[:, :2] for c, p in zip(cameras, pixels, strict=True))
    return point_on_ray(q1, relief_of_rays(q1, q2, far, near), far)


def highest_relief(cameras: Sequence[Pinhole], media: PairMedia) -> float:
    """Return the relief at which the last interface lies before the lower of cameras. [m]

    Over their nadirs; infinite in air.
    """
    paths = [media.path(k, camera) for k, camera in enumerate(cameras)]
    return min((path.highest for path in paths if path), default=float("inf"))


def straightened(photo: Photo, features: Features) -> Features:
    """Return features where a camera in air would show them near enough for one epipolar geometry.

    Points of the wall are seen exactly so, all others to second order; in air nothing changes.
    """
    if not photo.refracted:
        return features
    return replace(
        features,
        pixels=apply_homography(
            np.linalg.inv(_near_axis(photo)), photo.plane_from_pixels(features.pixels)
        ),
    )


def bent_again(photo: Photo, pixels: FloatArray) -> FloatArray:
    """Return the raw pixels of straightened features."""
    if not photo.refracted:
        return pixels
    return photo.pixels_from_plane(apply_homography(_near_axis(photo), pixels))


def _near_axis(photo: Photo) -> FloatArray:
    """Return the homography to the plane that holds near the axis through media, shape (3, 3)."""
    share = seen_distance(photo.foot) / photo.distance
    about = np.diag([share, share, 1.0])
    about[:2, 2] = photo.nadir * (1 - share)
    return np.asarray(about @ photo.plane_from_pixel)
