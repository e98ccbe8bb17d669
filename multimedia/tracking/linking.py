"""Which particles of consecutive frames are one: predictor and nearest neighbour in four frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from multimedia.tracking.neighbours import BEYOND, Guide, neighbours_guide, unguided
from photocore.arrays import BoolArray, FloatArray, IntArray, each_once

#: Nearest neighbours of particles anywhere are 0.554 times the cube root of the volume of each
#: apart (Chandrasekhar 1943).
MEAN_OVER_NEAREST = 1.0 / 0.554
#: Points of a track from which on it is known well enough to bridge a gap.
_SURE = 3
#: Rounds in which the change of velocity is found, and in which neighbours predict, at most; share
#: of it below which the gain of one more is none.
_ROUNDS, _GUIDED, _GAIN = 2, 5, 0.03
#: Particles in no track to be expected in a sphere that is sought through even where all around
#: predict better: in a flow that is steady but here and there, these are the right ones.
_STRAYS = 1e-4
#: Share of the step within which neighbours have to predict to count where no velocity is known.
_SURELY = 0.6
#: Particles within reach that are looked for at once; where there are as many, all are.
_NEAR = 6


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
    guide : Guide, optional
        What particles around say; then ``change`` is the median of its own.
    least : float
        Distance from any prediction that is sought through. [object unit]
    """

    step: float
    change: float
    gap: int
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    guide: Guide | None = field(default=None, compare=False)
    least: float = 0.0


@dataclass(slots=True, eq=False)
class _Heads:
    """Ends of tracks that the next frame may carry on."""

    point: IntArray  # number of the last point, counted through all frames
    place: FloatArray
    velocity: FloatArray  # expected per frame; NaN where nothing is known
    change: FloatArray
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
    A particle whose velocity is known is expected where that and those around lead; one whose
    velocity is not, where those around go, or within ``step`` of where the drift leads. Each pair
    of such an end and a particle there predicts a place two frames on; how far the next particle is
    from that counts as much as how far it was from its own place (Malik et al. 1993; Ouellette et
    al. 2006: the best estimate in four frames), all in shares of how far they may be. The pairs of
    the least sum of squares are taken first, each particle once.
    """
    firsts = np.cumsum([0, *map(len, places)])
    trees = [cKDTree(xyz) if len(xyz) else None for xyz in places]
    previous = np.full(firsts[-1], -1, dtype=np.int64)
    guide = rules.guide or unguided(len(previous), rules.step, rules.change)
    sure = guide.reach < _SURELY * rules.step
    heads = _fresh(places[0], 0) if places else None
    for t in range(len(places) - 1):
        assert heads is not None
        later = int(firsts[t + 1])
        ends, starts = _pairs_taken(heads, trees[t + 1 : t + 4], later, rules, guide, sure)
        new = _fresh(places[t + 1], later)
        previous[new.point[starts]] = heads.point[ends]
        way = (new.place[starts] - heads.place[ends]) / (heads.age[ends] + 1)[:, None]
        new.velocity[starts], new.change[starts] = guide.onwards(
            heads.point[ends], new.point[starts], way
        )
        new.length[starts] = heads.length[ends] + 1
        lost: BoolArray = np.ones(len(heads.point), dtype=bool)
        lost[ends] = False
        certain = (heads.length >= _SURE) | sure[heads.point]
        waiting = heads.some(lost & certain & (heads.age < rules.gap))
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
        ends = np.flatnonzero(previous >= 0)
        ends = ends[previous[previous[ends]] >= 0]
        if not len(ends):
            break
        bend = xyz[ends] - 2.0 * xyz[previous[ends]] + xyz[previous[previous[ends]]]
        typical = float(np.median(np.linalg.norm(bend, axis=1)))
        # Exact ones, too, are sought within something.
        rules = replace(rules, change=min(widest, max(BEYOND * typical, 1e-6 * widest)))
    return rules


def guided(places: Sequence[FloatArray], rules: LinkRules, widest: float) -> LinkRules:
    """Return rules that seek particles where those around go, and as far as these show.

    Parameters
    ----------
    places : sequence of ndarray, shape (n_t, 3)
    rules : LinkRules
        Of a first linking.
    widest : float
        Bound of all distances from predictions. [object unit]
    """
    xyz = np.concatenate(list(places))
    for _ in range(_GUIDED):
        previous, before = linked(places, rules), rules
        order, numbers = in_tracks(previous, _SURE + 1)
        track = np.full(len(xyz), -1)
        track[order] = numbers
        guide = neighbours_guide(places, previous, track, widest)
        if guide is None:
            break
        strays = max(1.0, (track < 0).sum() / len(places))
        least = np.cbrt(_STRAYS * np.prod(np.ptp(xyz, axis=0)) / (4.0 / 3.0 * np.pi * strays))
        rules = replace(
            rules, guide=guide, least=min(float(least), widest),
            change=float(np.median(guide.change)),
        )  # fmt: skip
        if before.guide is not None and rules.change > (1.0 - _GAIN) * before.change:
            break
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
        first + np.arange(count), xyz, np.full((count, 3), np.nan), np.full(count, np.nan),
        np.zeros(count, dtype=np.int64), np.ones(count, dtype=np.int64),
    )  # fmt: skip


def _pairs_taken(
    heads: _Heads, trees: Sequence[cKDTree | None], first: int, rules: LinkRules, guide: Guide,
    sure: BoolArray,
) -> tuple[IntArray, IntArray]:  # fmt: skip
    """Return which ends go on in which particles of the next frame, whose first point is given."""
    none = np.empty(0, dtype=np.int64)
    if trees[0] is None or not len(heads.point):
        return none, none
    is_known = np.isfinite(heads.velocity[:, 0])
    known, fresh = np.flatnonzero(is_known), np.flatnonzero(~is_known)
    led = fresh[sure[heads.point[fresh]]]
    # What is new goes with those around or on its own; then it needs two more frames.
    head = np.concatenate([known, led, fresh])
    is_free = np.arange(len(head)) >= len(known) + len(led)
    way = np.concatenate([heads.velocity[known], guide.way[heads.point[led]],
                          np.broadcast_to(rules.drift, (len(fresh), 3))])  # fmt: skip
    reach = np.concatenate([heads.change[known], guide.reach[heads.point[led]],
                            np.full(len(fresh), rules.step)])  # fmt: skip
    steps = heads.age[head] + 1
    expected = heads.place[head] + way * steps[:, None]
    sought = np.where(is_free, reach, np.maximum(reach, rules.least))
    row, start = _around(trees[0], expected, sought * steps)
    if not len(row):
        return none, none
    end, is_free, is_new = head[row], is_free[row], row >= len(known)
    place = np.asarray(trees[0].data)[start]
    velocity = (place - heads.place[end]) / steps[row, None]
    off = ((place - expected[row]) ** 2).sum(axis=1) / reach[row] ** 2
    cost = np.where(is_free, 1.0, off)
    onwards, change = guide.onwards(heads.point[end], first + start, velocity)
    away, then = _nearest(trees, 1, place + onwards, change)
    cost += away**2
    new = np.flatnonzero(is_new)
    if len(trees) > 2:
        away, _ = _nearest(trees, 2, 2.0 * then[new] - place[new], change[new])
        cost[new] += away**2
        # Against those around it has to be there both times.
        cost[new[is_free[new] & sure[heads.point[end[new]]] & (away >= 1.0)]] = np.inf
    cost[is_free & np.isnan(then[:, 0])] = np.inf
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    order = order[each_once(np.stack([end, start], axis=1)[order])]
    return end[order], start[order]


def _around(tree: cKDTree, places: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the numbers of places, and of what is within reach of each, one after the other."""
    away, number = tree.query(places, k=_NEAR, distance_upper_bound=_over(reach))
    near: BoolArray = away <= reach[:, None]
    crowded = np.flatnonzero(near[:, -1])
    near[crowded] = False
    row, column = np.nonzero(near)
    rest = tree.query_ball_point(places[crowded], reach[crowded])
    rows = np.append(row, np.repeat(crowded, list(map(len, rest))))
    numbers = np.append(number[row, column], np.fromiter(chain.from_iterable(rest), np.int64))
    order = np.argsort(rows, kind="stable")
    return rows[order], numbers[order]


def _over(reach: FloatArray) -> float:
    """Return what is above the largest reach by a rounding: bounds of searches are not reached."""
    return float(np.nextafter(reach.max(initial=0.0), np.inf))


def _nearest(
    trees: Sequence[cKDTree | None], ahead: int, expected: FloatArray, reach: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return in how many reaches the nearest particle of a later frame is, 1 at most, and where."""
    away, place = np.ones(len(expected)), np.full(expected.shape, np.nan)
    tree = trees[ahead] if ahead < len(trees) else None
    good = np.flatnonzero(np.isfinite(expected[:, 0]))
    if tree is not None and len(good):
        distance, number = tree.query(expected[good], distance_upper_bound=_over(reach[good]))
        near = distance < reach[good]
        good = good[near]
        away[good] = distance[near] / reach[good]
        place[good] = np.asarray(tree.data)[number[near]]
    return away, place
