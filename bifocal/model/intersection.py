"""Intersecting a bifocal pair's rays by least squares: points, covariances, misfits, flags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bifocal import rays
from bifocal.model.flags import FlagLimits, point_flags
from bifocal.model.points import Points
from photocore.arrays import FloatArray
from photocore.camera import inverse_2x2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanePicks:
    """Picks in one photo, carried to the reference plane.

    Attributes
    ----------
    positions : ndarray, shape (n, 2)
        Where the rays meet the plane, through media where they would if they went straight on;
        NaN where there is no pick. [m]
    metres_per_pixel : ndarray, shape (n, 2, 2)
        Derivative of the position by the pixel. [m/px]
    sigma_px : float
        Measuring precision per coordinate. [px]
    foot : Foot
        Nadir and distance of the camera.
    """

    positions: FloatArray
    metres_per_pixel: FloatArray
    sigma_px: float
    foot: rays.Foot

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the positions, shape (n, 2, 2). [m²]"""
        return _square(self.metres_per_pixel) * self.sigma_px**2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredPoints:
    """Points in the plane frame with their precision, however many rays met in them.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
        X, Y on the reference plane and relief r; NaN where the rays do not meet. [m]
    covariance : ndarray, shape (n, 3, 3)
        Covariance of xyz; NaN where xyz is. [m²]
    standardised : ndarray, shape (n,)
        Misfit of the rays over its standard deviation.
    flags : tuple of str, length n
        One of `bifocal.model.flags.FLAGS` per point.
    sigma_px : float
        Measuring precision per coordinate that the covariance rests on. [px]
    """

    xyz: FloatArray
    covariance: FloatArray
    standardised: FloatArray
    flags: tuple[str, ...]
    sigma_px: float

    def __post_init__(self) -> None:
        for array in self._arrays().values():
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.flags)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name."""
        values = {part.name: getattr(self, part.name) for part in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}

    def to_points(self, ids: Sequence[str] | None = None) -> Points:
        """Return them with names, by default P1, P2 ...: for tables, plots and exports."""
        xyz, covariance = self.xyz.reshape(-1, 3), self.covariance.reshape(-1, 3, 3)
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        return Points(
            ids=tuple(ids or (f"P{number}" for number in range(1, len(xyz) + 1))),
            xyz=xyz,
            sigma_r=sigma[:, 2],
            sigma_xy=sigma[:, :2],
            cov_xy=covariance[:, 0, 1],
            flags=self.flags,
            notes=("",) * len(xyz),
        )

    def reshaped(self, shape: tuple[int, ...]) -> Self:
        """Return the same points in arrays that begin with another shape."""
        if shape == (len(self),):
            return self
        arrays = {
            name: array.reshape((*shape, *array.shape[1:]))
            for name, array in self._arrays().items()
        }
        return replace(self, **arrays)  # type: ignore[arg-type]

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of X, Y and r, shape (n, 3). [m]"""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Intersection(MeasuredPoints):
    """Points in the plane frame with their precision.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
        X, Y on the reference plane and relief r; NaN where the rays do not meet. [m]
    covariance : ndarray, shape (n, 3, 3)
        Covariance of xyz; NaN where xyz is. [m²]
    residuals : ndarray, shape (n, 4)
        Observed minus adjusted column 1, row 1, column 2, row 2. [px]
    misfit : ndarray, shape (n,)
        Distance of the pick in image 2 from the radial line through the pick in image 1. [px]
    standardised : ndarray, shape (n,)
        Misfit over its standard deviation; beyond 3.5 a pick is called a blunder.
    e1, e2 : ndarray, shape (n,)
        Relief displacements on the reference plane, outwards positive. [m]
    adjusted1, adjusted2 : ndarray, shape (n, 2)
        Adjusted positions of both picks on the reference plane, on one radial line; through media
        the apparent ones, whose rays meet. [m]
    flags : tuple of str, length n
        One of `bifocal.model.flags.FLAGS` per point.
    sigma_px : float
        Measuring precision per coordinate that the covariance rests on. [px]
    """

    residuals: FloatArray
    misfit: FloatArray
    e1: FloatArray
    e2: FloatArray
    adjusted1: FloatArray
    adjusted2: FloatArray


def intersect(
    far: PlanePicks,
    near: PlanePicks,
    *,
    limits: FlagLimits,
    sigma_orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    of_orientation: Callable[[FloatArray], FloatArray] | None = None,
) -> Intersection:
    """Intersect the rays of the same picks in both photos; see `bifocal.Pair.intersect`.

    Parameters
    ----------
    far, near : PlanePicks
        The same points in both photos.
    limits : FlagLimits
        Where the flags begin.
    sigma_orientation : tuple of float
        Standard deviations of d1 [m], d2 [m], the relative scale, each nadir coordinate [m].
    of_orientation : callable, optional
        Points (n, 3) to the covariance (n, 3, 3) that the orientation adds to theirs. [m²]
    """
    q1, q2 = far.positions, near.positions
    centre = rays.zoom_centre(far.foot, near.foot)
    cov1, cov2 = far.covariance, near.covariance
    meeting = rays.meeting_of(far.foot, near.foot, centre)
    a1, a2, standardised = rays.adjust_onto_epipolar_line(
        q1, q2, cov1, cov2, centre, meeting=meeting
    )
    relief = rays.relief_of_rays(a1, a2, far.foot, near.foot)
    xyz = rays.point_on_ray(a1, relief, far.foot)
    # A point at or behind the near camera cannot be in the photo: the rays diverge there. Nor can
    # one on the camera's side of the glass.
    before = rays.is_before(xyz, near.foot) & rays.is_before(xyz, far.foot)
    xyz[~before] = np.nan
    relief = xyz[:, 2]
    covariance = _covariance(xyz, a2, cov1, cov2, far.foot, near.foot, sigma_orientation)
    if of_orientation is not None:
        covariance = covariance + of_orientation(xyz)
    radius = q1 - centre
    residuals = [_pixels(far.metres_per_pixel, q1 - a1), _pixels(near.metres_per_pixel, q2 - a2)]
    return Intersection(
        xyz=xyz,
        covariance=covariance,
        residuals=np.concatenate(residuals, axis=1),
        misfit=_misfit(near.metres_per_pixel, *meeting(q1 - centre, q2 - centre)),
        standardised=standardised,
        e1=displacement(a1, xyz, far.foot),
        e2=displacement(a2, xyz, near.foot),
        adjusted1=a1,
        adjusted2=a2,
        flags=point_flags(
            at_nadir=np.all(radius == 0, axis=1),
            standardised=standardised,
            incomplete=np.isnan(np.hstack([q1, q2])).any(axis=1),
            relief=relief,
            sigma_r=np.sqrt(covariance[:, 2, 2]),
            near_distance=near.foot.distance,
            limits=limits,
        ),
        sigma_px=float(np.hypot(far.sigma_px, near.sigma_px) / np.sqrt(2.0)),
    )


def _square(jacobian: FloatArray) -> FloatArray:
    """Return J J^T for every point."""
    product: FloatArray = jacobian @ jacobian.transpose(0, 2, 1)
    return product


def inverse_3x3(matrix: FloatArray) -> FloatArray:
    """Return the inverses of symmetric 3x3 matrices by cofactors; NaN where singular."""
    cofactor = np.cross(matrix[:, [1, 2, 0]], matrix[:, [2, 0, 1]])
    determinant = (matrix[:, 0] * cofactor[:, 0]).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(determinant > 0, 1.0 / determinant, np.nan)[:, None, None] * cofactor


def _covariance(
    xyz: FloatArray,
    a2: FloatArray,
    cov1: FloatArray,
    cov2: FloatArray,
    far: rays.Foot,
    near: rays.Foot,
    sigma_orientation: tuple[float, float, float, float],
) -> FloatArray:
    """Return the covariance of (X, Y, r) from pixels and, where given, from the orientation."""
    weighted = []
    normal = np.zeros((len(xyz), 3, 3))
    for camera, cov in ((far, cov1), (near, cov2)):
        rows = rays.design_rows(xyz, camera)
        product = rows.transpose(0, 2, 1) @ inverse_2x2(cov)
        weighted.append(product)
        normal += product @ rows
    covariance = inverse_3x3(normal)
    sigma_d1, sigma_d2, sigma_scale, sigma_nadir = sigma_orientation
    if not any(sigma_orientation):
        return covariance
    effects = []
    for camera, product, sigma_d in ((far, weighted[0], sigma_d1), (near, weighted[1], sigma_d2)):
        by_distance, by_nadir = rays.orientation_rows(xyz, camera)
        effects.append(product @ (by_distance * sigma_d)[:, :, None])
        effects.append(product @ (by_nadir * sigma_nadir))
    # A scale error of image 2 stretches the measured positions about its nadir.
    effects.append(weighted[1] @ ((a2 - near.nadir) * sigma_scale)[:, :, None])
    effect = covariance @ np.concatenate(effects, axis=2)
    return covariance + _square(effect)


def _pixels(metres: FloatArray, shift: FloatArray) -> FloatArray:
    """Return a shift on the plane in pixels of the image."""
    shift_px: FloatArray = (inverse_2x2(metres) @ shift[:, :, None])[:, :, 0]
    return shift_px


def _misfit(
    metres2: FloatArray, value: FloatArray, _: FloatArray, gradient: FloatArray
) -> FloatArray:
    """Return the signed distance of pick 2 from the line on which pick 1 puts it. [px]"""
    radius = np.hypot(gradient[:, 0], gradient[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        across = value / radius
        normal = gradient / radius[:, None]
    return np.copysign(np.linalg.norm(_pixels(metres2, normal * across[:, None]), axis=1), across)


def displacement(q: FloatArray, xyz: FloatArray, camera: rays.Foot) -> FloatArray:
    """Return how far relief moves points outwards, from where they stand on the plane. [m]"""
    position = rays.object_rays(q, camera).position
    return _outward(position - xyz[:, :2], xyz[:, :2] - camera.nadir)


def _outward(shift: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the length of a displacement along the outward direction."""
    length = np.hypot(direction[:, 0], direction[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (shift * direction).sum(axis=1) / length
    return np.where(length > 0, along, np.where(np.isnan(shift[:, 0]), np.nan, 0.0))
