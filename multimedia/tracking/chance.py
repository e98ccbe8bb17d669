"""Links of chance: counted on frames that have nothing to do with each other; steps beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multimedia.tracking.linking import LinkRules, adapted, in_tracks, linked
from photocore.arrays import FloatArray

#: Share of the step below which the largest change of velocity is the particles' own: in runs of
#: chance it is 1, in true ones .02 to .45 (uniform flows and vortices of .3 to 1 mean distances).
_AT_CEILING, _OFF_CEILING = 0.9, 0.5
#: Steps tried, each so many times the one before; frames they are tried on; share of all points
#: by which a wider one must gain. Tried on the same flows.
_WIDENINGS, _WIDER, _TRIED, _GAIN = 5, 2.0**0.5, 12, 0.02
#: Steps by which frames are displaced, at most, and the shares of three axes (powers of the plastic
#: number's kin) whose multiples by squares come back in no three frames.
_FAR, _SHARES = 4.0, np.array([0.8191725134, 0.6710436067, 0.5497004779])


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
    their way. Of the steps, the one counts with the most points in tracks beyond chance.
    """
    best = adapted(places, rules)
    if best.change < _OFF_CEILING * best.step or not rules.step > 0:
        return best
    middle = max(0, (len(places) - _TRIED) // 2)
    some = places[middle : middle + _TRIED]
    most, start = _beyond_chance(some, adapted(some, rules), shortest), rules
    for k in range(1, _WIDENINGS + 1):
        # The change of a long step is a short one most often; else it is sought as far, too.
        for wide in (replace(rules, step=rules.step * _WIDER**k), _as_far(rules, _WIDER**k)):
            fit = adapted(some, wide)
            if fit.change < _AT_CEILING * wide.change:
                break
        gain = _beyond_chance(some, fit, shortest) - most
        if gain > _GAIN and fit.change < _AT_CEILING * wide.change:
            most, start = most + gain, wide
        elif fit.change < _OFF_CEILING * wide.change:
            break
    return best if start is rules else adapted(places, start)


def _as_far(rules: LinkRules, times: float) -> LinkRules:
    """Return rules with step and change so many times as large."""
    return replace(rules, step=rules.step * times, change=rules.change * times)


def _beyond_chance(places: Sequence[FloatArray], rules: LinkRules, shortest: int) -> float:
    """Return the share of all points that is in tracks, without as many as come by chance."""
    count = len(in_tracks(linked(places, rules), shortest)[0])
    return (count - points_by_chance(places, rules, shortest)) / max(1, sum(map(len, places)))
