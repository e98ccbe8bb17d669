"""Pinhole cameras of synthetic pairs, with the set-up errors of a real site."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bifocal import Pair, Photo
from tests.scenes.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneCamera:
    """A pinhole camera before the wall: x_cam = R (P - C), pixel ~ K x_cam.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        K. [px]
    rotation : ndarray, shape (3, 3)
        R from the plane frame to the camera (x right, y down, z along the view).
    centre : ndarray, shape (3,)
        C in the plane frame. [m]
    size : tuple of int
        Width and height. [px]
    residual : float
        RMS of the lens distortion that the pair file does not know. [px]
    """

    matrix: FloatArray
    rotation: FloatArray
    centre: FloatArray
    size: tuple[int, int]
    residual: float = 0.0

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Return the directions of pixels in the plane frame, shape (..., 3)."""
        flat = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1)
        return flat @ np.linalg.inv(self.matrix).T @ self.rotation

    @property
    def bulge(self) -> float:
        """How far the outline of a body bends out of its corners' box. [px]"""
        return 4 * abs(self.residual)

    def emitted(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where rays of pixels begin and their directions, each of shape (n, 3)."""
        rays = self.rays(pixels + self.residual * self._unknown_distortion(pixels))
        return np.broadcast_to(self.centre, rays.shape), rays

    def _unknown_distortion(self, pixels: FloatArray) -> FloatArray:
        """Return a wavy radial distortion and a decentring one, of RMS 1 together. [px]"""
        away = (pixels - np.subtract(self.size, 1) / 2) / (0.5 * np.hypot(*self.size))
        square = (away * away).sum(-1, keepdims=True)
        return 9.0 * away * (square - 0.5) + 1.1 * (square - 0.4)

    def aimed(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where the rays to points begin and the way from there to them."""
        return np.broadcast_to(self.centre, points.shape), points - self.centre

    def view_of(self, points: FloatArray) -> FloatArray:
        """Return the pixels of points, shape (..., 2)."""
        seen = (points - self.centre) @ self.rotation.T @ self.matrix.T
        return seen[..., :2] / seen[..., 2:]

    def photo(self, file: str = "") -> Photo:
        """Return the exact entry of a pair file."""
        axes = np.column_stack([np.eye(3)[:, :2], -self.centre])
        pixel_from_plane = self.matrix @ self.rotation @ axes
        return Photo(
            plane_from_pixel=np.linalg.inv(pixel_from_plane),
            nadir=self.centre[:2],
            distance=float(self.centre[2]),
            file=file,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupErrors:
    """What goes wrong on site; every figure is the half width of a uniform draw.

    Attributes
    ----------
    tilt_deg : float
        Rotation about each axis. [deg]
    distance : float
        Of the stations from the wall, relative.
    focal : float
        Of the principal distances, relative.
    offset : float
        Of the stations along the wall. [m]
    principal_point : float
        Of the principal point. [px]
    """

    tilt_deg: float = 0.2
    distance: float = 0.01
    focal: float = 0.005
    offset: float = 0.045
    principal_point: float = 9.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraPair:
    """The two cameras of a pair: as they are, and as the surveyor believes them to be.

    Attributes
    ----------
    far, near : SceneCamera
        True cameras.
    nominal_far, nominal_near : SceneCamera
        Cameras square to the wall at the planned places.
    """

    far: SceneCamera
    near: SceneCamera
    nominal_far: SceneCamera
    nominal_near: SceneCamera = field()

    @property
    def exact(self) -> Pair:
        """The pair as it is."""
        return Pair(image1=self.far.photo("far.png"), image2=self.near.photo("near.png"))

    @property
    def nominal(self) -> Pair:
        """The pair as planned."""
        return Pair(
            image1=self.nominal_far.photo("far.png"), image2=self.nominal_near.photo("near.png")
        )


def bifocal_cameras(
    *,
    size: tuple[int, int] = (3072, 2048),
    pixel: float = 0.00369,
    d1: float = 17.5,
    d2: float = 9.5,
    nadir: tuple[float, float] = (0.0, 0.0),
    errors: SetupErrors | None = None,
    rng: np.random.Generator | None = None,
) -> CameraPair:
    """Return the cameras of a bifocal pair whose pixel measures ``pixel`` metres on the wall.

    Parameters
    ----------
    size : tuple of int
        Width and height of both photos. [px]
    pixel : float
        Side of a pixel on the reference plane, the same in both. [m]
    d1, d2 : float
        Distances: 17.5 and 9.5 m for 35/19 mm, 17.5 and 14 m for 35/28 mm.
    nadir : tuple of float
        Common nadir, in the middle of the photos. [m]
    errors : SetupErrors, optional
        Half widths of set-up errors; None for an ideal pair.
    rng : Generator, optional
        Source of the errors; needed with ``errors``.
    """
    ideal = [_square_on(size, pixel, distance, nadir) for distance in (d1, d2)]
    real = ideal
    if errors is not None:
        if rng is None:
            raise ValueError("set-up errors are drawn at random: pass rng.")
        real = [_disturbed(camera, errors, rng) for camera in ideal]
    return CameraPair(far=real[0], near=real[1], nominal_far=ideal[0], nominal_near=ideal[1])


def _square_on(
    size: tuple[int, int], pixel: float, distance: float, nadir: tuple[float, float]
) -> SceneCamera:
    """Return a camera square to the wall."""
    focal = distance / pixel
    matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    return SceneCamera(
        matrix=matrix,
        rotation=np.diag([1.0, -1.0, -1.0]),
        centre=np.array([*nadir, distance]),
        size=size,
    )


def _disturbed(camera: SceneCamera, errors: SetupErrors, rng: np.random.Generator) -> SceneCamera:
    """Return the camera with errors drawn from ``rng``."""
    angles = np.radians(errors.tilt_deg) * rng.uniform(-1, 1, 3)
    turn = np.eye(3)
    for axis, angle in enumerate(angles):
        i, j = [k for k in range(3) if k != axis]
        step = np.eye(3)
        step[i, i] = step[j, j] = np.cos(angle)
        step[i, j], step[j, i] = -np.sin(angle), np.sin(angle)
        turn = step @ turn
    centre = camera.centre.copy()
    centre[:2] += errors.offset * rng.uniform(-1, 1, 2)
    centre[2] *= 1 + errors.distance * rng.uniform(-1, 1)
    matrix = camera.matrix.copy()
    matrix[0, 0] *= 1 + errors.focal * rng.uniform(-1, 1)
    matrix[1, 1] = matrix[0, 0]
    matrix[:2, 2] += errors.principal_point * rng.uniform(-1, 1, 2)
    return replace(camera, matrix=matrix, rotation=turn @ camera.rotation, centre=centre)
