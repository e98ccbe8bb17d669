"""Common points of photos taken through media: their bent rays meet, and nothing else is asked."""

from __future__ import annotations

import numpy as np

from bifocal import rays
from bifocal.model.homography import homography_jacobian
from bifocal.model.refracted_view import foot_of
from bifocal.orientation.pair_observations import Equations, PairObservations, PairUnknowns
from photocore.arrays import BoolArray, FloatArray
from photocore.camera.pinhole import plane_from_pixel, ray_on_plane

#: Steps of the derivatives: pixels, and everything else (logarithms, radians, metres, indices).
STEP_PIXEL, STEP = 1e-3, 1e-6


def bent_misfit(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> FloatArray:
    """Return how far ties are from places where their bent rays meet, signed, shape (m,). [px]

    Notes
    -----
    With f = 0 where both rays meet (`bifocal.rays.meeting_of`), f over the length of its gradient
    by the four pixels, as the Sampson distance from an epipolar line.
    """
    assert state.media is not None
    straight = observations.straight_ties(state.radial)
    places, metres, feet = [], [], []
    for number, (camera, pixels) in enumerate(zip(state.cameras, straight, strict=True)):
        places.append(ray_on_plane(camera, pixels[which])[:, :2])
        metres.append(homography_jacobian(plane_from_pixel(camera), pixels[which]))
        feet.append(foot_of(camera, state.media.path(number, camera)))
    value, *by_places = rays.meeting_of(feet[0], feet[1], np.zeros(2))(places[0], places[1])
    by_pixels = [(g[:, None, :] @ j)[:, 0] for g, j in zip(by_places, metres, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(value / np.linalg.norm(np.hstack(by_pixels), axis=1))


def bent_equations(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> Equations:
    """Return `bent_misfit` and its derivatives by the unknowns, by central differences."""
    names, free = observations.names, observations.estimated
    by = np.zeros((int(which.sum()), len(names)))
    for column in np.flatnonzero(free):
        size = STEP_PIXEL if names[column].startswith(("column", "row")) else STEP
        step = np.zeros(len(names))
        step[column] = size
        ahead, behind = state.stepped(step), state.stepped(-step)
        # At the end of what can be, as a thickness of zero, one side only.
        ends = [end or state for end in (ahead, behind)]
        wide = size * ((ahead is not None) + (behind is not None))
        parts = [bent_misfit(observations, end, which) for end in ends]
        by[:, column] = (parts[0] - parts[1]) / wide
    return bent_misfit(observations, state, which), by
