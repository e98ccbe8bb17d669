"""Object points from image points of any number of cameras, through the media."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from multimedia.media import (
    Camera,
    Media,
    OpticalMedia,
    as_media,
    project_with_jacobian,
    refuse_pixels,
)
from multimedia.orientation.object_rays import (
    image_rays,
    inverse_3x3,
    largest_angle,
    nearest_points,
    refuse_curved_rays,
    times,
)
from multimedia.orientation.point_kernel import (
    LINEAR,
    MOST_STEPS,
    SMALL,
    WEAK_ANGLE,
    settled_points,
    views_of,
)
from multimedia.orientation.point_status import PointStatus
from multimedia.orientation.pose_kernel import seen_points
from multimedia.orientation.quick_pose import layering_of
from multimedia.projects import SIGMA_IMAGE, SIGMA_PIXEL
from photocore.adjustment import standardised
from photocore.arrays import BoolArray, FloatArray, IntArray, as_points
from photocore.errors import InputError

#: Points worked on at a time, so that their equations stay in the processor's cache.
BLOCK = 8192
#: Chance that an honest point is called a gross error.
RISK = 0.001
#: What the rows of numpy take for a point, roughly. [s]
POINT_SECONDS = 5e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IntersectedPoints:
    """Intersected points with their precision.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
        NaN where there is no point. [object unit]
    covariance : ndarray, shape (n, 3, 3)
        From the a-priori standard deviations of the image coordinates.
    residuals : ndarray, shape (cameras, n, 2)
        Measured minus computed image coordinates; NaN where not seen. [mm]
    standardised : ndarray, shape (cameras, n, 2)
        Residuals over their own standard deviations.
    sigma0 : ndarray, shape (n,)
        Root of the weighted square sum over the redundancy: 1 on average if the a-priori
        standard deviations are right.
    rays : ndarray of int, shape (n,)
        How many cameras saw each point.
    angle : ndarray, shape (n,)
        Largest angle between two rays in the object's medium. [rad]
    status : ndarray of int, shape (n,)
        `PointStatus`.
    """

    xyz: FloatArray
    covariance: FloatArray
    residuals: FloatArray
    standardised: FloatArray
    sigma0: FloatArray
    rays: IntArray
    angle: FloatArray
    status: IntArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of X, Y, Z, shape (n, 3)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def worst_camera(self) -> IntArray:
        """Camera of the largest standardised residual of each point, -1 where there is none."""
        size = np.nanmax(np.nan_to_num(np.abs(self.standardised), nan=-1.0), axis=2)
        worst = np.argmax(size, axis=0)
        return np.where(size.max(axis=0) >= 0, worst, -1).astype(np.int64)


def intersect(
    cameras: Sequence[Camera],
    image_points: ArrayLike,
    media: Media | Sequence[Media] = None,
    *,
    sigma: ArrayLike | None = None,
) -> IntersectedPoints:
    """Intersect the rays of every point by least squares of the image residuals.

    Parameters
    ----------
    cameras : sequence of Camera
        At least two.
    image_points : array_like, shape (cameras, n, 2)
        Measured image coordinates; NaN where a camera did not see a point. [mm]
    media : Layers, FlatInterface, Interfaces, None, or a sequence of these
        What the cameras look through, one for all or one each.
    sigma : array_like, broadcast to shape (cameras, n, 2), optional
        Standard deviations of the image coordinates; by default half a pixel of each camera's
        sensor, else 0.005 mm. [mm]

    Returns
    -------
    IntersectedPoints
        Points no two rays lead to are NaN, with a status.

    Raises
    ------
    InputError
        If the shapes do not fit, or image coordinates cannot be millimetres.

    Notes
    -----
    The start is the point nearest to the rays in the object's medium; Gauss-Newton with analytic
    derivatives through the media follows until the steps vanish. The gross-error test compares
    the weighted square sum with chi-square at 0.1 %. With the extra ``fast``, many points before
    parallel layers run compiled.

    Examples
    --------
    >>> from multimedia import Layers, project
    >>> water = Layers(indices=(1.0, 1.337))
    >>> pair = [Camera.looking_at((x, 0, 0.5), (0, 0, -0.1), principal_distance=25.0)
    ...         for x in (-0.2, 0.2)]
    >>> seen = [project(camera, [(0.01, 0.02, -0.1)], water) for camera in pair]
    >>> intersect(pair, seen, water).xyz.round(9).tolist()
    [[0.01, 0.02, -0.1]]
    """
    image, placed = _checked(cameras, image_points, media)
    sigmas = _sigmas(cameras, sigma, image.shape)
    views = None
    if settled_points.pays(POINT_SECONDS * image.shape[1]):
        views = views_of(cameras, placed)
    if views is None:
        return _by_rows(cameras, image, sigmas, placed)
    result = _nothing_found(*image.shape[:2])
    arrays: Any = tuple(getattr(result, name) for name in result.__slots__)
    whole = np.ascontiguousarray(image), np.ascontiguousarray(sigmas)
    settled = settled_points(views, *whole, _limits(len(image)), arrays)
    unsettled = np.flatnonzero(~settled)
    if unsettled.size:
        rest = _by_rows(cameras, image[:, unsettled], sigmas[:, unsettled], placed)
        for name, values in zip(result.__slots__, arrays, strict=True):
            values[(slice(None), unsettled) if name in _BY_CAMERA else unsettled] = getattr(
                rest, name
            )
    return result


#: Values of shape (cameras, n, 2).
_BY_CAMERA = ("residuals", "standardised")


def _nothing_found(m: int, n: int) -> IntersectedPoints:
    """Return room for n points of m cameras."""
    return IntersectedPoints(
        xyz=np.empty((n, 3)), covariance=np.empty((n, 3, 3)), sigma0=np.empty(n),
        residuals=np.full((m, n, 2), np.nan), standardised=np.full((m, n, 2), np.nan),
        rays=np.empty(n, np.int64), angle=np.empty(n), status=np.empty(n, np.int64),
    )  # fmt: skip


def _limits(count: int) -> FloatArray:
    """Return the largest square sums of honest points, by the number of rays."""
    return np.asarray(chdtri(np.maximum(2 * np.arange(count + 1) - 3, 1), RISK))


def _by_rows(
    cameras: Sequence[Camera], image: FloatArray, sigmas: FloatArray, placed: Sequence[OpticalMedia]
) -> IntersectedPoints:
    """Intersect points by rows of numpy."""
    parts = [_block(cameras, image[:, p], sigmas[:, p], placed) for p in _parts(image)]
    whole: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=int(name in _BY_CAMERA))
        for name in IntersectedPoints.__slots__
    }
    return IntersectedPoints(**whole)


def _parts(image: FloatArray) -> list[slice]:
    """Return the blocks in which points are worked on; one empty block for no points."""
    return [slice(k, k + BLOCK) for k in range(0, max(image.shape[1], 1), BLOCK)]


def intersect_rays(
    cameras: Sequence[Camera], image_points: ArrayLike, media: Media | Sequence[Media] = None
) -> FloatArray:
    """Return the points nearest to the rays in the object's medium: fast, linear, no precision.

    Parameters
    ----------
    cameras, image_points, media
        As for `intersect`.

    Returns
    -------
    ndarray, shape (n, 3)
        Exact for exact image points; else every ray counts alike, near or far.
    """
    image, placed = _checked(cameras, image_points, media)
    refuse_curved_rays(placed, "intersect_rays")
    xyz = np.empty((image.shape[1], 3))
    for part in _parts(image):
        rays = [image_rays(c, p[part], m) for c, p, m in zip(cameras, image, placed, strict=True)]
        xyz[part] = nearest_points([o for o, _ in rays], [d for _, d in rays])
    return xyz


def intersect_pairs(
    cameras: Sequence[Camera], image_points: ArrayLike, media: Media | Sequence[Media] = None
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the midpoints of all pairs of rays, as OpenPTV's point positions.

    Parameters
    ----------
    cameras, image_points, media
        As for `intersect`.

    Returns
    -------
    xyz : ndarray, shape (n, 3)
    distance : ndarray, shape (n,)
        Mean distance between the rays of the pairs. [object unit]
    """
    image, placed = _checked(cameras, image_points, media)
    refuse_curved_rays(placed, "intersect_pairs")
    xyz, apart = np.empty((image.shape[1], 3)), np.empty(image.shape[1])
    for part in _parts(image):
        xyz[part], apart[part] = _pair_block(cameras, image[:, part], placed)
    return xyz, apart


def _pair_block(
    cameras: Sequence[Camera], image: FloatArray, placed: Sequence[OpticalMedia]
) -> tuple[FloatArray, FloatArray]:
    """Return mean midpoints and mean distances of all pairs of rays."""
    rays = [image_rays(c, p, m) for c, p, m in zip(cameras, image, placed, strict=True)]
    total, apart = np.zeros((image.shape[1], 3)), np.zeros(image.shape[1])
    count = np.zeros(image.shape[1])
    for k, j in combinations(range(len(rays)), 2):
        (o1, d1), (o2, d2) = rays[k], rays[j]
        between = o2 - o1
        cosine = np.einsum("ni,ni->n", d1, d2)
        one, two = np.einsum("ni,ni->n", between, d1), np.einsum("ni,ni->n", between, d2)
        with np.errstate(divide="ignore", invalid="ignore"):
            # sin^2 of the angle; the product loses less than 1 - cos^2 where it is small.
            square = (1.0 - cosine) * (1.0 + cosine)
            along1, along2 = (one - cosine * two) / square, (cosine * one - two) / square
        first, second = along1[:, None] * d1, along2[:, None] * d2
        gap = between + second - first
        middle = o1 + first + 0.5 * gap
        distance = np.sqrt(np.einsum("ni,ni->n", gap, gap))
        good = np.isfinite(distance)
        if not good.all():
            middle, distance = np.where(good[:, None], middle, 0.0), np.where(good, distance, 0.0)
        total += middle
        apart += distance
        count += good
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(count[:, None] > 0, total / count[:, None], np.nan), np.where(
            count > 0, apart / count, np.nan
        )


def _block(
    cameras: Sequence[Camera], image: FloatArray, sigmas: FloatArray, placed: Sequence[OpticalMedia]
) -> IntersectedPoints:
    """Intersect one block of points."""
    m, n, _ = image.shape
    finite: BoolArray = np.asarray(np.isfinite(image).all(axis=-1))
    rays = [image_rays(c, p, i) for c, p, i in zip(cameras, image, placed, strict=True)]
    xyz = nearest_points([o for o, _ in rays], [d for _, d in rays])
    angle = largest_angle([d for _, d in rays])
    status = np.where(np.isfinite(xyz).all(axis=1), PointStatus.NOT_CONVERGED, PointStatus.WEAK)
    equations = _Equations(
        rows=np.ascontiguousarray(np.moveaxis(image, -1, 1)),
        weights=np.ascontiguousarray(np.moveaxis(1.0 / sigmas, -1, 1)), seen=finite,
        normal=np.full((6, n), np.nan), slopes=np.zeros((m, 2, 3, n)), misses=np.zeros((m, 2, n)),
    )  # fmt: skip
    active = np.flatnonzero(status == PointStatus.NOT_CONVERGED)
    reach = np.abs(xyz - cameras[0].centre).max(axis=1)
    before: FloatArray = np.full(n, np.nan)
    for _ in range(MOST_STEPS):
        if not active.size:
            break
        some = slice(None) if active.size == n else active
        step = equations.step(cameras, xyz[some], some, placed)
        lost: BoolArray = np.asarray(np.isnan(step[:, 0]))
        xyz[some] += np.where(lost[:, None], 0.0, step)
        size = np.sqrt(np.einsum("ni,ni->n", step, step)) / reach[some]
        with np.errstate(invalid="ignore", divide="ignore"):
            # Each step is shorter than the last by the same factor: the next one need not be made
            # to know that it is nothing.
            following = size * np.fmin(size / before[some], 1.0)
            done: BoolArray = np.asarray((following <= SMALL) & (size <= LINEAR))
        before[some] = size
        status[active[done]] = PointStatus.OK
        status[active[lost]] = PointStatus.BEHIND
        active = active[~done & ~lost]
    return _assembled(equations, xyz=xyz, angle=angle, status=status)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Equations:
    """Rows of one value a point: measured, and as of the last step of each point.

    Attributes
    ----------
    rows, weights : ndarray, shape (m, 2, n)
        Image coordinates [mm] and one over their standard deviations.
    seen : ndarray of bool, shape (m, n)
    normal : ndarray, shape (6, n)
    slopes, misses : ndarray, shape (m, 2, 3, n), (m, 2, n)
        Weighted derivatives and residuals, the latter after the step; 0 where not seen.
    """

    rows: FloatArray
    weights: FloatArray
    seen: BoolArray
    normal: FloatArray
    slopes: FloatArray
    misses: FloatArray

    def step(
        self,
        cameras: Sequence[Camera],
        xyz: FloatArray,
        some: slice | IntArray,
        placed: Sequence[OpticalMedia],
    ) -> FloatArray:
        """Return the steps (n, 3) of some points, and keep what they were made of."""
        m, n = len(cameras), len(xyz)
        slopes, misses = np.zeros((m, 2, 3, n)), np.zeros((m, 2, n))
        for k, (camera, media) in enumerate(zip(cameras, placed, strict=True)):
            finite = self.seen[k, some]
            use: slice | BoolArray = slice(None) if finite.all() else finite
            image, by_point = _images(camera, xyz[use], media)
            weight = self.weights[k][:, some][:, use]
            slopes[k][..., use] = by_point * weight[:, None]
            misses[k][:, use] = (self.rows[k][:, some][:, use] - image) * weight
        a, v = slopes.reshape(2 * m, 3, n), misses.reshape(2 * m, n)
        pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        normal = np.stack([np.einsum("kn,kn->n", a[:, i], a[:, j]) for i, j in pairs])
        right = np.stack([np.einsum("kn,kn->n", a[:, i], v) for i in range(3)])
        step = np.stack(times.plain(inverse_3x3(normal), right))
        # The last steps are so short that what they do to a residual is linear to rounding.
        misses -= np.einsum("mkin,in->mkn", slopes, step)
        self.normal[:, some], self.slopes[..., some], self.misses[..., some] = (
            normal, slopes, misses,
        )  # fmt: skip
        return step.T


def _images(camera: Camera, xyz: FloatArray, media: OpticalMedia) -> tuple[FloatArray, FloatArray]:
    """Return images (2, n) and their derivatives by the points (2, 3, n), as rows."""
    layering = layering_of(media)
    if layering is None:
        general = project_with_jacobian(camera, xyz, media)
        return general.image.T, np.moveaxis(general.by_point, 0, -1)
    c, lens = camera.principal_distance, camera.distortion
    possible, image, by_point = seen_points(
        np.ascontiguousarray(xyz.T), camera.centre, camera.rotation, c, layering
    )
    if lens.is_identity:
        image += camera.principal_point[:, None]
    else:
        measured, by_ideal, _ = lens.measured_with_jacobian(image.T, camera.principal_point, (), c)
        image, (one, two) = measured.T, by_point
        with np.errstate(invalid="ignore"):  # what is not possible is done again below
            rows = [by_ideal[:, i, 0] * one + by_ideal[:, i, 1] * two for i in range(2)]
        by_point = np.stack(rows)
    if not possible.all():
        rest = ~possible
        general = project_with_jacobian(camera, xyz[rest], media)
        image[:, rest] = general.image.T
        by_point[..., rest] = np.moveaxis(general.by_point, 0, -1)
    return image, by_point


def _assembled(
    equations: _Equations, *, xyz: FloatArray, angle: FloatArray, status: IntArray
) -> IntersectedPoints:
    """Return precision, residuals and tests of the points found."""
    finite, rays = equations.seen, equations.seen.sum(axis=0)
    xyz[status != PointStatus.OK] = np.nan
    status[rays == 1] = PointStatus.ONE_RAY
    status[rays == 0] = PointStatus.NO_RAY
    unknown = np.isnan(xyz[:, 0])
    inverse = inverse_3x3(equations.normal)
    inverse[:, unknown] = np.nan
    m, n = finite.shape
    slopes = equations.slopes.reshape(2 * m, 3, n)
    weighted = np.where((finite & ~unknown)[:, None], equations.misses, np.nan)
    square = np.einsum("mkn,mkn->n", equations.misses, equations.misses)
    redundancy = 2 * rays - 3
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma0 = np.where((redundancy > 0) & ~unknown, np.sqrt(square / redundancy), np.nan)
    # Cofactor of a weighted residual: 1 - a N^-1 a^T.
    cofactor = np.stack(times.plain(inverse, np.moveaxis(slopes, 1, 0)))
    spread = 1.0 - np.einsum("ikn,kin->kn", cofactor, slopes)
    good = status == PointStatus.OK
    status[good & (angle < WEAK_ANGLE)] = PointStatus.WEAK
    status[good & (square > _limits(m)[rays])] = PointStatus.GROSS_ERROR
    normed = standardised(weighted, spread.reshape(m, 2, n))
    return IntersectedPoints(
        xyz=xyz,
        covariance=np.ascontiguousarray(inverse[[0, 1, 2, 1, 3, 4, 2, 4, 5]].T).reshape(n, 3, 3),
        residuals=np.ascontiguousarray(np.moveaxis(weighted / equations.weights, 1, -1)),
        standardised=np.ascontiguousarray(np.moveaxis(normed, 1, -1)),
        sigma0=sigma0,
        rays=rays.astype(np.int64),
        angle=angle,
        status=status.astype(np.int64),
    )


def _checked(
    cameras: Sequence[Camera], image_points: ArrayLike, media: Media | Sequence[Media]
) -> tuple[FloatArray, list[OpticalMedia]]:
    """Return image points and what each camera looks through."""
    if len(cameras) < 2:
        raise InputError(f"cameras: an intersection needs two or more, found {len(cameras)}.")
    image = as_points(image_points, "image_points", dimension=2)
    if image.ndim != 3 or image.shape[0] != len(cameras):
        raise InputError(
            f"image_points: expected shape ({len(cameras)} cameras, n points, 2), found "
            f"{image.shape}. Use NaN where a camera did not see a point."
        )
    media = list(media) if isinstance(media, Sequence) else [media] * len(cameras)
    if len(media) != len(cameras):
        raise InputError(f"media: expected one per camera ({len(cameras)}), found {len(media)}.")
    for camera, points in zip(cameras, image, strict=True):
        refuse_pixels(camera, points)
    return image, [as_media(item) for item in media]


def _sigmas(
    cameras: Sequence[Camera], sigma: ArrayLike | None, shape: tuple[int, ...]
) -> FloatArray:
    """Return standard deviations of all image coordinates. [mm]"""
    if sigma is None:
        per_axis = [
            SIGMA_IMAGE if c.sensor is None else SIGMA_PIXEL * float(c.sensor.pixel_size.mean())
            for c in cameras
        ]
        return np.broadcast_to(np.array(per_axis)[:, None, None], shape)
    try:
        values = np.broadcast_to(np.asarray(sigma, dtype=np.float64), shape)
    except ValueError:
        raise InputError(
            f"sigma: shape {np.shape(sigma)} does not fit image points of shape {shape}."
        ) from None
    if (values <= 0).any():
        raise InputError("sigma: every standard deviation must be above zero [mm].")
    return values
