"""Links of chance, counted on frames displaced against each other; step and drift beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter

from multimedia.tracking.linking import LinkRules, adapted, guided, in_tracks, linked
from photocore.arrays import FloatArray, IntArray

#: Share of the step below which the largest change of velocity is the particles' own: in runs of
#: chance it is 1, in true ones .02 to .45 (uniform flows and vortices of .3 to 1 mean distances).
_AT_CEILING, _OFF_CEILING = 0.9, 0.5
#: Steps tried, each so many times the one before; frames they are tried on; share of all points
#: by which a wider one must gain. Tried on the same flows.
_WIDENINGS, _WIDER, _TRIED, _GAIN = 5, 2.0**0.5, 12, 0.02
#: Steps by which frames are displaced, at most, and the shares of three axes (powers of the plastic
#: number's kin) whose multiples by squares come back in no three frames.
_FAR, _SHARES = 4.0, np.array([0.8191725134, 0.6710436067, 0.5497004779])

#: Standard deviations by which a common displacement exceeds its opposite; cells of the histogram
#: at most. Of 100 to 3000 particles in 4 to 12 frames the largest by chance had 4.2 to 6.2, drifts
#: of 1 to 2.5 mean distances, vortices beside them, 9 to 56 (216 to 3000 particles).
_CLEAR, _CELLS = 7.0, 2**22


def points_by_chance(places: Sequence[FloatArray], rules: LinkRules, shortest: int) -> int:
    """Return how many points are in tracks where frames are displaced against each other.

    Parameters
    ----------
    places : sequence of ndarray, shape (n_t, 3)
        Particles of each frame. [object unit]
    rules : LinkRules
    shortest : int
        Points that a track must have.

    Notes
    -----
    Counted, not computed: each frame is displaced by steps of its own, what leaves the volume
    comes in on its other side, so that there are as many particles as close together, and none
    goes anywhere.
    """
    xyz = np.concatenate(list(places))
    if not len(xyz):
        return 0
    low, size = xyz.min(axis=0), np.ptp(xyz, axis=0)
    moved = []
    for t, frame in enumerate(places):
        shift = _FAR * rules.step * (2.0 * np.mod(t * t * _SHARES, 1.0) - 1.0)
        moved.append(low + np.mod(frame - low + shift, np.where(size > 0, size, 1.0)))
    return len(in_tracks(linked(moved, rules), shortest)[0])


def widened(places: Sequence[FloatArray], rules: LinkRules, shortest: int) -> LinkRules:
    """Return the rules adapted to the particles, with a wider step where theirs shows chance only.

    Parameters
    ----------
    places, rules, shortest
        As for `points_by_chance`; the step as it is usual.

    Notes
    -----
    Where particles go farther than the step, their nearest neighbours are taken for them, and
    the change of velocity stays at its ceiling, the step. It falls off it where the step holds
    their way, or counts from where the drift of all leads. Of these, what has the most points in
    tracks beyond chance counts.
    """
    alone = adapted(places, rules)
    best = guided(places, alone, rules.change)
    if alone.change < _OFF_CEILING * alone.step or not rules.step > 0:
        return best
    middle = max(0, (len(places) - _TRIED) // 2)
    some = places[middle : middle + _TRIED]
    most, start = _beyond_chance(some, fitted(some, rules), shortest), rules
    drift = common_drift(some, rules.step)
    if drift is not None:
        drifting = replace(rules, drift=drift)
        fit = fitted(some, drifting)
        share = _beyond_chance(some, fit, shortest)
        if share > most + _GAIN:
            most, start = share, drifting
            if fit.change < _OFF_CEILING * fit.step:
                return fitted(places, start)
    narrow = start
    for k in range(1, _WIDENINGS + 1):
        # The change of a long step is a short one most often; else it is sought as far, too.
        for wide in (replace(narrow, step=rules.step * _WIDER**k), _as_far(narrow, _WIDER**k)):
            fit = fitted(some, wide)
            if fit.change < _AT_CEILING * wide.change:
                break
        gain = _beyond_chance(some, fit, shortest) - most
        if gain > _GAIN and fit.change < _AT_CEILING * wide.change:
            most, start = most + gain, wide
        elif fit.change < _OFF_CEILING * wide.change:
            break
    return best if start is rules else fitted(places, start)


def fitted(places: Sequence[FloatArray], rules: LinkRules) -> LinkRules:
    """Return the rules adapted to the particles and guided by those around; no step is widened."""
    return guided(places, adapted(places, rules), rules.change)


def common_drift(places: Sequence[FloatArray], cell: float) -> tuple[float, float, float] | None:
    """Return the displacement from frame to frame that most particles share, if one stands out.

    Parameters
    ----------
    places : sequence of ndarray, shape (n_t, 3)
        Particles of each frame. [object unit]
    cell : float
        How near to each other displacements count as one. [object unit]

    Notes
    -----
    The peak of the histogram of displacements between all particles of consecutive frames, however
    long, from the correlation of their counts in cells. What its opposite has, too, is due to how
    the particles lie: only the rest counts.
    """
    xyz = np.concatenate(list(places))
    if not len(xyz):
        return None
    low, size = xyz.min(axis=0), np.ptp(xyz, axis=0)
    cell = max(cell, float(np.cbrt(8.0 * np.prod(size + cell) / _CELLS)))
    shape = np.floor(size / cell).astype(int) + 1
    double = tuple(
        (2 * shape + 2).tolist()
    )  # so that what is around an edge is not beyond the other
    spectra = []
    for frame in places:
        counts = np.zeros(double)
        np.add.at(counts, tuple(np.floor((frame - low) / cell).astype(int).T), 1.0)
        spectra.append(np.fft.rfftn(counts))
    product = sum(np.conj(one) * two for one, two in pairwise(spectra))
    pairs = np.fft.irfftn(product, s=double, axes=(0, 1, 2))
    around = uniform_filter(pairs, 3, mode="wrap") * 27.0
    excess = around - _opposite(around)
    peak = np.unravel_index(int(excess.argmax()), double)
    deviation = np.sqrt(max(1.0, 2.0 * float(around[peak] - 0.5 * excess[peak])))
    if excess[peak] < _CLEAR * deviation:
        return None
    near = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    single, middle = pairs - _opposite(pairs), np.array(peak)
    middle = middle + near[int(single[_cells(middle + near, double)].argmax())]
    weight = np.maximum(single[_cells(middle + near, double)], 0.0) ** 2
    offset = weight @ near / weight.sum()
    whole = middle - np.where(middle > shape, double, 0)
    x, y, z = ((whole + offset) * cell).tolist()
    return x, y, z


def _cells(numbers: IntArray, shape: tuple[int, ...]) -> tuple[IntArray, ...]:
    """Return the index of cells that may be counted from either end."""
    return tuple(np.mod(numbers, shape).T)


def _opposite(pairs: FloatArray) -> FloatArray:
    """Return how many pairs the opposite of each displacement has."""
    return np.roll(np.flip(pairs), 1, axis=(0, 1, 2))


def _as_far(rules: LinkRules, times: float) -> LinkRules:
    """Return rules with step and change so many times as large."""
    return replace(rules, step=rules.step * times, change=rules.change * times)


def _beyond_chance(places: Sequence[FloatArray], rules: LinkRules, shortest: int) -> float:
    """Return the share of all points that is in tracks, without as many as come by chance."""
    count = len(in_tracks(linked(places, rules), shortest)[0])
    return (count - points_by_chance(places, rules, shortest)) / max(1, sum(map(len, places)))
