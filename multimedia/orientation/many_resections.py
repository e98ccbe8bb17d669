"""Many cameras oriented at once, each from its own control points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media import Camera, Media, as_media, refuse_pixels
from multimedia.orientation.pose_arrays import Layering
from multimedia.orientation.pose_kernel import fitted_poses
from multimedia.orientation.quick_pose import (
    LENS_ROUNDS,
    NEAR,
    POSE_SECONDS,
    layering_of,
    linear_lens,
)
from multimedia.orientation.resection import DEEP, FITS, resect
from photocore.arrays import BoolArray, FloatArray, IntArray, as_points
from photocore.camera import angle_rates
from photocore.errors import InputError, PhotogrammetryError

#: Smallest eigenvalue of the scaled normal matrix that the kernel's covariance is taken from; the
#: orthogonal steps of `resect` see what is weaker.
_WELL_KNOWN = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraPoses:
    """Oriented cameras with their precision.

    Attributes
    ----------
    start : tuple of Camera
        As they were given.
    centre : ndarray, shape (m, 3)
        NaN where a camera could not be oriented. [object unit]
    rotation : ndarray, shape (m, 3, 3)
        World from camera.
    covariance : ndarray, shape (m, 6, 6)
        Of X0, Y0, Z0, omega, phi, kappa, with each camera's own a-posteriori sigma0.
        [object unit, rad]
    residuals : ndarray, shape (m, n, 2)
        Measured minus computed image coordinates; NaN where not used. [mm]
    sigma0 : ndarray, shape (m,)
        NaN without redundancy. [mm]
    iterations : ndarray of int, shape (m,)
    status : tuple of str
        ``ok``, else why a camera could not be oriented.
    """

    start: tuple[Camera, ...]
    centre: FloatArray
    rotation: FloatArray
    covariance: FloatArray
    residuals: FloatArray
    sigma0: FloatArray
    iterations: IntArray
    status: tuple[str, ...]

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of X0, Y0, Z0, omega, phi, kappa, shape (m, 6). [unit, rad]"""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    def camera(self, number: int) -> Camera:
        """Return an oriented camera; refuse one that could not be, with the reason."""
        if self.status[number] != "ok":
            raise InputError(f"camera {number + 1}: {self.status[number]}")
        return replace(
            self.start[number], centre=self.centre[number], rotation=self.rotation[number]
        )


def resect_many(
    cameras: Sequence[Camera],
    object_points: ArrayLike,
    image_points: ArrayLike,
    media: Media = None,
    *,
    sigma: ArrayLike | None = None,
) -> CameraPoses:
    """Orient many cameras: the frames of a moving one, say.

    Parameters
    ----------
    cameras : sequence of Camera
        Interior orientations and starts, m of them.
    object_points : array_like, shape (n, 3) or (m, n, 3)
        Control points, the same for all or each camera's own. [object unit]
    image_points : array_like, shape (m, n, 2)
        NaN where a point was not measured. [mm]
    media : Layers, FlatInterface, Interfaces or None
        As for `project`, the same for all.
    sigma : array_like, broadcast to shape (m, n, 2), optional
        Standard deviations of the image coordinates; only their ratios matter. [mm]

    Returns
    -------
    CameraPoses
        What `resect` finds for each, to rounding.

    Raises
    ------
    InputError
        If the shapes do not fit.

    Notes
    -----
    A camera whose start does not lead to residuals that are beyond doubt, on points with depth, is
    oriented by `resect` with all its starts. With the extra ``fast`` the others run compiled.

    Examples
    --------
    >>> from multimedia import Layers, project
    >>> truth = [Camera.from_angles((x, 0.2, 0.6), 0.1, 0.2, 0.3, principal_distance=25.0)
    ...          for x in (0.1, 0.15)]
    >>> water = Layers(indices=(1.0, 1.337))
    >>> control = [(0, 0, -0.2), (0.1, 0, -0.3), (0, 0.1, -0.1), (0.1, 0.1, -0.2), (0, 0, -0.4)]
    >>> images = [project(camera, control, water) for camera in truth]
    >>> poses = resect_many([truth[0]] * 2, control, images, water)
    >>> poses.centre.round(9).tolist()
    [[0.1, 0.2, 0.6], [0.15, 0.2, 0.6]]
    """
    poses = _Fitted(cameras, *_checked(cameras, object_points, image_points, sigma))
    control, image, sigmas = poses.control, poses.image, poses.sigmas
    layering = layering_of(as_media(media))
    if layering is not None and fitted_poses.pays(POSE_SECONDS * len(cameras)):
        poses.orient(layering)
    else:
        poses.sure[:] = False
    status = ["ok"] * len(cameras)
    for k in np.flatnonzero(~poses.sure).tolist():
        try:
            one = resect(cameras[k], control[k % len(control)], image[k], media, sigma=sigmas[k])
        except PhotogrammetryError as error:
            status[k] = str(error)
            poses.forget(k)
        else:
            poses.centre[k], poses.rotation[k] = one.camera.centre, one.camera.rotation
            poses.covariance[k], poses.residuals[k] = one.covariance, one.residuals
            poses.sigma0[k], poses.iterations[k] = one.sigma0, one.iterations
    return CameraPoses(
        start=tuple(cameras), centre=poses.centre, rotation=poses.rotation,
        covariance=poses.covariance, residuals=poses.residuals, sigma0=poses.sigma0,
        iterations=poses.iterations, status=tuple(status),
    )  # fmt: skip


def _checked(
    cameras: Sequence[Camera],
    object_points: ArrayLike,
    image_points: ArrayLike,
    sigma: ArrayLike | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return control (m or 1, n, 3), image points and their standard deviations (m, n, 2)."""
    if isinstance(cameras, Camera):
        raise InputError("cameras: give one for each row of image_points, e.g. [camera] * 1000.")
    image = as_points(image_points, "image_points", dimension=2)
    control = as_points(object_points, "object_points", dimension=3)
    control = control[None] if control.ndim == 2 else control
    fits = image.ndim == 3 and control.ndim == 3 and control.shape[1] == image.shape[1]
    if not (fits and len(image) == len(cameras) and len(control) in (1, len(cameras))):
        raise InputError(
            f"{len(cameras)} cameras, object_points of shape {np.shape(object_points)}, "
            f"image_points {image.shape}: give one image point per camera and object point, NaN "
            "where it was not measured."
        )
    try:
        sigmas = np.broadcast_to(np.asarray(1.0 if sigma is None else sigma, float), image.shape)
    except ValueError:
        raise InputError(
            f"sigma: shape {np.asarray(sigma).shape} does not fit image points of shape "
            f"{image.shape}."
        ) from None
    if not (sigmas > 0).all():
        raise InputError("sigma: every standard deviation must be above zero [mm].")
    return control, image, sigmas


class _Fitted:
    """What the kernel finds, and of which cameras that is sure.

    ``lenses`` are the numbers of the cameras by what they see with: each lens is evaluated once.
    """

    def __init__(
        self, cameras: Sequence[Camera], control: FloatArray, image: FloatArray, sigmas: FloatArray
    ) -> None:
        count = len(cameras)
        finite: BoolArray = np.asarray(np.isfinite(image).all(-1) & np.isfinite(control).all(-1))
        self.cameras, self.control, self.seen = cameras, control, finite
        self.image = np.where(finite[..., None], image, np.nan)
        total = np.where(finite[..., None], sigmas**2, 0.0).sum((1, 2))
        mean = np.where(finite.any(1), total, 1.0) / np.maximum(2 * finite.sum(1), 1)
        self.sigmas = sigmas / np.sqrt(mean)[:, None, None]
        self.centre = np.array([camera.centre for camera in cameras])
        self.rotation = np.array([camera.rotation for camera in cameras])
        self.covariance = np.full((count, 6, 6), np.nan)
        self.residuals = np.full(image.shape, np.nan)
        self.sigma0, self.iterations = np.full(count, np.nan), np.zeros(count, dtype=np.int64)
        groups: dict[tuple[object, ...], list[int]] = {}
        for k, camera in enumerate(cameras):
            interior = (
                camera.distortion,
                camera.principal_distance,
                *camera.principal_point.tolist(),
            )
            groups.setdefault((*interior, id(camera.sensor)), []).append(k)
        self.lenses = list(groups.values())
        self.sure = self._deep()

    def forget(self, number: int) -> None:
        """Leave nothing of a camera that could not be oriented."""
        for values in (self.centre, self.rotation, self.covariance, self.residuals, self.sigma0):
            values[number] = np.nan

    def _deep(self) -> BoolArray:
        """Return whose image points can be mm and whose control points spread in all directions."""
        weight = self.seen / np.maximum(self.seen.sum(1, keepdims=True), 1)
        points = np.where(self.seen[..., None], self.control, 0.0)
        away = points - (points * weight[..., None]).sum(1, keepdims=True)
        spread = np.linalg.eigvalsh(np.swapaxes(away * self.seen[..., None], 1, 2) @ away)
        deep: BoolArray = np.asarray(spread[:, 0] > DEEP**2 * spread[:, 2])
        for some in self.lenses:
            try:
                refuse_pixels(self.cameras[some[0]], self.image[some])
            except InputError:  # `resect` says of which
                deep[some] = False
        return deep

    def _linear_lenses(self, ideal: FloatArray) -> FloatArray:
        """Return the residuals as linear in the ideal images, shape (m, 2, 3, n)."""
        lens = np.empty((len(ideal), 2, 3, ideal.shape[1]))
        for some in self.lenses:
            lens[some] = linear_lens(
                self.cameras[some[0]], ideal[some], self.image[some], self.sigmas[some]
            )
        return lens

    def orient(self, layering: Layering) -> None:
        """Go to the least square sums."""
        c = np.array([camera.principal_distance for camera in self.cameras])
        rounding = 2e-16 * np.nanmax(np.abs(self.image), axis=(1, 2), initial=0.0)
        points = np.ascontiguousarray(np.swapaxes(self.control, 1, 2))
        ideal = np.empty_like(self.image)
        for some in self.lenses:
            ideal[some] = self.cameras[some[0]].ideal(self.image[some])
        straight = all(camera.distortion.is_identity for camera in self.cameras)
        for _ in range(LENS_ROUNDS):
            lens = self._linear_lenses(ideal)
            steps, self.centre, self.rotation, flat, rows = fitted_poses(
                points, lens, self.centre, self.rotation, c, layering, rounding
            )
            self.iterations += steps.astype(np.int64)
            self.sure &= steps > 0
            new = np.where(self.seen[..., None], np.swapaxes(flat, 1, 2), np.nan)
            moved, ideal = np.nanmax(np.abs(new - ideal), axis=(1, 2), initial=0.0), new
            if straight or (moved[self.sure] < NEAR * c[self.sure]).all():
                break
        self._judge(rows)

    def _judge(self, rows: FloatArray) -> None:
        """Find precision and residuals, and who fits so well that no other pose can."""
        table = np.swapaxes(rows, 1, 2).reshape(len(rows), 7, -1)
        lost = np.asarray(~np.isfinite(table).all(axis=(1, 2)))  # a pose that nothing leads to
        self.sure &= ~lost
        table = np.where(lost[:, None, None], 0.0, table)
        residuals, jacobian = table[:, 0], table[:, 1:]
        normal = jacobian @ np.swapaxes(jacobian, 1, 2)
        scale = 1.0 / np.sqrt(np.diagonal(normal, axis1=1, axis2=2) + 1e-300)
        scaled = normal * scale[:, :, None] * scale[:, None]
        self.sure &= np.isfinite(scaled).all(axis=(1, 2))
        scaled[~self.sure] = np.eye(6)
        self.sure &= np.linalg.eigvalsh(scaled)[:, 0] > _WELL_KNOWN
        square = (residuals**2).sum(1)
        self.sure &= square < FITS**2 * np.nansum(self.image**2, axis=(1, 2))
        redundancy = 2 * self.seen.sum(1) - 6
        self.sigma0 = np.sqrt(np.where(redundancy > 0, square, np.nan) / np.maximum(redundancy, 1))
        change = np.tile(np.eye(6), (len(rows), 1, 1))
        change[self.sure, 3:, 3:] = angle_rates(self.rotation[self.sure])
        cofactor = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None]
        self.covariance = change @ cofactor @ np.swapaxes(change, 1, 2)
        self.covariance *= self.sigma0[:, None, None] ** 2
        misses = -np.moveaxis(rows[:, :, 0], 1, 2) * self.sigmas
        self.residuals = np.where(self.seen[..., None], misses, np.nan)
