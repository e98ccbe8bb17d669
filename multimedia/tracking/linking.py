"""Which particles of consecutive frames are one: predictor and nearest neighbour in four frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from photocore.arrays import BoolArray, FloatArray, IntArray

#: Nearest neighbours of particles anywhere are 0.554 times the cube root of the volume of each
#: apart (Chandrasekhar 1943).
MEAN_OVER_NEAREST = 1.0 / 0.554
#: Points of a track from which on it is known well enough to bridge a gap.
_SURE = 3
#: Multiple of the median change of velocity that bounds it: 2.6 holds 999 of 1000 normal ones, and
#: accelerations are not the same everywhere in a flow. Rounds in which it is found.
_BEYOND, _ROUNDS = 3.5, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkRules:
    """How far particles go between frames.

    Attributes
    ----------
    step : float
        Largest displacement where nothing is known of a particle's velocity. [object unit]
    change : float
        Largest distance from where its velocity predicts a particle. [object unit]
    gap : int
        Frames for which a particle may be missing.
    drift : tuple of float
        Displacement about which ``step`` counts: that of all on the whole. [object unit]
    """

    step: float
    change: float
    gap: int
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(slots=True, eq=False)
class _Heads:
    """Ends of tracks that the next frame may carry on."""

    point: IntArray  # number of the last point, counted through all frames
    place: FloatArray
    velocity: FloatArray  # per frame; NaN where nothing is known
    age: IntArray  # frames since it was seen
    length: IntArray

    def some(self, which: BoolArray) -> _Heads:
        """Return those heads."""
        return _Heads(*(getattr(self, name)[which] for name in self.__slots__))

    def and_(self, more: _Heads) -> _Heads:
        """Return both."""
        parts = ((getattr(self, name), getattr(more, name)) for name in self.__slots__)
        return _Heads(*(np.concatenate(part) for part in parts))


def usual_step(places: Sequence[FloatArray]) -> float:
    """Return half the mean distance of particles, from their nearest neighbours. [object unit]"""
    near = [cKDTree(xyz).query(xyz, k=2)[0][:, 1] for xyz in places if len(xyz) > 1]
    return 0.5 * MEAN_OVER_NEAREST * float(np.median(np.concatenate(near))) if near else 0.0


def linked(places: Sequence[FloatArray], rules: LinkRules) -> IntArray:
    """Return for each point of all frames, one after the other, the point it follows; -1 for none.

    Parameters
    ----------
    places : sequence of ndarray, shape (n_t, 3)
        Particles of each frame. [object unit]
    rules : LinkRules

    Notes
    -----
    A particle whose velocity is known is expected where that leads; one whose velocity is not,
    within ``step`` of where the drift leads. Each pair of such an end and a particle there predicts
    a place two frames on; how far the next particle is from that counts as much as how far it was
    from its own place (Malik et al. 1993; Ouellette et al. 2006: the best estimate in four frames).
    The pairs of the least sum of squares are taken first, each particle once.
    """
    firsts = np.cumsum([0, *map(len, places)])
    trees = [cKDTree(xyz) if len(xyz) else None for xyz in places]
    previous = np.full(firsts[-1], -1, dtype=np.int64)
    heads = _fresh(places[0], 0) if places else None
    for t in range(len(places) - 1):
        assert heads is not None
        ends, starts = _pairs_taken(heads, trees[t + 1 : t + 4], rules)
        new = _fresh(places[t + 1], int(firsts[t + 1]))
        previous[new.point[starts]] = heads.point[ends]
        way = new.place[starts] - heads.place[ends]
        new.velocity[starts] = way / (heads.age[ends] + 1)[:, None]
        new.length[starts] = heads.length[ends] + 1
        lost: BoolArray = np.ones(len(heads.point), dtype=bool)
        lost[ends] = False
        waiting = heads.some(lost & (heads.length >= _SURE) & (heads.age < rules.gap))
        waiting.age = waiting.age + 1
        heads = new.and_(waiting)
    return previous


def adapted(places: Sequence[FloatArray], rules: LinkRules) -> LinkRules:
    """Return rules whose largest change of velocity is what the particles of a sequence show.

    Those of a first linking by the rules as they are; their largest change bounds it.
    """
    xyz, widest = np.concatenate(list(places)), rules.change
    for _ in range(_ROUNDS):
        previous = linked(places, rules)
        own = np.flatnonzero(previous >= 0)
        own = own[previous[previous[own]] >= 0]
        if not len(own):
            break
        bend = xyz[own] - 2.0 * xyz[previous[own]] + xyz[previous[previous[own]]]
        typical = float(np.median(np.linalg.norm(bend, axis=1)))
        # Exact ones, too, are sought within something.
        rules = replace(rules, change=min(widest, max(_BEYOND * typical, 1e-6 * widest)))
    return rules


def in_tracks(previous: IntArray, shortest: int) -> tuple[IntArray, IntArray]:
    """Return the points that are in tracks, track by track in time, and the number of the track."""
    track = np.full(len(previous), -1, dtype=np.int64)
    starts = np.flatnonzero(previous < 0)
    track[starts] = np.arange(len(starts))
    for point in np.flatnonzero(previous >= 0).tolist():  # points follow earlier ones
        track[point] = track[previous[point]]
    order = np.argsort(track, kind="stable")
    long = np.bincount(track, minlength=1)[track[order]] >= shortest
    order = order[long]
    return order, np.unique(track[order], return_inverse=True)[1].astype(np.int64)


def _fresh(xyz: FloatArray, first: int) -> _Heads:
    """Return the particles of a frame as ends of which nothing is known."""
    count = len(xyz)
    return _Heads(
        first + np.arange(count), xyz, np.full((count, 3), np.nan),
        np.zeros(count, dtype=np.int64), np.ones(count, dtype=np.int64),
    )  # fmt: skip


def _pairs_taken(
    heads: _Heads, trees: Sequence[cKDTree | None], rules: LinkRules
) -> tuple[IntArray, IntArray]:
    """Return which ends go on in which particles of the next frame."""
    none = np.empty(0, dtype=np.int64)
    if trees[0] is None or not len(heads.point):
        return none, none
    known = np.isfinite(heads.velocity[:, 0])
    steps = heads.age + 1
    expected = heads.place + np.where(known[:, None], heads.velocity, rules.drift) * steps[:, None]
    reach = np.where(known, rules.change, rules.step) * steps
    near = trees[0].query_ball_point(expected, reach)
    end = np.repeat(np.arange(len(near)), list(map(len, near)))
    start = np.array([k for some in near for k in some], dtype=np.int64)
    if not len(end):
        return none, none
    place = np.asarray(trees[0].data)[start]
    velocity = (place - heads.place[end]) / steps[end, None]
    cost = np.where(known[end], ((place - expected[end]) ** 2).sum(axis=1), 0.0)
    away, then = _nearest(trees, 1, place + velocity, rules.change)
    cost += away**2
    # Without a velocity of its own the end needs two more frames to be told from chance.
    fresh = np.flatnonzero(~known[end])
    if len(trees) > 2:
        onwards = 2.0 * then[fresh] - place[fresh]
        cost[fresh] += _nearest(trees, 2, onwards, rules.change)[0] ** 2
    cost[fresh[~np.isfinite(then[fresh, 0])]] = np.inf
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    return _each_once(end[order], start[order])


def _nearest(
    trees: Sequence[cKDTree | None], ahead: int, expected: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Return how far the nearest particle of a later frame is, ``reach`` at most, and where."""
    away, place = np.full(len(expected), reach), np.full(expected.shape, np.nan)
    tree = trees[ahead] if ahead < len(trees) else None
    good = np.flatnonzero(np.isfinite(expected[:, 0]))
    if tree is not None and len(good):
        distance, number = tree.query(expected[good], distance_upper_bound=reach)
        found = np.isfinite(distance)
        away[good[found]] = distance[found]
        place[good[found]] = np.asarray(tree.data)[number[found]]
    return away, place


def _each_once(ends: IntArray, starts: IntArray) -> tuple[IntArray, IntArray]:
    """Return the pairs, in this order, of which neither was in a pair before."""
    used_ends, used_starts, kept = set[int](), set[int](), []
    for k, (end, start) in enumerate(zip(ends.tolist(), starts.tolist(), strict=True)):
        if end not in used_ends and start not in used_starts:
            used_ends.add(end)
            used_starts.add(start)
            kept.append(k)
    return ends[kept], starts[kept]
