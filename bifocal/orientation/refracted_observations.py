"""What the adjustment of a pair computes of points: rays straight in air, bent through media."""

from __future__ import annotations

import numpy as np

from bifocal import rays
from bifocal.model.refracted_view import RefractedView, foot_of, seen_through, view_through
from bifocal.orientation.pair_media import PairMedia
from bifocal.orientation.pair_observations import Equations, PairObservations, PairUnknowns
from photocore.arrays import FloatArray
from photocore.camera.pinhole import (
    ProjectedPoints,
    project,
    project_with_jacobian,
    ray_on_plane,
    triangulate,
)

#: A coordinate that was not measured, as a standard deviation. [m]
UNKNOWN = 1e6


def views_of(state: PairUnknowns, xyz: FloatArray) -> list[ProjectedPoints] | list[RefractedView]:
    """Return both cameras' pixels of points with their derivatives."""
    if state.media is None:
        return [project_with_jacobian(camera, xyz) for camera in state.cameras]
    media = state.media
    return [view_through(c, media.path(k, c), xyz) for k, c in enumerate(state.cameras)]


def pixels_of(state: PairUnknowns, xyz: FloatArray) -> list[FloatArray]:
    """Return both cameras' pixels of points."""
    if state.media is None:
        return [project(camera, xyz) for camera in state.cameras]
    media = state.media
    return [seen_through(c, media.path(k, c), xyz) for k, c in enumerate(state.cameras)]


def guessed_points(
    state: PairUnknowns, picks: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where the rays of picks (n, 4) meet, and where either meets the plane, (n, 3) each."""
    seen = picks[:, :2], picks[:, 2:]
    on_plane = [ray_on_plane(c, p) for c, p in zip(state.cameras, seen, strict=True)]
    if state.media is None:
        return triangulate(*state.cameras, *seen), on_plane[0], on_plane[1]
    media = state.media
    far, near = (foot_of(c, media.path(k, c)) for k, c in enumerate(state.cameras))
    q1, q2 = on_plane[0][:, :2], on_plane[1][:, :2]
    both = rays.point_on_ray(q1, rays.relief_of_rays(q1, q2, far, near), far)
    flat = np.zeros(len(picks))
    return both, rays.point_on_ray(q1, flat, far), rays.point_on_ray(q2, flat, near)


def known_points(
    observations: PairObservations, state: PairUnknowns, picks: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return control points, what was not measured filled in roughly, and their sigmas."""
    control = observations.control
    both, first, second = guessed_points(state, picks)
    single = np.where(np.isfinite(first), first, second)
    guess = np.where(np.isfinite(both), both, single)
    flat = control.sigma[:, 2:] < UNKNOWN  # relief known: the plane fixes X and Y better
    guess = np.where(flat & np.isfinite(single) & (control.xyz[:, 2:] == 0), single, guess)
    known = np.where(np.isfinite(control.xyz), control.xyz, np.nan_to_num(guess))
    return known, np.where(np.isfinite(control.xyz), control.sigma, UNKNOWN)


def with_media_priors(cameras: Equations, given: PairMedia, state: PairMedia) -> Equations:
    """Return the cameras' priors with those of the media, in the unknowns of both."""
    values, by = cameras
    known = {name: sigma for name, sigma in given.sigmas.items() if np.isfinite(sigma)}
    rows = np.zeros((len(known), by.shape[1] + len(given.sigmas)))
    off = np.zeros(len(known))
    for row, (name, sigma) in enumerate(known.items()):
        off[row] = (state.value(name) - given.value(name)) / sigma
        rows[row, given.names.index(name)] = 1.0 / sigma
    by = np.concatenate([by, np.zeros((len(by), len(given.sigmas)))], axis=1)
    return np.concatenate([values, off]), np.concatenate([by, rows])
