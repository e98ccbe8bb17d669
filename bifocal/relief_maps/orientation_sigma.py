"""What the orientation's own uncertainty does to relief, where the pair file states it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bifocal.model.pair import Pair
from bifocal.precision import false_relief_of_scale
from photocore.arrays import Float32Array


def orientation_sigma(pair: Pair, relief: Float32Array) -> Float32Array:
    """Return the standard deviation of relief that comes from scale and distances. [m]

    Notes
    -----
    To first order a relative scale error eps shifts r by B eps, an error of d1 by
    ``-r d2 / (d1 (d1 - d2))`` per metre and one of d2 by ``r d1 / (d2 (d1 - d2))``. The standard
    deviations are those `bifocal align` writes in the pair file (``setup``); zero without them.
    These errors are common to the whole map.
    """
    scale, sigma1, sigma2 = (_stated(pair, name) for name in ("scale", "distance1", "distance2"))
    d1, d2 = pair.image1.distance, pair.image2.distance
    rate1, rate2 = d2 / (d1 * (d1 - d2)), d1 / (d2 * (d1 - d2))
    per_metre = np.hypot(rate1 * sigma1, rate2 * sigma2)
    by_scale = false_relief_of_scale(scale, d1=d1, d2=d2)
    return np.hypot(np.float32(by_scale), relief * np.float32(per_metre))


def _stated(pair: Pair, name: str) -> float:
    """Return a standard deviation of the pair file, 0 where there is none."""
    orientation = pair.extra.get("setup")
    stated = orientation.get("standard_deviations") if isinstance(orientation, Mapping) else None
    value = stated.get(name) if isinstance(stated, Mapping) else None
    usable = isinstance(value, int | float) and np.isfinite(value) and value > 0
    return float(value) if usable and value is not None else 0.0
