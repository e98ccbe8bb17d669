"""Measured rays through a water surface: intersections of photo rays, and single lidar beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.bathymetry.corrected_points import (
    BathymetryStatus,
    CorrectedPoints,
    WaterSurface,
    as_water_surface,
    checked_water_index,
)
from multimedia.media import SurfaceSequence, trace_rays
from photocore.arrays import BoolArray, FloatArray, IntArray, as_points
from photocore.errors import InputError, located

#: Two rays of a smaller angle do not fix a point. [rad]
SMALLEST_ANGLE = 1e-4
#: Rounds in which the weights follow the distances to the point.
ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RayIntersections:
    """Points where refracted rays meet.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
        Points; NaN where fewer than two rays remain or they are almost parallel. [m]
    covariance : ndarray, shape (n, 3, 3)
        From the precision of the directions. [m²]
    misfit : ndarray, shape (n,)
        Root mean square distance of the rays from their point. [m]
    rays : ndarray of int, shape (n,)
        Number of rays used.
    status : ndarray of int, shape (n,)
        `BathymetryStatus`: RAYS below the water, DRY above it, FAILED.
    """

    xyz: FloatArray
    covariance: FloatArray
    misfit: FloatArray
    rays: IntArray
    status: IntArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of X, Y and Z, shape (n, 3). [m]"""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def intersect_refracted_rays(
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    water_level: float | WaterSurface,
    refractive_index: float,
    sigma_direction: float = 1e-4,
) -> RayIntersections:
    """Refract measured rays at the water surface and intersect them.

    Parameters
    ----------
    origins, directions : array_like, shape (n, k, 3)
        Up to k rays for each of n points, in air, directions of any length; NaN for rays that a
        point does not have. [m]
    water_level : float or WaterSurface
        Height of the water [m] or a surface.
    refractive_index : float
        Refractive index of the water relative to the air.
    sigma_direction : float
        Standard deviation of a direction across the ray: image precision over principal distance.
        [rad]

    Returns
    -------
    RayIntersections
        Points that are nearest to their rays, weighted by the distance from the cameras, with
        covariance. Rays whose straight intersection lies above the water are not refracted.

    Examples
    --------
    Two rays 45 degrees left and right meet water 1 m below them at x = -1 and 1 and go on at
    32.03 degrees: they cross 1 / tan(32.03 deg) = 1.5986 m below the surface.

    >>> rays = intersect_refracted_rays(
    ...     [[[-2, 0, 1], [2, 0, 1]]], [[[1, 0, -1], [-1, 0, -1]]],
    ...     water_level=0, refractive_index=4 / 3)
    >>> print(rays.xyz.round(4) + 0.0)
    [[ 0.      0.     -1.5986]]
    """
    start = as_points(origins, "origins", dimension=3)
    heading = as_points(directions, "directions", dimension=3)
    start, heading = np.broadcast_arrays(start, heading)
    if start.ndim != 3:
        raise InputError(f"origins: expected shape (points, rays, 3), found {start.shape}.")
    surface, n_water = as_water_surface(water_level), checked_water_index(refractive_index)
    with np.errstate(invalid="ignore", divide="ignore"):
        heading = heading / np.linalg.norm(heading, axis=-1, keepdims=True)
    given = np.isfinite(start + heading).all(-1)
    offset = np.round(start[given].mean(0)) if given.any() else np.zeros(3)
    local = surface.shifted(-offset)
    start = np.where(given[..., None], start - offset, 0.0)
    heading = np.where(given[..., None], heading, [0.0, 0.0, -1.0])
    straight, *_ = _meet(start, heading, start, given)
    dry = straight[:, 2] >= local.height_at(straight[:, :2])
    water = SurfaceSequence(surfaces=(local,), indices=(1.0, n_water))
    path = trace_rays(start, heading, water)
    refracted = given & (path.status == 0)
    use = np.where(dry[:, None], given, refracted)
    at = np.where(dry[:, None, None], start, np.nan_to_num(path.vertices[..., 0, :]))
    on = np.where(dry[:, None, None], heading, np.nan_to_num(path.directions[..., 1, :]))
    xyz, inverse, misfit, strong = _meet(at, on, start, use)
    status = np.where(dry, BathymetryStatus.DRY, BathymetryStatus.RAYS).astype(np.int64)
    under = xyz[:, 2] < local.height_at(xyz[:, :2])
    # Refracted rays that meet above the water belong to no point under it.
    status[~strong | (~dry & ~under)] = BathymetryStatus.FAILED
    failed = status == BathymetryStatus.FAILED
    xyz[failed], inverse[failed], misfit[failed] = np.nan, np.nan, np.nan
    return RayIntersections(
        xyz=xyz + offset,
        covariance=inverse * sigma_direction**2,
        misfit=misfit,
        rays=use.sum(-1),
        status=status,
    )


def _meet(
    at: FloatArray, heading: FloatArray, centres: FloatArray, use: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return where lines meet best, the inverse normal matrix, the misfit, and whether fixed."""
    across = np.eye(3) - heading[..., :, None] * heading[..., None, :]
    weights = use.astype(float)
    point = np.full((len(at), 3), np.nan)
    inverse = np.full((len(at), 3, 3), np.nan)
    strong = use.sum(-1) >= 2
    for _ in range(ROUNDS):
        normal = np.einsum("nk,nkij->nij", weights, across)
        right = np.einsum("nk,nkij,nkj->ni", weights, across, at)
        values = np.linalg.eigvalsh(normal)
        strong &= values[:, 0] > SMALLEST_ANGLE**2 * values[:, 2]
        inverse[strong] = np.linalg.inv(normal[strong])
        point[strong] = np.einsum("nij,nj->ni", inverse[strong], right[strong])
        point[~strong], inverse[~strong] = np.nan, np.nan
        # Equal precision of the directions: the farther the camera, the lighter the ray.
        square = ((point[:, None] - centres) ** 2).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            weights = np.where(use & (square > 0), 1 / square, 0.0)
    gap = np.einsum("nkij,nkj->nki", across, at - point[:, None])
    with np.errstate(invalid="ignore", divide="ignore"):
        misfit = np.sqrt(((gap**2).sum(-1) * use).sum(-1) / use.sum(-1))
    return point, inverse, misfit, strong


def correct_lidar_beams(
    origins: ArrayLike,
    points: ArrayLike,
    *,
    water_level: float | WaterSurface,
    refractive_index: float,
    group_index: float | None = None,
) -> CorrectedPoints:
    """Correct laser echoes from under water for refraction and for the slower light.

    Parameters
    ----------
    origins : array_like, shape (..., 3)
        Where the sensor was at each shot. [m]
    points : array_like, shape (..., 3)
        Echoes computed as if all of the way were air: they give direction and range. [m]
    water_level : float or WaterSurface
        Height of the water [m] or a surface.
    refractive_index : float
        Refractive index that bends the beam, relative to the air.
    group_index : float, optional
        Index that slows the pulse; the same as ``refractive_index`` unless given (in water at
        532 nm it is about 0.02 to 0.03 higher).

    Returns
    -------
    CorrectedPoints
        Echoes above the water stay as they are.

    Examples
    --------
    Straight down from 10 m, an echo 4 m under the surface by time of flight lies 3 m under it:

    >>> beam = correct_lidar_beams([0, 0, 10], [0, 0, -4], water_level=0, refractive_index=4 / 3)
    >>> print(beam.xyz.round(9))
    [ 0.  0. -3.]
    """
    start, echo = np.broadcast_arrays(
        as_points(origins, "origins", dimension=3), as_points(points, "points", dimension=3)
    )
    shape = echo.shape
    start, echo = start.reshape(-1, 3), echo.reshape(-1, 3)
    surface, n_water = as_water_surface(water_level), checked_water_index(refractive_index)
    with located("" if group_index is None else "group index"):
        slowed = n_water if group_index is None else checked_water_index(group_index)
    finite = np.asarray(np.isfinite(start + echo).all(-1))
    offset = np.round(echo[finite].mean(0)) if finite.any() else np.zeros(3)
    start, echo, local = start - offset, echo - offset, surface.shifted(-offset)
    below = local.height_at(echo[:, :2]) - echo[:, 2]
    path = trace_rays(
        start, echo - start, SurfaceSequence(surfaces=(local,), indices=(1.0, n_water))
    )
    surface_at, onward = path.vertices[:, 0], path.directions[:, 1]
    air = np.linalg.norm(surface_at - start, axis=-1)
    rest = np.linalg.norm(echo - start, axis=-1) - air
    hit = (path.status == 0) & (rest > 0) & (local.side(start) > 0)
    xyz = np.where(hit[:, None], surface_at + (rest / slowed)[:, None] * onward, echo)
    status = np.where(hit, BathymetryStatus.RAYS, BathymetryStatus.DRY).astype(np.int64)
    status[~hit & np.isnan(below)] = BathymetryStatus.NO_SURFACE
    wrong = ~finite | (~hit & (below > 0))
    status[wrong] = BathymetryStatus.FAILED
    xyz[wrong] = np.nan
    depth = np.where(hit, local.height_at(xyz[:, :2]) - xyz[:, 2], 0.0)
    return CorrectedPoints(
        xyz=(xyz + offset).reshape(shape),
        depth=depth.reshape(shape[:-1]),
        status=status.reshape(shape[:-1]),
    )
