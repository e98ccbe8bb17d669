"""The relief maps of several pairs of a set made one: by covariance where they agree.

Where they do not, the photos decide: the relief at which all that see the place show the same. If
they cannot, the place is unknown. What no pair measured comes from the pair whose photos see it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.photo_evidence import Witness, exposed_alike, misfit, shown_by
from bifocal.relief_maps.tuning import FUSION
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class PairRelief:
    """What one pair of a set measured, on the grid of the set's map.

    Attributes
    ----------
    bands : MapBands
    weight : ndarray of float32
        What its relief counts where others measured, too, by geometry. [1/m²]
    """

    bands: MapBands
    weight: Float32Array

    @property
    def measured(self) -> BoolArray:
        """Pixels that it measured."""
        return np.asarray((self.bands.quality == Quality.MEASURED) & np.isfinite(self.bands.r))


def fused(found: Sequence[PairRelief], witnesses: Sequence[Witness], grid: Grid) -> MapBands:
    """Return the one map of several pairs.

    Parameters
    ----------
    found : sequence of PairRelief
    witnesses : sequence of Witness
        The photos.
    grid : Grid

    Notes
    -----
    Weights are those of the geometry: what a pixel of parallax is worth in relief at the place.
    Pairs that share a photo share its errors, and what makes one err at an edge makes the next err
    there: sigma is as if their errors were one, so more pairs make relief better than it says.
    """
    measured = np.stack([one.measured for one in found])
    apart = _apart(found)
    open_ = apart | ~measured.any(axis=0)
    result = _averaged(found, measured & ~apart)
    photos = exposed_alike(witnesses, result.r, grid)
    misfits = np.stack([misfit(photos, one.bands.r, grid, open_) for one in found])
    _decide(result, found, measured, misfits, apart)
    _fill(result, found, misfits, open_ & ~apart)
    rest = np.isfinite(result.r) & (result.quality != Quality.MEASURED)
    seen = np.isfinite(shown_by(photos, result.r, grid, rest)).sum(axis=0)
    result.quality[rest] = np.where(seen < 2, Quality.HIDDEN, Quality.INTERPOLATED)
    return result


def _apart(found: Sequence[PairRelief]) -> BoolArray:
    """Return where two pairs measured what differs beyond their sigmas, or visibly."""
    apart = np.zeros(found[0].bands.r.shape, bool)
    for one, other in combinations(found, 2):
        variance = sum(of.bands.sigma**2 for of in (one, other))
        with np.errstate(invalid="ignore"):
            limit = np.minimum(FUSION.beyond * np.sqrt(variance), FUSION.visible)
            far = np.abs(one.bands.r - other.bands.r) > limit
        apart |= far & one.measured & other.measured
    return apart


def _averaged(found: Sequence[PairRelief], use: BoolArray) -> MapBands:
    """Return the weighted mean of what was measured, with the sigma of errors that are one."""
    total, relief, square, variance = np.zeros((4, *use.shape[1:]), np.float32)
    for one, mine in zip(found, use, strict=True):
        weight = np.where(mine, one.weight, np.float32(0))
        value = np.where(mine, one.bands.r, np.float32(0))
        total += weight
        relief += weight * value
        square += weight * value * value
        variance += weight * np.where(mine, one.bands.sigma, np.float32(0)) ** 2
    some = total > 0
    share = 1 / np.where(some, total, np.float32(np.nan))
    mean = relief * share
    spread = np.maximum(square * share - mean * mean, 0)
    sigma = np.sqrt(variance * share + spread)
    return MapBands(mean, sigma, np.where(some, Quality.MEASURED, 0).astype(np.uint8))


def _decide(
    result: MapBands, found: Sequence[PairRelief], measured: BoolArray, misfits: Float32Array,
    apart: BoolArray,
) -> None:  # fmt: skip
    """Where pairs differ take the one that the photos fit best, if clearly so (in place)."""
    row, column = np.nonzero(apart)
    at = (slice(None), row, column)
    relief, sigma = (
        np.stack([getattr(one.bands, name)[row, column] for one in found])
        for name in ("r", "sigma")
    )
    cost = np.where(measured[at], misfits[at], np.float32(np.inf))
    best = cost.argmin(axis=0)[None]
    value, own, least = (np.take_along_axis(a, best, 0)[0] for a in (relief, sigma, cost))
    off = np.where(measured[at], np.abs(relief - value), np.float32(0))
    rival = np.where(off > FUSION.beyond * own, cost, np.float32(np.inf)).min(axis=0)
    clear = rival - least > FUSION.margin
    spread = off.max(axis=0)
    limit = FUSION.beyond * np.sqrt(np.where(measured[at], sigma**2, 0).sum(axis=0))
    # What differs by less than anyone sees at 1:50 is told by its sigma, not taken out.
    good = clear | (spread < np.maximum(limit, np.float32(FUSION.visible)))
    result.r[row, column] = np.where(good, value, np.float32(np.nan))
    doubt = np.where(clear, np.float32(0), spread)
    result.sigma[row, column] = np.where(good, np.hypot(own, doubt), np.float32(np.nan))
    result.quality[row, column] = np.where(good, Quality.MEASURED, Quality.UNKNOWN)


def _fill(
    result: MapBands, found: Sequence[PairRelief], misfits: Float32Array, where: BoolArray
) -> None:
    """Take what no pair measured from the pair whose photos fit best there (in place)."""
    row, column = np.nonzero(where)
    cost = misfits[:, row, column]
    known = np.stack([np.isfinite(one.bands.r[row, column]) for one in found])
    behind = np.stack([one.bands.quality[row, column] == Quality.HIDDEN for one in found])
    cost = np.where(known, cost + FUSION.behind * behind, np.float32(np.inf))
    best = cost.argmin(axis=0)
    for number, one in enumerate(found):
        mine = (best == number) & known[number]
        result.put((row[mine], column[mine]), one.bands.at((row[mine], column[mine])))
