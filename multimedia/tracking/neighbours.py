"""What the particles around a particle say of where it goes, and how surely."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.machine import cores

#: Links around a point that are asked, of its frame and so many beside it; how many of these may
#: be those that most agree with, and the share that is to agree. Tried on vortices, a turning tank,
#: own ways and streams, whole and with 25 % of the images missing and 50 % false.
_AROUND, _BESIDE, _MODELS, _AGREE = 20, 1, 8, 0.3
#: Rounds in which links that go elsewhere lose their weight; fewest residuals that tell anything.
_ROUNDS, _FEWEST = 2, 5
#: Multiple of a median distance that bounds it: 2.6 holds 999 of 1000 normal ones, and
#: accelerations are not the same everywhere in a flow.
BEYOND = 3.5
#: Share of `Guide.reach` beyond which a particle goes elsewhere than those around.
_APART = 0.8
#: By what a particle is predicted: its velocity, that and how the velocities around it change on
#: its way, or these alone.
OWN, TURNED, AROUND = 0, 1, 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guide:
    """Predictions for every point of a sequence, all frames one after the other.

    Attributes
    ----------
    way : ndarray, shape (n, 3)
        Displacement to the next frame of the particles around; NaN where none tell. [object unit]
    kind : ndarray of int, shape (n,)
        What predicts best around it.
    reach, change, alone : ndarray, shape (n,)
        How far a particle may be from ``way``, from what predicts best, and from where its own
        velocity leads. [object unit]
    """

    way: FloatArray
    kind: IntArray
    reach: FloatArray
    change: FloatArray
    alone: FloatArray

    def onwards(
        self, before: IntArray, after: IntArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the displacements that are expected after links, and how far from them to seek.

        Parameters
        ----------
        before, after : ndarray of int, shape (m,)
            Points that are linked.
        velocity : ndarray, shape (m, 3)
            Displacement per frame between them. [object unit]
        """
        apart = np.linalg.norm(velocity - self.way[before], axis=1) > _APART * self.reach[before]
        kind = np.where(apart, OWN, self.kind[after])[:, None]
        turned = velocity + np.nan_to_num(self.way[after] - self.way[before])
        expected = np.where(kind == TURNED, turned, velocity)
        return (
            np.where(kind == AROUND, self.way[after], expected),
            np.where(apart, self.alone[after], self.change[after]),
        )


def unguided(count: int, step: float, change: float) -> Guide:
    """Return what is known of points of which those around tell nothing."""
    changes = np.full(count, change)
    return Guide(
        way=np.full((count, 3), np.nan), kind=np.zeros(count, dtype=np.int64),
        reach=np.full(count, step), change=changes, alone=changes,
    )  # fmt: skip


def neighbours_guide(
    places: Sequence[FloatArray], previous: IntArray, track: IntArray, widest: float
) -> Guide | None:
    """Return what the links of a first linking say of every point; None where they are too few.

    Parameters
    ----------
    places : sequence of ndarray, shape (n_t, 3)
        Particles of each frame. [object unit]
    previous, track : ndarray of int, shape (n,)
        For each point the one it follows, and the number of its track; -1 for none.
    widest : float
        Bound of all reaches. [object unit]

    Notes
    -----
    The displacements around a point follow a linear function of place, fitted to the links of
    other tracks that most agree. How far links are from each of three predictions has a median
    around every point, too: the prediction of the least one counts there, within a multiple of it.
    """
    xyz, first = np.concatenate(list(places)), np.cumsum([0, *map(len, places)])
    frame = np.repeat(np.arange(len(places)), np.diff(first))
    ends = np.flatnonzero((track >= 0) & (previous >= 0))
    starts = previous[ends]
    ways = (xyz[ends] - xyz[starts]) / (frame[ends] - frame[starts])[:, None]
    around, way = np.zeros((len(xyz), _AROUND), dtype=np.int64), np.full(xyz.shape, np.nan)

    def fit(t: int) -> None:
        """Fill in what is around the points of a frame."""
        here = slice(first[t], first[t + 1])
        usable = np.flatnonzero(np.abs(frame[starts] - t) <= _BESIDE)
        if len(usable) < _AROUND or not len(places[t]):
            return
        near = usable[cKDTree(xyz[starts[usable]]).query(places[t], k=_AROUND)[1]]
        around[here] = near
        same = (track[starts[near]] == track[here][:, None]) & (track[here][:, None] >= 0)
        way[here] = _linear(xyz[starts[near]] - places[t][:, None], ways[near], ~same)

    with ThreadPoolExecutor(cores()) as pool:
        list(pool.map(fit, range(len(places))))
    if not np.isfinite(way).any():
        return None
    into, guess = np.full((2, *xyz.shape), np.nan)
    into[ends], guess[ends] = ways, way[starts]
    bend = ways - into[starts]
    residuals = (bend, bend - way[starts] + guess[starts], ways - way[starts])
    medians = np.stack([_medians(np.linalg.norm(each, axis=1), around) for each in residuals])
    medians[:, np.isnan(way[:, 0])] = np.inf
    # What is exact, too, is sought within something.
    reaches = np.clip(BEYOND * medians, 1e-6 * widest, widest)
    alone, _, reach = reaches
    change = reaches.min(axis=0)
    return Guide(way=way, kind=medians.argmin(axis=0), reach=reach, change=change,
                 alone=np.maximum(alone, change))  # fmt: skip


def _linear(away: FloatArray, ways: FloatArray, counts: BoolArray) -> FloatArray:
    """Return the values at no distance of linear functions of place through those that agree."""
    size = np.abs(away).max(axis=(1, 2), keepdims=True) + 1e-300
    design = np.concatenate([np.ones((*away.shape[:2], 1)), away / size], axis=2)
    far = ((away / size) ** 2).sum(axis=2)
    near = counts * (1.0 - 0.9 * far / np.maximum(far.max(axis=1, keepdims=True), 1e-300))
    # From that with which most agree: a median is nobody's where streams cross.
    between = distances(ways[:, :_MODELS], ways)
    rank = int(_AGREE * _AROUND)
    model = np.partition(between, rank, axis=2)[:, :, rank].argmin(axis=1)
    residual = between[np.arange(len(ways)), model]
    for _ in range(_ROUNDS):
        scale = np.median(residual, axis=1, keepdims=True) + 1e-300
        weight = near / (1.0 + (residual / scale) ** 2) ** 1.5
        across = np.swapaxes(design * weight[..., None], 1, 2)
        normal = across @ design
        normal[:, range(4), range(4)] += 1e-6 * weight.sum(axis=1)[:, None] + 1e-300
        fitted = np.linalg.solve(normal, across @ ways)
        residual = np.linalg.norm(ways - design @ fitted, axis=2)
    return fitted[:, 0]


def distances(some: FloatArray, others: FloatArray) -> FloatArray:
    """Return the distances of all of some (n, a, 3) from all of others (n, b, 3), shape (n, a, b).

    Axis by axis: without the differences in one array this takes a quarter of the time.
    """
    square = np.zeros((len(some), some.shape[1], others.shape[1]))
    for k in range(3):
        square += (some[:, :, None, k] - others[:, None, :, k]) ** 2
    return np.sqrt(square)


def _medians(residual: FloatArray, around: IntArray) -> FloatArray:
    """Return the median of the residuals of the links around each point, infinite for a few."""
    ordered = np.sort(residual[around], axis=1)  # NaN last
    count = np.isfinite(ordered).sum(axis=1)
    middle = ordered[np.arange(len(ordered)), np.maximum(count - 1, 0) // 2]
    return np.where(count >= _FEWEST, middle, np.inf)
