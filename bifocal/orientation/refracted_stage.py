"""The stage of orientation that only pairs through media have: ties whose bent rays meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.orientation.adjustment.pair_adjustment import adjust, evaluated
from bifocal.orientation.orientation_stages import OrientedPair
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.tie_points import (
    tie_positions,
    without_gross_ties,
)
from bifocal.orientation.tuning import TUNING
from bifocal.remarks import remark
from photocore.adjustment.outliers import robust_sigma

#: Common points that take part, where each costs more than in air; fewer say nothing.
MOST_BENT_TIES, FEWEST_TIES = 1000, 20


def with_bent_ties(pair: OrientedPair, ties: Ties) -> OrientedPair:
    """Return a pair oriented by control points through media with ties whose bent rays meet."""
    some = np.linspace(0, len(ties.seen1) - 1, min(len(ties.seen1), MOST_BENT_TIES)).astype(int)
    count = len(some)
    base = replace(
        pair.observations,
        tie1=ties.seen1[some],
        tie2=ties.seen2[some],
        tie_used=np.zeros(count, dtype=bool),
        wall=np.zeros(count, dtype=bool),
        wall_rows=np.zeros((3, count)),
    )
    adjusted = evaluated(base, pair.adjusted)
    for _ in range(3):
        usual = adjusted.tie_misfit[base.tie_used] if base.tie_used.any() else adjusted.tie_misfit
        # Control leaves the rays uncertain by some pixels: the majority shows by how much.
        base = without_gross_ties(base, adjusted, sigma=robust_sigma(usual))
        if base.tie_used.sum() < FEWEST_TIES:
            return pair.told(remark("orientation.hardly_through_media"))
        adjusted = adjust(base, adjusted)
    height = np.abs(tie_positions(base, adjusted)[:, 2])
    on_wall = base.tie_used & (height < TUNING.bend_band * adjusted.cameras[0].centre[2])
    return replace(pair, observations=replace(base, wall=on_wall), adjusted=adjusted)
