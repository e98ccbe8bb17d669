"""Common points of photos taken through media: their rays meet, and nothing else is asked."""

from __future__ import annotations

import numpy as np

from bifocal.model.orientation_precision import rates_of
from bifocal.orientation.adjustment.observed_points import views_of
from bifocal.orientation.adjustment.pair_observations import (
    Equations,
    PairObservations,
    PairUnknowns,
)
from photocore.arrays import BoolArray

#: Steps to the point nearest to both rays; the first is good to a thousandth of the misfit.
STEPS = 2


def meeting_equations(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> Equations:
    """Return how far ties are from pixels whose refracted rays meet, signed, shape (m,). [px]

    With the derivatives by the unknowns, shape (m, u).

    Notes
    -----
    Four pixels and three unknown coordinates: what the nearest point leaves of the pixels has one
    direction, square to all that moving the point can do. The point being nearest, neither it nor
    that direction needs a derivative.
    """
    models = observations.radial_models(state.radial)
    raw = observations.tie1[which], observations.tie2[which]
    straight = [model.undistort(x) for model, x in zip(models, raw, strict=True)]
    pixels, xyz = np.concatenate(straight, axis=1), state.media.meeting(state.cameras, *straight)
    for _ in range(STEPS):
        views = views_of(state, xyz)
        design = np.concatenate([seen.by_point for seen in views], axis=1)
        lost = ~np.isfinite(design).all(axis=(1, 2))
        design[lost] = np.eye(4, 3)
        off = pixels - np.concatenate([seen.pixels for seen in views], axis=1)
        base, triangle = np.linalg.qr(design, mode="complete")
        along = base.transpose(0, 2, 1) @ off[..., None]
        xyz = xyz + np.linalg.solve(triangle[:, :3], along[:, :3])[..., 0]
    rates = [
        rates_of(seen, -model.undistorted_by_k(x), number)
        for number, (seen, model, x) in enumerate(zip(views, models, raw, strict=True))
    ]
    across = base[:, None, :, 3]
    by = state.media.rates_by_unknowns(-(across @ np.concatenate(rates, axis=1))[:, 0])
    return along[:, 3, 0], by
