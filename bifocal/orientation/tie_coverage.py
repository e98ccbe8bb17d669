"""Where the ties of a pair lie in its photos, and by how much their rays miss each other."""

from __future__ import annotations

import numpy as np

from bifocal.model import CommonPoints, Interior, TieCells
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import PairObservations
from photocore.arrays import FloatArray

#: Cells along the longer side of a photo.
CELLS = 16


def tie_statistics(observations: PairObservations, adjusted: AdjustedPair) -> CommonPoints:
    """Return the misfits of the ties used, over all and by cells of either photo.

    Returns
    -------
    dict
        ``rms_px``, ``largest_px``: of the distances from the epipolar lines. [px]
        ``cells``: for either photo ``side``, of a square cell [px], and ``rows`` of column and row
        of the cell, number of ties, mean and RMS of their misfits [px]; cells without ties are
        left out. Empty where no tie is used.
    """
    used = observations.tie_used
    if not used.any():
        return {}
    misfit = adjusted.tie_misfit[used]
    ties = observations.tie1[used], observations.tie2[used]
    return {
        "rms_px": float(np.sqrt(np.mean(misfit**2))),
        "largest_px": float(np.abs(misfit).max()),
        "cells": [
            _cells(interior.raw(places), misfit, interior)
            for interior, places in zip(observations.interiors, ties, strict=True)
        ],
    }


def _cells(pixels: FloatArray, misfit: FloatArray, interior: Interior) -> TieCells:
    side = max(interior.image_size) / CELLS
    cells, place = np.unique(np.floor(pixels / side).astype(int), axis=0, return_inverse=True)
    place = place.ravel()
    count = np.bincount(place)
    mean = np.bincount(place, misfit) / count
    rms = np.sqrt(np.bincount(place, misfit**2) / count)
    rows = [
        [*cell, number, round(float(m), 4), round(float(r), 4)]
        for cell, number, m, r in zip(cells.tolist(), count.tolist(), mean, rms, strict=True)
    ]
    return {"side": side, "rows": rows}
