"""What the adjustment of a pair computes of points: where cameras show them, where rays meet."""

from __future__ import annotations

import numpy as np

from bifocal.media import PointViews, view
from bifocal.orientation.adjustment.pair_observations import PairObservations, PairUnknowns
from photocore.arrays import FloatArray

#: A coordinate that was not measured, as a standard deviation. [m]
UNKNOWN = 1e6


def views_of(state: PairUnknowns, xyz: FloatArray) -> list[PointViews]:
    """Return both cameras' pixels of points with their derivatives."""
    return [view(c, state.media.path(k, c), xyz) for k, c in enumerate(state.cameras)]


def known_points(
    observations: PairObservations, state: PairUnknowns, picks: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return control points, what was not measured filled in roughly, and their sigmas."""
    control = observations.control
    both = state.media.meeting(state.cameras, picks[:, :2], picks[:, 2:])
    first, second = (
        state.media.on_plane(k, camera, picks[:, 2 * k : 2 * k + 2])
        for k, camera in enumerate(state.cameras)
    )
    single = np.where(np.isfinite(first), first, second)
    guess = np.where(np.isfinite(both), both, single)
    flat = control.sigma[:, 2:] < UNKNOWN  # relief known: the plane fixes X and Y better
    guess = np.where(flat & np.isfinite(single) & (control.xyz[:, 2:] == 0), single, guess)
    coordinates = np.where(np.isfinite(control.xyz), control.xyz, np.nan_to_num(guess))
    return coordinates, np.where(np.isfinite(control.xyz), control.sigma, UNKNOWN)
