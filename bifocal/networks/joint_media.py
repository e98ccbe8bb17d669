"""Cameras of a façade under water: what they look through, and how it moves with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.matching.features import Features
from bifocal.media import MediaPath, view
from bifocal.model.homography import apply_homography
from bifocal.model.orientation_precision import pinhole
from bifocal.model.pair import Pair
from bifocal.model.pair_media import by_cameras
from bifocal.model.photo import Photo
from bifocal.rays import (
    Foot,
    object_rays,
    point_on_ray,
    relief_of_rays,
    seen_distance,
)
from multimedia import Layers
from photocore.arrays import FloatArray
from photocore.camera.pinhole import (
    Pinhole,
    ProjectedPoints,
    ray_on_plane,
    triangulate,
)
from photocore.errors import InputError

#: Normals of both ports that differ by less are one and the same glass. [-]
ALIKE = 1e-6
#: Normal of interfaces parallel to the reference plane.
SQUARE = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraMedia:
    """Media before one camera: parallel to the reference plane, or a port that leans.

    Attributes
    ----------
    layers : Layers
    z0 : float
        Camera centre to the first interface, as stated. [m]
    height : float or None
        First interface over the reference plane, where it stays with the object: glass of a tank,
        surface of water. None for a port, which moves with the camera. [m]
    axes : ndarray, shape (3, 3), or None
        Of a port that leans, in the camera's frame, with which it turns: one a row, its normal
        towards the camera the last. None where the media stay parallel to the reference plane.
    """

    layers: Layers
    z0: float
    height: float | None
    axes: FloatArray | None = None

    def z0_at(self, distance: float) -> float:
        """Return the way to the first interface from a camera at a distance to the plane. [m]"""
        return self.z0 if self.height is None else distance - self.height

    def normal(self, camera: Pinhole) -> FloatArray | None:
        """Return the normal of a port that leans, in the frame of the plane, shape (3,)."""
        return None if self.axes is None else np.asarray(self.axes[2] @ camera.rotation)

    def path(self, camera: Pinhole) -> MediaPath:
        """Return what the camera's rays cross, at the place where it is."""
        distance = float(camera.centre[2])
        turn = None if self.axes is None else self.axes @ camera.rotation
        return MediaPath(layers=self.layers, z0=self.z0_at(distance), distance=distance, turn=turn)

    def foot(self, camera: Pinhole) -> Foot:
        """Return the camera with its media, at the place where it is."""
        return Foot(camera.centre[:2], float(camera.centre[2]), self.path(camera))


def media_of(pair: Pair) -> tuple[CameraMedia | None, CameraMedia | None]:
    """Return what both cameras of a pair look through; None in air.

    Whether it is a port, or stays with the object, follows from z0: of a port both are alike, else
    both first interfaces are as high over the reference plane. Ports that lean turn with their
    cameras.

    Raises
    ------
    InputError
        If glass that stays with the object leans against the reference plane.
    """
    photos = (pair.image1, pair.image2)
    if pair.layers is None:
        return None, None
    turns = [_leaning(photo) for photo in photos]
    normals = [SQUARE if turn is None else turn[2] for turn in turns]
    z0 = [photo.z0 or 0.0 for photo in photos]
    heights = [
        float(normal @ [*photo.nadir, photo.distance]) - first
        for normal, photo, first in zip(normals, photos, z0, strict=True)
    ]
    one_glass = float(np.abs(normals[0] - normals[1]).max()) < ALIKE
    stays = one_glass and abs(heights[0] - heights[1]) < abs(z0[0] - z0[1])
    if stays and turns[0] is not None:
        raise InputError(
            "both photos look through one glass or surface that stays with the wall and leans "
            "against it: pairs are adjusted together through ports, which turn with their cameras, "
            "or through glass parallel to the reference plane. Choose a plane parallel to it "
            "(`bifocal align`: coordinates of the control points in that frame)."
        )
    found = []
    for photo, turn, own, height in zip(photos, turns, z0, heights, strict=True):
        axes = None if turn is None else turn @ pinhole(photo).rotation.T
        found.append(
            CameraMedia(layers=pair.layers, z0=own, height=height if stays else None, axes=axes)
        )
    return found[0], found[1]


def _leaning(photo: Photo) -> FloatArray | None:
    """Return the axes of a photo's interfaces; None where they are parallel to the plane."""
    turn = None if photo.media is None else photo.media.turn
    return None if turn is None or np.abs(turn[2] - SQUARE).max() < ALIKE else turn


def media_with_cameras(
    media: tuple[CameraMedia | None, CameraMedia | None],
) -> FloatArray | None:
    """Return how what the covariance of a pair counts moves with its cameras alone, (k, 24).

    `bifocal.model.pair_media.by_cameras`; None in air.
    """
    first, second = media
    if first is None or second is None:
        return None
    return by_cameras(
        first.layers,
        stays=first.height is not None,
        turning=(first.axes is not None, second.axes is not None),
    )


def project_through(camera: Pinhole, media: CameraMedia | None, xyz: FloatArray) -> ProjectedPoints:
    """Return what `project_with_jacobian` does, through media; NaN where no ray leads.

    What stays with the object comes nearer to a camera that goes up; a port turns with its camera.
    """
    seen = view(camera, None if media is None else media.path(camera), xyz)
    by_camera = seen.by_camera
    if media is not None and media.height is not None:
        by_camera[:, :, 9] += seen.by_media[:, :, -4]  # of `PLACING` the first is z0
    if media is not None and media.axes is not None:
        by_camera[:, :, 4:7] += seen.by_media[:, :, -3:]
    return ProjectedPoints(seen.pixels, seen.by_point, by_camera)


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

    Over their nadirs; infinite in air.
    """
    paths = [one.path(camera) for one, camera in zip(media, cameras, strict=True) if one]
    return min((path.highest for path in paths), default=float("inf"))


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
