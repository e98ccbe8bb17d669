"""Least-squares intersection of a pair's rays with covariances and flags."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bifocal import rays
from bifocal.model.intersection import Intersection
from photocore.arrays import FloatArray
from photocore.errors import InputError

if TYPE_CHECKING:
    from bifocal.model.pair import Pair


def intersect_pair(
    pair: Pair,
    pixels1: FloatArray,
    pixels2: FloatArray,
    *,
    sigma_px: float | None,
    sigma_r_max: float | None,
    sigma_setup: tuple[float, float, float, float],
) -> Intersection:
    """Return points, covariances, misfits and flags; see `Pair.intersect`."""
    from bifocal.model.pair import BLUNDER_LIMIT, SIGMA_PIXEL, UNCERTAIN_SHARE

    sigmas = [sigma_px or photo.sigma_pixel or SIGMA_PIXEL for photo in (pair.image1, pair.image2)]
    if not all(np.isfinite(value) and value > 0 for value in sigmas):
        raise InputError(f"sigma_px: must be a number above zero [px], got {sigma_px}.")
    far, near = pair.image1.foot, pair.image2.foot
    centre = pair.zoom_centre
    q1, q2 = pair.image1.plane_from_pixels(pixels1), pair.image2.plane_from_pixels(pixels2)
    metres1 = pair.image1.metres_per_pixel(pixels1)
    metres2 = pair.image2.metres_per_pixel(pixels2)
    cov1 = _square(metres1) * sigmas[0] ** 2
    cov2 = _square(metres2) * sigmas[1] ** 2
    a1, a2, standardised = rays.adjust_onto_epipolar_line(q1, q2, cov1, cov2, centre)
    relief = rays.relief_of_rays(a1, a2, far, near)
    # A point at or behind the near camera cannot be in the photo: the rays diverge there.
    relief = np.where(relief < near.distance, relief, np.nan)
    xyz = rays.point_on_ray(a1, relief, far)
    covariance = _covariance(xyz, a2, cov1, cov2, far, near, sigma_setup)
    misfit = _misfit(q1, q2, metres2, centre)
    limit = sigma_r_max or UNCERTAIN_SHARE * near.distance
    flags = _flags(
        relief,
        np.sqrt(covariance[:, 2, 2]),
        standardised,
        np.hstack([q1 - centre, q2]),
        limit,
        BLUNDER_LIMIT,
    )
    return Intersection(
        xyz=xyz,
        covariance=covariance,
        residuals=np.concatenate([_pixels(metres1, q1 - a1), _pixels(metres2, q2 - a2)], axis=1),
        misfit=misfit,
        standardised=standardised,
        e1=_outward(a1 - xyz[:, :2], xyz[:, :2] - far.nadir),
        e2=_outward(a2 - xyz[:, :2], xyz[:, :2] - near.nadir),
        flags=flags,
        sigma_px=float(np.hypot(sigmas[0], sigmas[1]) / np.sqrt(2.0)),
    )


def _square(jacobian: FloatArray) -> FloatArray:
    """Return J J^T for every point."""
    product: FloatArray = jacobian @ jacobian.transpose(0, 2, 1)
    return product


def _inverse2(matrix: FloatArray) -> FloatArray:
    """Return the inverses of 2x2 matrices; NaN where singular."""
    a, b, c, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = 1.0 / (a * d - b * c)
    inverse = np.empty_like(matrix)
    inverse[:, 0, 0], inverse[:, 0, 1] = d * factor, -b * factor
    inverse[:, 1, 0], inverse[:, 1, 1] = -c * factor, a * factor
    return inverse


def _inverse3(matrix: FloatArray) -> FloatArray:
    """Return the inverses of symmetric 3x3 matrices by cofactors; NaN where singular."""
    m = matrix
    cofactor = np.empty_like(m)
    cofactor[:, 0, 0] = m[:, 1, 1] * m[:, 2, 2] - m[:, 1, 2] ** 2
    cofactor[:, 0, 1] = m[:, 0, 2] * m[:, 1, 2] - m[:, 0, 1] * m[:, 2, 2]
    cofactor[:, 0, 2] = m[:, 0, 1] * m[:, 1, 2] - m[:, 0, 2] * m[:, 1, 1]
    cofactor[:, 1, 1] = m[:, 0, 0] * m[:, 2, 2] - m[:, 0, 2] ** 2
    cofactor[:, 1, 2] = m[:, 0, 1] * m[:, 0, 2] - m[:, 0, 0] * m[:, 1, 2]
    cofactor[:, 2, 2] = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] ** 2
    cofactor[:, 1, 0], cofactor[:, 2, 0] = cofactor[:, 0, 1], cofactor[:, 0, 2]
    cofactor[:, 2, 1] = cofactor[:, 1, 2]
    determinant = (
        m[:, 0, 0] * cofactor[:, 0, 0]
        + m[:, 0, 1] * cofactor[:, 0, 1]
        + m[:, 0, 2] * cofactor[:, 0, 2]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(determinant > 0, 1.0 / determinant, np.nan)[:, None, None] * cofactor


def _covariance(
    xyz: FloatArray,
    a2: FloatArray,
    cov1: FloatArray,
    cov2: FloatArray,
    far: rays.Foot,
    near: rays.Foot,
    sigma_setup: tuple[float, float, float, float],
) -> FloatArray:
    """Return the covariance of (X, Y, r) from pixels and, where given, from the set-up."""
    weighted = []
    normal = np.zeros((len(xyz), 3, 3))
    for camera, cov in ((far, cov1), (near, cov2)):
        rows = rays.design_rows(xyz, camera)
        product = rows.transpose(0, 2, 1) @ _inverse2(cov)
        weighted.append(product)
        normal += product @ rows
    covariance = _inverse3(normal)
    sigma_d1, sigma_d2, sigma_scale, sigma_nadir = sigma_setup
    if not any(sigma_setup):
        return covariance
    relief = xyz[:, 2]
    effects = []
    for camera, product, sigma_d in ((far, weighted[0], sigma_d1), (near, weighted[1], sigma_d2)):
        # Derivatives of q = N + (P - N) d / (d - r) with respect to d and to N.
        depth = camera.distance - relief
        by_distance = -(xyz[:, :2] - camera.nadir) * (relief / depth**2)[:, None]
        effects.append(product @ (by_distance * sigma_d)[:, :, None])
        effects.append(product * (-relief / depth * sigma_nadir)[:, None, None])
    # A scale error of image 2 stretches the measured positions about its nadir.
    effects.append(weighted[1] @ ((a2 - near.nadir) * sigma_scale)[:, :, None])
    effect = covariance @ np.concatenate(effects, axis=2)
    return covariance + _square(effect)


def _pixels(metres: FloatArray, shift: FloatArray) -> FloatArray:
    """Return a shift on the plane in pixels of the image."""
    shift_px: FloatArray = (_inverse2(metres) @ shift[:, :, None])[:, :, 0]
    return shift_px


def _misfit(q1: FloatArray, q2: FloatArray, metres2: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the signed distance of pick 2 from the radial line through pick 1. [px]"""
    v1, v2 = q1 - centre, q2 - centre
    radius = np.hypot(v1[:, 0], v1[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (v1[:, 0] * v2[:, 1] - v1[:, 1] * v2[:, 0]) / radius
        normal = np.stack([-v1[:, 1], v1[:, 0]], axis=-1) / radius[:, None]
    return np.copysign(np.linalg.norm(_pixels(metres2, normal * across[:, None]), axis=1), across)


def _outward(shift: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the length of a displacement along the outward direction."""
    length = np.hypot(direction[:, 0], direction[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (shift * direction).sum(axis=1) / length
    return np.where(length > 0, along, np.where(np.isnan(shift[:, 0]), np.nan, 0.0))


def _flags(
    relief: FloatArray,
    sigma: FloatArray,
    standardised: FloatArray,
    radial: FloatArray,
    limit: float,
    blunder: float,
) -> tuple[str, ...]:
    """Return the first flag of `FLAGS` that applies to each point."""
    with np.errstate(invalid="ignore"):
        conditions = [
            np.all(radial[:, :2] == 0, axis=1),
            np.abs(standardised) > blunder,
            np.any(np.isnan(radial), axis=1),  # measured in one photo only, or beyond the horizon
            ~(sigma <= limit) | np.isnan(relief),
            sigma > limit / 2,
            np.abs(relief) < 2 * sigma,
        ]
    names = ["NADIR", "OFF-RADIAL", "CHECK", "UNCERTAIN", "WEAK", "ON-PLANE"]
    return tuple(np.select(conditions, names, default="OK").tolist())
