"""Cameras that look at a scene through plane-parallel media: refracted rays, independently cast.

Vector Snell where rays leave the photo, bisection of the refraction invariant where a point is
looked for: nothing here comes from the package.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bifocal import Pair
from multimedia import Layers
from tests.scenes.arrays import FloatArray
from tests.scenes.cameras import CameraPair, SceneCamera


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WetCamera(SceneCamera):
    """A camera before plane-parallel media.

    Attributes
    ----------
    indices, thicknesses : tuple of float
    z0 : float
        Centre to the first interface, along its normal. [m]
    axes : ndarray, shape (3, 3)
        Of the interfaces in the plane frame, one a row, their normal towards the camera the last.
    """

    indices: tuple[float, ...]
    thicknesses: tuple[float, ...]
    z0: float
    axes: FloatArray = field(default_factory=lambda: np.eye(3))

    @property
    def heights(self) -> list[float]:
        """Of the media before the last. [m]"""
        return [self.z0, *self.thicknesses]

    def emitted(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where rays leave the last interface, and how, each of shape (n, 3)."""
        rays = SceneCamera.rays(self, pixels) @ self.axes.T
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        places = np.zeros_like(rays)
        after_each = zip(self.heights, self.indices, self.indices[1:], strict=False)
        for height, before, after in after_each:
            places = places + rays * (height / -rays[:, 2:])
            along = rays[:, :2] * (before / after)
            rays = np.column_stack([along, -np.sqrt(1 - (along**2).sum(axis=1))])
        return self.centre + places @ self.axes, rays @ self.axes

    def _invariant(self, local: FloatArray) -> FloatArray:
        """Return n sin(beta) of the rays to points, by bisection, shape (n,)."""
        radius = np.hypot(*local[:, :2].T)
        heights = [*self.heights, -local[:, 2] - sum(self.heights)]
        low, high = np.zeros(len(local)), np.full(len(local), min(self.indices) * (1 - 1e-12))
        for _ in range(54):
            middle = (low + high) / 2
            reach = sum(
                h * middle / np.sqrt(n * n - middle**2)
                for h, n in zip(heights, self.indices, strict=True)
            )
            short = reach < radius
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return (low + high) / 2

    def view_of(self, points: FloatArray) -> FloatArray:
        """Return the pixels of points, shape (n, 2)."""
        local = (points - self.centre) @ self.axes.T
        radius = np.maximum(np.hypot(*local[:, :2].T), 1e-300)
        sine = self._invariant(local) / self.indices[0]
        way = np.column_stack([local[:, :2] * (sine / radius)[:, None], -np.sqrt(1 - sine**2)])
        return SceneCamera.view_of(self, self.centre + way @ self.axes)

    def aimed(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where the rays to points leave the last interface, and the way from there."""
        local = (points - self.centre) @ self.axes.T
        radius = np.maximum(np.hypot(*local[:, :2].T), 1e-300)
        invariant = self._invariant(local)
        reach = sum(
            h * invariant / np.sqrt(n * n - invariant**2)
            for h, n in zip(self.heights, self.indices[:-1], strict=True)
        )
        depth = np.full((len(local), 1), -sum(self.heights))
        places = np.column_stack([local[:, :2] * (reach / radius)[:, None], depth])
        places = self.centre + places @ self.axes
        return places, points - places

    @property
    def steps(self) -> int:
        """Into how many parts edges are cut, since they are seen bent.

        A cornice 18 m long, seen from 9.5 m through a port, bends by half of how high it is seen:
        by its corners alone the middle of it was left out of the photo.
        """
        return 16

    @property
    def bulge(self) -> float:
        """How far edges may bend out of the box of the points along them. [px]"""
        return 0.02 * max(self.size)


def under_water(
    cameras: CameraPair,
    *,
    indices: tuple[float, ...],
    thicknesses: tuple[float, ...] = (),
    z0: tuple[float, float],
    leans: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0)),
) -> CameraPair:
    """Return cameras of a pair square to the wall behind media, at the same scale near the axis.

    Their ports may lean by angles about the axes X and Y. [deg]
    """
    wet = []
    for camera, first, lean in zip((cameras.far, cameras.near), z0, leans, strict=True):
        distance = float(camera.centre[2])
        heights = [first, *thicknesses, distance - first - sum(thicknesses)]
        apparent = sum(h * indices[0] / n for h, n in zip(heights, indices, strict=True))
        matrix = camera.matrix.copy()
        matrix[[0, 1], [0, 1]] *= apparent / distance
        wet.append(
            WetCamera(
                matrix=matrix, rotation=camera.rotation, centre=camera.centre, size=camera.size,
                indices=indices, thicknesses=thicknesses, z0=first, axes=_axes(lean),
            )
        )  # fmt: skip
    return CameraPair(far=wet[0], near=wet[1], nominal_far=cameras.far, nominal_near=cameras.near)


def _axes(lean: tuple[float, float]) -> FloatArray:
    """Return the axes of interfaces that lean about X and Y, one a row. [deg]"""
    (cx, cy), (sx, sy) = np.cos(np.radians(lean)), np.sin(np.radians(lean))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return about_x @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])


def pair_through_media(cameras: CameraPair) -> Pair:
    """Return the exact pair of cameras made by `under_water`."""
    photos = []
    for camera in (cameras.far, cameras.near):
        assert isinstance(camera, WetCamera)
        layers = Layers(indices=camera.indices, thicknesses=camera.thicknesses)
        normal = None if (camera.axes == np.eye(3)).all() else camera.axes[2]
        photo = camera.photo()
        photos.append(replace(photo, layers=layers, z0=camera.z0, interface_normal=normal))
    return Pair(image1=photos[0], image2=photos[1])
