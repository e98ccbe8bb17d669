"""Tie points of a pair whose cameras are known: relief, wall membership, sub-pixel refinement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.orientation.interior_orientation import Cameras, Images, Interiors
from bifocal.orientation.pair_adjustment import AdjustedPair
from bifocal.orientation.pair_observations import PairObservations
from bifocal.orientation.patches import refine, same_scale
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import project_with_jacobian, triangulate

#: Ties of a wall that count as independent of each other.
INDEPENDENT = 50
#: Roughness of a wall as a share of the far distance, at successive passes: a first plane may
#: swallow ashlar of some centimetres, the last holds the wall's own face.
ROUGHNESS = (0.004, 0.002, 0.0012)


def robust_sigma(values: FloatArray) -> float:
    """Return 1.4826 times the median absolute value: the sigma of the honest majority."""
    finite = np.abs(values[np.isfinite(values)])
    return float(1.4826 * np.median(finite)) if len(finite) else np.inf


def relief_rate(cameras: Cameras, xyz: FloatArray) -> FloatArray:
    """Return how far a point moves in photo 2 per metre of relief along its ray 1, (n, 2) [px/m]"""
    ray = xyz - cameras[0].centre
    with np.errstate(divide="ignore", invalid="ignore"):
        ray = ray / ray[:, 2:]
    return np.einsum("nij,nj->ni", project_with_jacobian(cameras[1], xyz).by_point, ray)


def local_maps(
    cameras: Cameras, interiors: Interiors, xyz: FloatArray, ideal: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the derivative of photo 2 by photo 1 for surfaces parallel to the wall, (n, 2, 2)."""
    first, second = (
        interior.raw_by_ideal(pixels) @ project_with_jacobian(camera, xyz).by_point[:, :, :2]
        for camera, interior, pixels in zip(cameras, interiors, ideal, strict=True)
    )
    bad = ~(np.abs(np.linalg.det(np.nan_to_num(first))) > 0)
    first[bad], second[bad] = np.eye(2), np.eye(2)
    return second @ np.linalg.inv(first)


def refine_ties(
    observations: PairObservations, adjusted: AdjustedPair, images: Images
) -> tuple[FloatArray, BoolArray]:
    """Return the ties' positions in photo 2 to a tenth of a pixel, and which could be refined."""
    interiors, ties = observations.interiors, (observations.tie1, observations.tie2)
    xyz = triangulate(*adjusted.cameras, *observations.straight_ties(adjusted.radial))
    raw1, raw2 = interiors[0].raw(ties[0]), interiors[1].raw(ties[1])
    local = local_maps(adjusted.cameras, interiors, xyz, ties)
    usable = observations.tie_used & np.isfinite(local).all(axis=(1, 2))
    smooth1, smooth2 = same_scale(*images, local[usable])
    both = np.broadcast_to(np.eye(2), (len(raw1), 2, 2))
    patches = refine(smooth1, smooth2, raw1, raw2, local, both)
    good = patches.converged & (patches.zncc > 0.85) & (patches.sigma < 0.3)
    return interiors[1].ideal(patches.pixels2), good


def classify(
    observations: PairObservations, adjusted: AdjustedPair, *, share: float, sigma: float
) -> PairObservations:
    """Return the observations with gross ties left out and the wall's ties found anew.

    Parameters
    ----------
    share : float
        Roughness of the wall, as a share of the far distance.
    sigma : float
        Precision of a tie's coordinate. [px]
    """
    cameras = adjusted.cameras
    used = np.abs(adjusted.tie_misfit) < 3.5 * sigma
    xyz = triangulate(*cameras, observations.tie1, observations.tie2)
    lowest = min(camera.centre[2] for camera in cameras)
    used &= np.isfinite(xyz).all(axis=1) & (xyz[:, 2] < 0.95 * lowest)
    on_plane = np.column_stack([xyz[:, :2], np.zeros(len(xyz))])
    rate = np.linalg.norm(np.nan_to_num(relief_rate(cameras, on_plane)), axis=1)
    sigma_wall = np.hypot(1.5 * sigma, rate * share * cameras[0].centre[2] / 2)
    wall = used & (np.abs(adjusted.wall_misfit) < 2.0 * sigma_wall)
    # Unevenness is common to whole stretches of wall: a thousand ties know its plane no better
    # than some fifty independent ones.
    sigma_wall = sigma_wall * np.sqrt(max(wall.sum() / INDEPENDENT, 1.0))
    return replace(
        observations, tie_used=used, wall=wall, sigma_wall=sigma_wall, sigma_tie=max(sigma, 0.03)
    )
