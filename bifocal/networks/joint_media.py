"""Features and rays of a façade under water: as near to straight ones as matching needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bifocal.matching import Features
from bifocal.model import PairMedia, Photo, apply_homography
from bifocal.rays import seen_distance
from photocore.arrays import FloatArray
from photocore.camera import Pinhole


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


def refracted_again(photo: Photo, pixels: FloatArray) -> FloatArray:
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
