"""Tie points of a pair whose cameras are known: relief, wall membership, sub-pixel refinement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.matching import refine, same_scale
from bifocal.model import Cameras, Images, Interiors, apply_homography
from bifocal.orientation.adjustment import refracted_ties
from bifocal.orientation.adjustment.observed_points import views_of
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair, wall_equations
from bifocal.orientation.adjustment.pair_observations import PairObservations, PairUnknowns
from bifocal.orientation.starts.relative_orientation import Ties, supported
from bifocal.orientation.tuning import TIES, WALLS
from bifocal.orientation.walls.reference_plane import NarrowFace, narrow_face
from photocore.adjustment import OUTLIER_LIMIT
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import (
    fundamental,
    homogeneous,
    plane_transfer,
    project_with_jacobian,
    ray_on_plane,
)


def relief_rate(cameras: Cameras, xyz: FloatArray) -> FloatArray:
    """Return how far a point moves in photo 2 per metre of relief along its ray 1, (n, 2) [px/m]"""
    ray = xyz - cameras[0].centre
    with np.errstate(divide="ignore", invalid="ignore"):
        ray = ray / ray[:, 2:]
    return np.einsum("nij,nj->ni", project_with_jacobian(cameras[1], xyz).by_point, ray)


def local_maps(
    state: PairUnknowns, interiors: Interiors, xyz: FloatArray, ideal: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the derivative of photo 2 by photo 1 for surfaces parallel to the wall, (n, 2, 2)."""
    first, second = (
        interior.raw_by_ideal(pixels) @ one.by_point[:, :, :2]
        for one, interior, pixels in zip(views_of(state, xyz), interiors, ideal, strict=True)
    )
    bad = ~(np.abs(np.linalg.det(np.nan_to_num(first))) > 0)
    first[bad], second[bad] = np.eye(2), np.eye(2)
    return second @ np.linalg.inv(first)


def refine_ties(
    observations: PairObservations, adjusted: PairUnknowns, images: Images
) -> tuple[FloatArray, BoolArray]:
    """Return the ties' positions in photo 2 to a tenth of a pixel, and which could be refined."""
    interiors, ties = observations.interiors, (observations.tie1, observations.tie2)
    xyz = tie_positions(observations, adjusted)
    raw1, raw2 = interiors[0].raw(ties[0]), interiors[1].raw(ties[1])
    local = local_maps(adjusted, interiors, xyz, ties)
    usable = observations.tie_used & np.isfinite(local).all(axis=(1, 2))
    smooth1, smooth2 = same_scale(*images, local[usable])
    both = np.broadcast_to(np.eye(2), (len(raw1), 2, 2))
    patches = refine(smooth1, smooth2, raw1, raw2, local, both)
    good = patches.converged & (patches.zncc > 0.85) & (patches.sigma < 0.3)
    return interiors[1].ideal(patches.pixels2), good


def with_ties(observations: PairObservations, ties: Ties) -> PairObservations:
    """Return the observations with common points, all of which take part."""
    return replace(
        observations,
        tie1=ties.seen1,
        tie2=ties.seen2,
        sigma_tie=ties.tolerance / 2,
        tie_used=np.ones(len(ties.seen1), dtype=bool),
        wall=ties.on_plane,
        wall_rows=np.zeros((3, len(ties.seen1))),
    )


def without_gross_ties(
    observations: PairObservations, adjusted: AdjustedPair, *, sigma: float
) -> PairObservations:
    """Return the observations with the ties that lie on their lines and before both cameras.

    Parameters
    ----------
    sigma : float
        Precision of a tie's coordinate. [px]
    """
    sigma = max(sigma, TIES.best)
    used = np.abs(adjusted.tie_misfit) < OUTLIER_LIMIT * sigma
    xyz = tie_positions(observations, adjusted)
    lowest = min(camera.centre[2] for camera in adjusted.cameras)
    used &= np.isfinite(xyz).all(axis=1) & (xyz[:, 2] < 0.95 * lowest)
    return replace(observations, tie_used=used, wall=observations.wall & used, sigma_tie=sigma)


def with_support(observations: PairObservations, adjusted: AdjustedPair) -> PairObservations:
    """Return the observations without ties that move unlike their neighbours (`supported`)."""
    used = np.flatnonzero(observations.tie_used)
    seen1, seen2 = observations.straight_ties(adjusted.radial)
    if adjusted.media:
        flat = adjusted.media.on_plane(0, adjusted.cameras[0], seen1[used])
        on_wall = views_of(adjusted, flat)[1].pixels
    else:
        on_wall = apply_homography(plane_transfer(*adjusted.cameras, np.zeros(3)), seen1[used])
    parallax = seen2[used] - on_wall
    width = max(observations.interiors[0].image_size)
    keep = np.zeros(len(seen1), dtype=bool)
    keep[used[supported(seen1[used], parallax, width)]] = True
    if keep.sum() < TIES.fewest_on_wall:
        return observations
    return replace(observations, tie_used=keep, wall=observations.wall & keep)


def tie_positions(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return where the rays of the ties meet, shape (m, 3). [m]"""
    return state.media.meeting(state.cameras, *observations.straight_ties(state.radial))


def relief_per_pixel(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return the relief of a pixel along the line in photo 2 at the ties, signed, (m,). [m/px]"""
    if state.media:
        return refracted_ties.relief_per_pixel(observations, state)
    far, near = state.cameras
    seen1 = observations.straight_ties(state.radial)[0]
    on_plane = ray_on_plane(far, seen1)
    line = homogeneous(seen1) @ fundamental(far, near).T
    along = np.column_stack([-line[:, 1], line[:, 0]]) / np.hypot(line[:, 0], line[:, 1])[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        return 1.0 / (relief_rate(state.cameras, on_plane) * along).sum(axis=1)


def with_wall(
    observations: PairObservations,
    state: PairUnknowns,
    tolerance: tuple[float, float],
    *,
    known: bool = False,
) -> PairObservations:
    """Return the observations with the wall's ties and what they tell of the reference plane.

    Parameters
    ----------
    observations, state
        Cameras in whose frame the wall lies near the reference plane.
    tolerance : pair of float
        How far the wall may lie from the reference plane [m] and slope against it [m/m], beyond
        what its own roughness leaves open.
    known : bool
        Whether the wall's ties are known roughly, from the dominant homography.

    Notes
    -----
    The heights of the wall's ties are fitted by a plane, weighted by their own precision and the
    wall's roughness; its height and slopes, whitened by their covariance, are three observations.
    Roughness is common to stretches of the wall: only every fourth cell of a tenth of the photo's
    width counts as independent.
    """
    xyz, metres, sigma, face = _wall_of(observations, state)
    if known:
        rough = WALLS.rough_band * float(state.cameras[0].centre[2])
        on_wall = observations.wall & np.isfinite(xyz).all(axis=1) & np.isfinite(metres)
        face = replace(face, roughness=rough, chance=on_wall.astype(float))
    members = observations.tie1[face.members]
    cell = np.floor(members / (0.1 * max(observations.interiors[0].image_size)))
    cells = len(np.unique(cell, axis=0))
    if face.chance.sum() < TIES.fewest_on_wall or cells < TIES.fewest_cells:
        return replace(
            observations,
            wall=np.zeros_like(face.members),
            wall_rows=np.zeros((3, len(face.members))),
        )
    # All that may be of the wall, by its chance: members alone would be cut off unevenly where
    # there is more shallow relief on one side.
    on = np.flatnonzero(face.chance > 0)
    middle = np.average(xyz[on, :2], axis=0, weights=face.chance[on])
    lifted = np.column_stack([np.ones(len(on)), xyz[on, :2]])
    weight = face.chance[on] / (sigma[on] ** 2 + face.roughness**2)
    inverse = np.linalg.inv((lifted * weight[:, None]).T @ lifted)
    independent = max(cells / 4.0, 3.0)
    covariance = inverse * max(face.chance.sum() / independent, 1.0)
    # The height is that of the wall's middle; slopes act about it.
    slack = np.zeros((3, 3))
    slack[0, 0] = tolerance[0] ** 2
    about = np.array([[1.0, -middle[0], -middle[1]], [0, 1, 0], [0, 0, 1]])
    slack[1:, 1:] = np.eye(2) * tolerance[1] ** 2
    whitening = np.linalg.cholesky(np.linalg.inv(covariance + about @ slack @ about.T)).T
    rows = np.zeros((3, len(xyz)))
    rows[:, on] = whitening @ inverse @ (lifted * (weight * metres[on])[:, None]).T
    return replace(observations, wall=face.members, wall_rows=rows)


def _wall_of(
    observations: PairObservations, state: PairUnknowns
) -> tuple[FloatArray, FloatArray, FloatArray, NarrowFace]:
    """Return the ties' places [m], relief per pixel [m/px], sigma of height [m]; the wall."""
    xyz = tie_positions(observations, state)
    metres = relief_per_pixel(observations, state)
    usable = observations.tie_used & np.isfinite(xyz).all(axis=1) & np.isfinite(metres)
    sigma = np.hypot(np.sqrt(2.0) * observations.sigma_tie * np.abs(metres), 1e-6)
    face = narrow_face(
        xyz[usable], sigma[usable], band=WALLS.rough_band * float(state.cameras[0].centre[2])
    )
    chance = np.zeros(len(xyz))
    chance[usable] = face.chance
    return xyz, metres, sigma, replace(face, chance=chance)


def wall_roughness(observations: PairObservations, state: PairUnknowns) -> float:
    """Return the standard deviation of the wall's own unevenness. [m]"""
    return _wall_of(observations, state)[3].roughness


def likely_on_wall(observations: PairObservations, state: PairUnknowns) -> int:
    """Return how many ties are more likely of the wall than of anything else."""
    return int((_wall_of(observations, state)[3].chance > 0.5).sum())


def wall_test(observations: PairObservations, adjusted: AdjustedPair) -> float:
    """Return how far the wall's ties lie from the reference plane, adjusted without them, in sigma.

    Root mean square of height and slopes over their standard deviations, the cameras' included.
    """
    values, by = wall_equations(observations, adjusted)
    covariance = np.eye(3) + by @ adjusted.covariance @ by.T
    return float(np.sqrt(values @ np.linalg.solve(covariance, values) / 3.0))
