"""Tie points of a pair whose cameras are known: relief, wall membership, sub-pixel refinement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.orientation.alignment import Interior
from bifocal.orientation.bundle import Problem, Solution, adjust, radial_shift
from bifocal.orientation.patches import refine, same_scale
from bifocal.orientation.pinhole import Pinhole, fundamental, projection_rows, triangulate
from photocore.arrays import BoolArray, ByteArray, FloatArray

#: Ties of a wall that count as independent of each other.
INDEPENDENT = 50
#: Roughness of a wall as a share of the far distance, at successive passes: a first plane may
#: swallow ashlar of some centimetres, the last holds the wall's own face.
ROUGHNESS = (0.004, 0.002, 0.0012)


def robust_sigma(values: FloatArray) -> float:
    """Return 1.4826 times the median absolute value: the sigma of the honest majority."""
    finite = np.abs(values[np.isfinite(values)])
    return float(1.4826 * np.median(finite)) if len(finite) else np.inf


def relief_rate(cameras: tuple[Pinhole, Pinhole], xyz: FloatArray) -> FloatArray:
    """Return how far a point moves in photo 2 per metre of relief along its ray 1, (n, 2) [px/m]"""
    ray = xyz - cameras[0].centre
    with np.errstate(divide="ignore", invalid="ignore"):
        ray = ray / ray[:, 2:]
    return np.einsum("nij,nj->ni", projection_rows(cameras[1], xyz), ray)


def local_maps(
    cameras: tuple[Pinhole, Pinhole],
    interiors: tuple[Interior, Interior],
    xyz: FloatArray,
    raw: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return the derivative of photo 2 by photo 1 for surfaces parallel to the wall, (n, 2, 2)."""
    first, second = (
        _undistorted(interior, pixels, projection_rows(camera, xyz)[:, :, :2])
        for camera, interior, pixels in zip(cameras, interiors, raw, strict=True)
    )
    bad = ~(np.abs(np.linalg.det(np.nan_to_num(first))) > 0)
    first[bad], second[bad] = np.eye(2), np.eye(2)
    return second @ np.linalg.inv(first)


def _undistorted(interior: Interior, raw: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the derivative of raw pixels, given that of ideal pixels."""
    if interior.lens is None:
        return rows
    half = np.array([0.5, 0.0])
    right = interior.ideal(raw + half) - interior.ideal(raw - half)
    down = interior.ideal(raw + half[::-1]) - interior.ideal(raw - half[::-1])
    return np.linalg.inv(np.stack([right, down], axis=-1)) @ rows


def raw_pixels(interior: Interior, ideal: FloatArray) -> FloatArray:
    """Return where ideal pixels are seen in the photo as it is."""
    return ideal.copy() if interior.lens is None else np.asarray(interior.lens.distort(ideal))


def refine_ties(
    problem: Problem, solution: Solution, images: tuple[ByteArray, ByteArray]
) -> tuple[FloatArray, BoolArray]:
    """Return the ties' positions in photo 2 to a tenth of a pixel, and which could be refined."""
    interiors = problem.interiors
    straight = [
        radial_shift(x, i, k) if k else x
        for x, i, k in zip((problem.tie1, problem.tie2), interiors, solution.radial, strict=True)
    ]
    xyz = triangulate(*solution.cameras, *straight)
    raw1, raw2 = raw_pixels(interiors[0], problem.tie1), raw_pixels(interiors[1], problem.tie2)
    local = local_maps(solution.cameras, interiors, xyz, (raw1, raw2))
    usable = problem.tie_used & np.isfinite(local).all(axis=(1, 2))
    smooth1, smooth2 = same_scale(*images, local[usable])
    both = np.broadcast_to(np.eye(2), (len(raw1), 2, 2))
    found = refine(smooth1, smooth2, raw1, raw2, local, both, reach=4.0)
    good = found.converged & (found.zncc > 0.85) & (found.sigma < 0.3)
    return interiors[1].ideal(found.pixels2), good


def classify(problem: Problem, solution: Solution, *, share: float, sigma: float) -> Problem:
    """Return the problem with gross ties left out and the wall's ties found anew.

    Parameters
    ----------
    share : float
        Roughness of the wall, as a share of the far distance.
    sigma : float
        Precision of a tie's coordinate. [px]
    """
    cameras = solution.cameras
    used = np.abs(solution.tie_misfit) < 3.5 * sigma
    xyz = triangulate(*cameras, problem.tie1, problem.tie2)
    lowest = min(camera.centre[2] for camera in cameras)
    used &= np.isfinite(xyz).all(axis=1) & (xyz[:, 2] < 0.95 * lowest)
    on_plane = np.column_stack([xyz[:, :2], np.zeros(len(xyz))])
    rate = np.linalg.norm(np.nan_to_num(relief_rate(cameras, on_plane)), axis=1)
    sigma_wall = np.hypot(1.5 * sigma, rate * share * cameras[0].centre[2] / 2)
    wall = used & (np.abs(solution.wall_misfit) < 2.0 * sigma_wall)
    # Unevenness is common to whole stretches of wall: a thousand ties know its plane no better
    # than some fifty independent ones.
    sigma_wall = sigma_wall * np.sqrt(max(wall.sum() / INDEPENDENT, 1.0))
    return replace(
        problem, tie_used=used, wall=wall, sigma_wall=sigma_wall, sigma_tie=max(sigma, 0.03)
    )


def settle(
    problem: Problem, solution: Solution, *, shares: tuple[float, ...] = ROUGHNESS
) -> tuple[Problem, Solution]:
    """Return the problem and its solution after the wall and the gross ties are settled."""
    for share in shares:
        sigma = max(robust_sigma(solution.tie_misfit[problem.tie_used]), 0.03)
        problem = classify(problem, solution, share=share, sigma=sigma)
        solution = adjust(problem, solution.cameras, radial=solution.radial, plane=solution.plane)
    return problem, solution


def epipole_angle(cameras: tuple[Pinhole, Pinhole], xyz: FloatArray) -> FloatArray:
    """Return the angle at which the two rays to each point meet. [rad]"""
    first, second = (camera.centre - xyz for camera in cameras)
    cosine = (first * second).sum(1) / (
        np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    )
    return np.arccos(np.clip(cosine, -1, 1))


def epipolar_lines(cameras: tuple[Pinhole, Pinhole], pixels1: FloatArray) -> FloatArray:
    """Return the lines in photo 2 of ideal pixels 1, (a, b) of unit length, shape (n, 3)."""
    line = np.column_stack([pixels1, np.ones(len(pixels1))]) @ fundamental(*cameras).T
    with np.errstate(divide="ignore", invalid="ignore"):
        return line / np.hypot(line[:, 0], line[:, 1])[:, None]
