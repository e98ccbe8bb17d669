"""Orientation and calibration of one camera from control points seen through the media."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media import (
    ANY_INTERIOR,
    EXTERIOR,
    Camera,
    CameraObservations,
    Media,
    as_media,
    camera_of,
    refuse_pixels,
    start_at,
)
from multimedia.orientation.pose_starts import pose_starts
from multimedia.orientation.quick_pose import quick_pose
from multimedia.remarks import remark
from photocore.adjustment import OUTLIER_LIMIT, Fit, correlations
from photocore.adjustment.iteration import refuse_undetermined
from photocore.adjustment.network import NetworkState
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.errors import ConvergenceError, GeometryError, InputError

#: A pose whose residuals are below this share of the image coordinates is the right one, unless the
#: control is flatter than the other share and has a mirror pose. False minima leave a tenth.
FITS, DEEP = 0.003, 0.05


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Resection:
    """An oriented camera with its precision.

    Attributes
    ----------
    camera : Camera
        The adjusted camera.
    names : tuple of str
        The parameters estimated; omega, phi, kappa are angles here. [object unit, rad, mm]
    covariance : ndarray, shape (u, u)
        Of those parameters, with the a-posteriori sigma0; NaN without redundancy.
    residuals : ndarray, shape (n, 2)
        Measured minus computed image coordinates; NaN for points not used. [mm]
    standardised : ndarray, shape (n, 2)
        Residuals over their own standard deviations.
    sigma0 : float
        A-posteriori standard deviation of an image coordinate of weight one; NaN without
        redundancy. [mm]
    redundancy : int
        Observations beyond the necessary ones.
    iterations : int
        Steps of the final adjustment.
    """

    camera: Camera
    names: tuple[str, ...]
    covariance: FloatArray
    residuals: FloatArray
    standardised: FloatArray
    sigma0: float
    redundancy: int
    iterations: int

    @property
    def sigmas(self) -> dict[str, float]:
        """Standard deviation of every estimated parameter. [object unit, rad, mm]"""
        sigma = np.sqrt(np.diag(self.covariance))
        return dict(zip(self.names, sigma.tolist(), strict=True))

    @property
    def correlations(self) -> FloatArray:
        """Correlation matrix of the estimated parameters, shape (u, u)."""
        return correlations(self.covariance)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is doubtful: without redundancy nothing tells of errors, and sigmas are NaN."""
        if self.redundancy > 0:
            return ()
        count = int(np.isfinite(self.residuals).all(axis=1).sum())
        return (remark("resect.unchecked", count=count, unknowns=len(self.names)),)

    @property
    def suspects(self) -> BoolArray:
        """Whether a point looks like a gross error, shape (n,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(self.standardised) > OUTLIER_LIMIT).any(axis=1))


def resect(
    camera: Camera,
    object_points: ArrayLike,
    image_points: ArrayLike,
    media: Media = None,
    *,
    estimate: Sequence[str] = EXTERIOR,
    sigma: ArrayLike | None = None,
) -> Resection:
    """Orient, and if asked calibrate, a camera from control points.

    Parameters
    ----------
    camera : Camera
        Interior orientation (kept unless estimated) and start values. The start may be as bad as
        you like: poses from P3P-type solutions through the apparent points compete with it.
    object_points : array_like, shape (n, 3)
        Control points, error-free. [object unit]
    image_points : array_like, shape (n, 2)
        Measured image coordinates; NaN where a point was not measured. [mm]
    media : Layers, FlatInterface, Interfaces or None
        As for `project`.
    estimate : sequence of str
        Parameters to determine: the exterior orientation and any of c, xh, yh, k1, k2, k3, p1,
        p2, scale, shear; of a fisheye c, xh, yh, k1, k2, k3, k4, scale.
    sigma : array_like, broadcast to shape (n, 2), optional
        Standard deviations of the image coordinates; only their ratios matter. [mm]

    Returns
    -------
    Resection

    Raises
    ------
    InputError
        If there are too few points, or image coordinates that cannot be millimetres.
    GeometryError
        If control points lie on a line, one coordinate system is mirrored, or the points cannot
        determine a parameter: the message names it.
    ConvergenceError
        If no start leads to a solution.

    Notes
    -----
    Least squares of measured minus projected image coordinates, with analytic derivatives through
    the media: Maas 2015's modular model in its use for spatial resection.

    Examples
    --------
    A camera found from five points, with no idea where it stands:

    >>> from multimedia import Layers, project
    >>> truth = Camera.from_angles((0.1, 0.2, 0.6), 0.1, 0.2, 0.3, principal_distance=25.0)
    >>> water = Layers(indices=(1.0, 1.337))
    >>> control = [(0, 0, -0.2), (0.1, 0, -0.3), (0, 0.1, -0.1), (0.1, 0.1, -0.2), (0, 0, -0.4)]
    >>> start = Camera.from_angles((0, 0, 1), 0, 0, 0, principal_distance=25.0)
    >>> resection = resect(start, control, project(truth, control, water), water)
    >>> resection.camera.centre.round(9).tolist()
    [0.1, 0.2, 0.6]
    """
    names = _checked_names(camera, estimate)
    control, image, sigmas, used, is_deep = _checked_points(
        camera, object_points, image_points, sigma, len(names)
    )
    what = f"resection of camera {camera.name}" if camera.name else "resection"
    observations = CameraObservations(
        points=control, image=image, media=as_media(media), sigma=sigmas, what=what
    )
    result = _fitted(camera, observations, names, is_deep)
    adjusted, sigma0 = camera_of(result.state), result.sigma0
    _refuse_mirrored(adjusted, sigma0, observations, is_deep)
    shape = (len(used), 2)
    residuals, normed = np.full(shape, np.nan), np.full(shape, np.nan)
    residuals[used] = -result.residuals.reshape(-1, 2) * sigmas
    normed[used] = -result.standardised.reshape(-1, 2)
    covariance = result.linear.cofactor * sigma0**2
    _refuse_flat(adjusted, names, covariance, what)
    return Resection(
        camera=adjusted,
        names=names,
        covariance=_angle_covariance(adjusted, names, covariance),
        residuals=residuals,
        standardised=normed,
        sigma0=sigma0,
        redundancy=result.redundancy,
        iterations=result.iterations,
    )


def _fitted(
    camera: Camera, observations: CameraObservations, names: tuple[str, ...], is_deep: bool
) -> Fit[NetworkState]:
    """Return the camera of the smallest square sum."""
    pose = quick_pose(camera, observations)
    if pose is None or not (is_deep and _is_beyond_doubt(observations, pose)):
        pose = _best_start(camera, observations, is_deep)
    elif names == EXTERIOR:
        refuse_undetermined(pose, names, observations.what)
        return pose
    return observations.network(names).solve(start_at(camera_of(pose.state)))


def _is_beyond_doubt(observations: CameraObservations, pose: Fit[NetworkState]) -> bool:
    """Whether a pose fits a body with depth so well that no other can: tiny residuals."""
    return _cost(pose) < (FITS**2) * float((observations.image**2).sum())


def _spread(points: FloatArray) -> FloatArray:
    """Return how far points reach along their three main directions, the shortest first."""
    away = points - points.mean(axis=0)
    # Shares down to 1e-8 are lengths, not rounding: enough for a line and for a plane.
    return np.sqrt(np.maximum(np.linalg.eigvalsh(away.T @ away), 0.0))


def _best_start(
    camera: Camera, observations: CameraObservations, is_deep: bool
) -> Fit[NetworkState]:
    """Return the pose of the smallest square sum that any start leads to."""
    poses: list[Fit[NetworkState]] = []
    network, count = observations.network(), 1
    starts = pose_starts(
        camera, observations.points, observations.image, as_media(observations.media)
    )
    for count, start in enumerate(starts, start=2):  # noqa: B007
        try:
            poses.append(network.minimise(start_at(start), most=60, settle=1e-4))
        except GeometryError:  # from there the camera does not see all points
            continue
        if is_deep and _is_beyond_doubt(observations, poses[-1]):
            break
    if not poses:
        raise ConvergenceError(
            remark("resect.no_position", of=observations.what),
            iterations=count,
            residual=float("nan"),
        )
    return min(poses, key=_cost)


def _cost(pose: Fit[NetworkState]) -> float:
    return float(pose.residuals @ pose.residuals)


def _checked_names(camera: Camera, estimate: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters in canonical order; the exterior orientation always belongs."""
    interior = camera.interior_names
    unknown = [name for name in estimate if name not in EXTERIOR + interior]
    if unknown:
        who = f"camera {camera.name}: " if camera.name else ""
        raise InputError(
            f"{who}estimate: {', '.join(unknown)} is no camera parameter of its lens model; "
            f"choose of {', '.join(interior)} (the exterior orientation is always estimated)."
        )
    return EXTERIOR + tuple(name for name in ANY_INTERIOR if name in estimate)


def _checked_points(
    camera: Camera,
    object_points: ArrayLike,
    image_points: ArrayLike,
    sigma: ArrayLike | None,
    unknowns: int,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray, bool]:
    """Return control, image points, relative sigmas, which rows they are, whether deep."""
    who = f"camera {camera.name}: " if camera.name else ""
    control = as_points(object_points, "object_points", dimension=3).reshape(-1, 3)
    image = as_points(image_points, "image_points", dimension=2).reshape(-1, 2)
    if len(control) != len(image):
        raise InputError(
            f"{who}{len(control)} object points but {len(image)} image points; give one image "
            "point per object point, NaN where it was not measured."
        )
    used = np.asarray(np.isfinite(control).all(axis=1) & np.isfinite(image).all(axis=1))
    count = int(used.sum())
    if 2 * count < unknowns or count < 3:
        raise InputError(
            f"{who}{count} control points measured, but {unknowns} parameters need at least "
            f"{max(3, (unknowns + 1) // 2)}. Measure more points or estimate fewer parameters."
        )
    control, image = control[used], image[used]
    sigmas = np.ones_like(image)
    if sigma is not None:
        sigma_xy = np.broadcast_to(np.asarray(sigma, dtype=np.float64), (len(used), 2))[used]
        if not (sigma_xy > 0).all():
            raise InputError(f"{who}sigma: every standard deviation must be above zero.")
        sigmas = sigma_xy / np.sqrt(np.mean(sigma_xy**2))
    refuse_pixels(camera, image)
    spread = _spread(control)
    if spread[1] < 1e-6 * spread[2] or spread[2] == 0:
        raise GeometryError(
            f"{who}all control points lie on one line; a camera can turn about it freely. Use "
            "points spread over an area, better over a volume."
        )
    return control, image, sigmas, used, bool(spread[0] > DEEP * spread[2])


def _refuse_mirrored(
    camera: Camera, sigma0: float, observations: CameraObservations, is_deep: bool
) -> None:
    """Refuse a bad fit that becomes a good one when the control is mirrored."""
    size = float(np.sqrt(np.mean(observations.image**2)))
    if not sigma0 > 0.005 * size:
        return
    normal = as_media(observations.media).mirror_normal(observations.points)
    offset = (observations.points - observations.points.mean(axis=0)) @ normal
    mirrored = replace(observations, points=observations.points - 2.0 * offset[:, None] * normal)
    try:
        mirror = _best_start(camera, mirrored, is_deep)
    except ConvergenceError:
        return
    if mirror.sigma0 < 0.2 * sigma0:
        raise GeometryError(remark("resect.mirrored", of=observations.what))


def _refuse_flat(camera: Camera, names: tuple[str, ...], covariance: FloatArray, what: str) -> None:
    """Refuse a principal distance that is known no better than by half of itself."""
    error = float(np.sqrt(covariance[names.index("c"), names.index("c")])) if "c" in names else 0.0
    if error > camera.principal_distance / 2:
        raise GeometryError(
            f"{what}: the data cannot determine c and Z0: c comes out as "
            f"{camera.principal_distance:.3g} ± {error:.2g} mm. The points lie about on one plane "
            "square to the axis: add points at other depths, turn the camera, or keep c."
        )


def _angle_covariance(camera: Camera, names: tuple[str, ...], covariance: FloatArray) -> FloatArray:
    """Return the covariance of angles from that of the rotation vector."""
    change = np.eye(len(names))
    change[3:6, 3:6] = camera.angle_rates()
    return change @ covariance @ change.T
