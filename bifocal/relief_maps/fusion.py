"""The relief maps of several pairs of a set made one: by covariance where they agree.

Where they do not, the photos decide: the relief at which those that see the place show the same,
whether or not a pair measured it. If they cannot, the place is unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.photo_evidence import Witness, exposed_alike, misfit, shown_by
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionTuning:
    """Reliefs of pairs made one."""

    #: Two pairs differ from here on. [sigma]
    #: Evidence: chosen: 0.7 % of what two pairs of façade 41 measured differ by more.
    beyond: float = 3.0
    #: Measured is what the photos fit better than any other relief by so many times the usual.
    #: Evidence: façade 311, quarter frame, measured and of it beyond 3 cm [%]: 0.1 96.1 and 0.82,
    #: 0.2 95.9 and 0.75, 0.4 95.5 and 0.67.
    margin: float = 0.2
    #: A difference below this that the photos cannot decide counts to sigma; above, as unknown. [m]
    #: Evidence: chosen: what a drawing at 1:50 shows.
    visible: float = 0.03
    #: What a pair filled from behind must fit better by so many times the usual.
    #: Evidence: balcony 1203, quarter frame, beyond 3 cm [%]: 0 7.86, 0.2 7.90, 0.5 8.11, 1 8.34.
    behind: float = 0.2
    #: What no pair measured must fit better by so many times the usual than what one did.
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 0 7.87 and 1.55, 0.2
    #: 7.80 and 1.53, 0.5 8.08 and 1.52 before relief in front was preferred.
    unmeasured: float = 0.2
    #: Of two measured reliefs with less between their misfits neither is known.
    undecided: float = 0.01
    #: What stands in front may fit worse by so many times the usual.
    #: Evidence: balcony 1203, quarter frame, rail within 5 cm and all beyond 3 cm [%]: 0 57.6 and
    #: 7.90, 0.3 64.5 and 7.78, 0.4 66.2 and 7.80, 0.6 67.9 and 8.00.
    front: float = 0.4
    #: It stands in front if by more than this share of the nearest camera's distance.
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 0.01 7.86 and 1.64,
    #: 0.02 7.80 and 1.53, 0.04 7.71 and 1.51.
    in_front: float = 0.04


FUSION = FusionTuning()
#: Misfit of what no pair proposes.
NEVER = np.float32(1e6)


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


def fused(maps: Sequence[PairRelief], witnesses: Sequence[Witness], grid: Grid) -> MapBands:
    """Return the one map of several pairs.

    Parameters
    ----------
    maps : sequence of PairRelief
    witnesses : sequence of Witness
        The photos.
    grid : Grid

    Notes
    -----
    Weights are those of the geometry: what a pixel of parallax is worth in relief at the place.
    Pairs that share a photo share its errors, and what makes one err at an edge makes the next err
    there: sigma is as if their errors were one, so more pairs make relief better than it says.
    """
    measured = np.stack([one.measured for one in maps])
    open_ = _apart(maps) | ~measured.any(axis=0)
    result = _averaged(maps, measured & ~open_)
    photos, usual = exposed_alike(witnesses, result.r, grid)
    misfits = np.stack([misfit(photos, one.bands.r, grid, open_, usual) for one in maps])
    near = min(witness.photo.distance for witness in witnesses)
    _decide(result, maps, misfits, open_, FUSION.in_front * near)
    rest = np.isfinite(result.r) & (result.quality != Quality.MEASURED)
    count = np.isfinite(shown_by(photos, result.r, grid, rest)).sum(axis=0)
    result.quality[rest] = np.where(count < 2, Quality.HIDDEN, Quality.INTERPOLATED)
    return result


def _apart(maps: Sequence[PairRelief]) -> BoolArray:
    """Return where two pairs differ visibly, or measured what differs beyond their sigmas."""
    apart = np.zeros(maps[0].bands.r.shape, bool)
    for one, second in combinations(maps, 2):
        variance = sum(of.bands.sigma**2 for of in (one, second))
        with np.errstate(invalid="ignore"):
            limit = np.minimum(FUSION.beyond * np.sqrt(variance), FUSION.visible)
            off = np.abs(one.bands.r - second.bands.r)
            apart |= (off > limit) & one.measured & second.measured
        apart |= off > FUSION.visible
    return apart


def _averaged(maps: Sequence[PairRelief], use: BoolArray) -> MapBands:
    """Return the weighted mean of what was measured, with the sigma of errors that are one."""
    total, relief, square, variance = np.zeros((4, *use.shape[1:]), np.float32)
    for one, mine in zip(maps, use, strict=True):
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
    result: MapBands, maps: Sequence[PairRelief], misfits: Float32Array, where: BoolArray,
    in_front: float,
) -> None:  # fmt: skip
    """Take the relief that the photos fit best, whether or not a pair measured it (in place).

    Of a railing and the wall behind it both may fit, and both are there: what stands in front by
    more than ``in_front`` [m] and fits nearly as well is what the map shows. Pairs that measured
    the same give the mean. What fits hardly better than another relief is not measured; what two
    pairs measured and the photos cannot tell apart is unknown.
    """
    at = np.nonzero(where)
    row, column = at

    def all_of(band: Callable[[PairRelief], Any]) -> Any:
        return np.stack([band(one)[at] for one in maps])

    relief, sigma = all_of(lambda one: one.bands.r), all_of(lambda one: one.bands.sigma)
    measured, finite = all_of(lambda one: one.measured), np.isfinite(relief)
    behind = all_of(lambda one: one.bands.quality == Quality.HIDDEN)
    doubt = FUSION.unmeasured * ~measured + FUSION.behind * behind
    cost = np.where(finite, misfits[:, row, column] + doubt, NEVER)
    best = cost.argmin(axis=0)[None]
    with np.errstate(invalid="ignore"):
        front = relief > np.take_along_axis(relief, best, 0) + np.float32(in_front)
    front &= cost < np.take_along_axis(cost, best, 0) + np.float32(FUSION.front)
    first = np.where(front, relief, -NEVER).argmax(axis=0)[None]
    best = np.where(front.any(axis=0), first, best)
    value, sigma_best, least = (np.take_along_axis(a, best, 0) for a in (relief, sigma, cost))
    off = np.nan_to_num(np.abs(relief - value))
    limit = np.minimum(FUSION.beyond * np.hypot(sigma, sigma_best), np.float32(FUSION.visible))
    same = measured & (off <= limit)
    share = np.where(same, all_of(lambda one: one.weight), np.float32(0))
    some = same.any(axis=0)
    share /= np.where(some, share.sum(axis=0), np.float32(1))
    mean, variance = ((share * np.nan_to_num(a)).sum(axis=0) for a in (relief, sigma**2))
    rival = np.where(finite & (off > limit), cost, NEVER) - least
    clear = rival.min(axis=0) > FUSION.margin
    # What differs by less than anyone sees at 1:50 is told by its sigma, not taken out.
    spread = np.where(measured, off, np.float32(0)).max(axis=0)
    small = spread < FUSION.visible
    even = (measured & (np.abs(rival) < FUSION.undecided)).any(axis=0)
    good = np.isfinite(value[0]) & (small | ~(even & some))
    between = np.where(small & ~clear, spread, np.float32(0))
    precise = np.hypot(np.where(some, np.sqrt(variance), sigma_best[0]), between)
    result.r[at] = np.where(good, np.where(some, mean, value[0]), np.float32(np.nan))
    result.sigma[at] = np.where(good, precise, np.float32(np.nan))
    quality = np.where(some & (clear | small), Quality.MEASURED, Quality.INTERPOLATED)
    result.quality[at] = np.where(good, quality, Quality.UNKNOWN)
