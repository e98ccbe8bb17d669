"""What a pair file says is wrong with its own pair: in words, and as a covariance."""

from __future__ import annotations

from typing import Any

import numpy as np

from bifocal.model.orientation_precision import NAMES
from photocore.arrays import FloatArray

#: A wall bent by certainly more than this, at 3000 px of width, is not that of an honest pair; by
#: how many standard deviations it is certain. [px]
MOST_BENT, CERTAIN = 0.2, 2.0
#: Root mean square bend over a photo of 3 to 2 by x (1 + k rho²), over k and half the diagonal, and
#: the mean of rho²: what scale takes up of it.
BEND_BY_K, MEAN_SQUARE = 0.114, 1 / 3


def bend_is_certain(px: float, sigma: float) -> bool:
    """Return whether a wall bent by so much between the photos says that the model does not fit."""
    return px - CERTAIN * sigma > MOST_BENT


def doubts_in_words(setup: Any) -> tuple[str, ...]:
    """Return what is known to be wrong with a pair, from the ``setup`` of its file."""
    told = setup.get("doubts") if isinstance(setup, dict) else ()
    if told is None and _bend(setup):
        told = [
            "THE MODEL DOES NOT FIT: when the pair was set up, the wall was bent between the "
            f"photos by {_bend(setup):.2f} px (an honest pair: at most {MOST_BENT:g}). Relief may "
            "be wrong by what sigma_r says and more. Set it up again (`bifocal align`)."
        ]
    return tuple(map(str, told)) if isinstance(told, list | tuple) else ()


def covariance_of_doubts(setup: Any) -> FloatArray | None:
    """Return what doubts add to the covariance of both cameras; None where there are none.

    Parameters
    ----------
    setup : object
        As the pair file states it.

    Returns
    -------
    ndarray, shape (24, 24), or None
        Of `NAMES`.

    Notes
    -----
    A bend counts as radial distortion k of one photo against the other, and as what a scale takes
    up of it; another face that may be the wall moves both cameras alike.
    """
    variance = np.zeros((len(NAMES), len(NAMES)))
    bend, offset = _bend(setup), _number(setup, "standard_deviations", "relief_offset")
    focal, column, row = (
        _number(setup, *place)
        for place in (("focal_px", 0), ("principal_point_px", 0, 0), ("principal_point_px", 0, 1))
    )
    half = float(np.hypot(column, row))
    if bend and half and focal:
        k = bend * 2 * max(column, row) / 3000.0 / (BEND_BY_K * half)
        for name, size in (("k1 1", k * (focal / half) ** 2), ("focal length 1", MEAN_SQUARE * k)):
            variance[NAMES.index(name), NAMES.index(name)] = size**2
    both = [NAMES.index("Z 1"), NAMES.index("Z 2")]
    variance[np.ix_(both, both)] += offset**2
    return variance if variance.any() else None


def _bend(setup: Any) -> float:
    """Return by how much the wall is certainly bent between the photos, else 0. [px]"""
    bend = _number(setup, "wall_bend_px")
    return bend if bend_is_certain(bend, _number(setup, "wall_bend_sigma_px")) else 0.0


def _number(data: Any, *place: str | int) -> float:
    """Return a number of free diagnostics, 0 where there is none."""
    for key in place:
        try:
            data = data[key]
        except (LookupError, TypeError):
            return 0.0
    usable = isinstance(data, int | float) and not isinstance(data, bool) and np.isfinite(data)
    return float(data) if usable else 0.0
