"""A second hypothesis of relief where optical flow is not sure: a plane sweep, tile by tile.

Railings, handrails and grilles are narrower than their own parallax: flow from coarse to fine finds
what is behind them. Where the sweep fits better, and fits nothing else in photo 2, it is believed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import cv2
import numpy as np

from bifocal.model.image import QUIET_BLUR
from bifocal.relief_maps import coarse_level, evidence, forward_projection, plane_sweep
from bifocal.relief_maps.flow import Measurement, is_inside, sigma_of_relief
from bifocal.relief_maps.frame import Frame, parallax_per_metre, zoom_map
from bifocal.relief_maps.plane_sweep import Box, Hypotheses
from photocore.arrays import BoolArray, ByteArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class HypothesisTuning:
    """Thin things, found by a sweep."""

    #: Side of the tiles that are swept, or not. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 64 px
    #: 63.0 and 6.05, 96 px 63.9 and 5.74, 128 px 65.7 and 5.66; façade 1021, hypotheses times
    #: pixels: 1, 1.5 and 1.7.
    tile: int = 96
    #: A tile is swept with so much around it. [px]
    #: Evidence: chosen: bars need what is around them; never varied by itself.
    margin: int = 16
    #: Tiles are swept of which flow leaves more than this share unvalidated.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 0.03
    #: 62.8 and 6.01, 0.1 62.8 and 6.05, for half of the pixels of façade 1021.
    unsure: float = 0.1
    #: Tiles a side around a tile whose relief says what may be in it.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 3
    #: 42.2 and 7.76, 5 61.0 and 6.37, 7 61.5 and 6.38.
    around: int = 5
    #: Tiles with fewer believed pixels say nothing. [px]
    fewest: int = 100
    #: Percentiles of a tile's relief that count as its least and greatest. [%]
    outliers: tuple[int, int] = (1, 99)
    #: How far beyond what is known around it a tile is searched. [m]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 0.1 m
    #: 61.0 and 6.37, 0.3 m 61.8 and 6.34, for more to compare.
    beyond: float = 0.1
    #: Parallax from which on the sweep says another thing than flow. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 1 px
    #: 61.3 and 6.10, 1.5 px 61.0 and 6.37.
    differs: float = 1.0
    #: Two pixels at one place of photo 2 within this parallax are one surface. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 1 px
    #: 60.9 and 6.41, 1.5 px 61.0 and 6.37.
    alone: float = 1.5
    #: What is validated gives way to a sweep that fits better by this cost, in photos that differ
    #: no more than usual.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 12
    #: 61.2 and 6.37, 24 61.0 and 6.37, 48 59.8 and 6.51.
    better: int = 24
    #: What is not validated gives way to one that fits better by this cost, in such photos.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 12
    #: 61.0 and 6.37, 24 60.0 and 6.45.
    better_invalid: int = 12
    #: Median cost of what is validated that these two hold for; in photos that differ more they
    #: rise with it, for noise alone fits better by as much here and there.
    #: Evidence: turbid water, 0.36 and 1.44 MP, mean error: 20 10.6 mm, 24 10.8 mm, without 12.7
    #: mm; tears of street and tracery 5001: 20 247 and 319 m, 24 246 and 326 m. Balconies (5001)
    #: have 19, gable to street 26 to 35, castle_B 38, turbid water 59.
    usual: float = 20.0
    #: Side of the cells whose finds are counted, each with the eight around. [px]
    #: Evidence: street and arcade 5001, counted by parallax, rails within 5 cm and beyond 3 cm [%]:
    #: 20 px 32.1 and 19.7, 10.0; 32 px and twice the finds 29.6 and 19.6, 10.0.
    cell: int = 20
    #: Finds around with the same relief; with fewer a find is chance. [px]
    #: Evidence: painted and wrong by 2 px [%], tears [m], balconies, street, tracery 5001: parts of
    #: 200 px whatever their relief 4.63, 185; 8.92, 311; 13.76, 408; 30 px street 8.52, 306,
    #: tracery 13.22, 418; 45 px 8.66, 290; 13.69, 371; 60 px 4.59, 174; 8.83, 268; 14.44, 336.
    company: int = 45
    #: And so many times as many as there were if all finds around were spread over their reliefs.
    #: Evidence: painted and wrong by 2 px [%], tears [m], tracery, gable, balconies 5001: without
    #: 13.86, 346; 3.73, 86; 4.55, 176; 1.5 14.15, 319; 3.80, 26; 4.55, 171; 2 14.92, 266; 3.66, 19;
    #: 4.68, 165.
    above_chance: float = 1.5
    #: Over so many at the least, a third of twice `same` each.
    #: Evidence: turbid water, 0.09 MP: 8 and 12 the same; chosen, for a rail alone has three.
    least_span: int = 12
    #: What is found in parts with fewer pixels is placed, but not called measured. [px]
    #: Evidence: hidden from photo 2 and called measured, loggia 201 and 202 [%]: with 3.00 and
    #: 4.03, without 3.48 and 4.52; parts before company 3.12 and 4.09; without support 3.01 and
    #: 4.10, but street 5001 painted and wrong 9.05 instead of 8.62 %.
    least_area: int = 200
    #: Precision of a sweep along the radius. [px]
    sigma: float = 0.3
    #: With fewer hypotheses there is nothing to choose from.
    fewest_tried: int = 5
    #: Pixels at half the resolution where the sweep knows better that a tile is swept in full for.
    #: [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 8 px
    #: 62.8 and 6.01, 24 px 63.1 and 6.01, for three quarters of the tiles of façade 1021.
    wanted: int = 24
    #: Where flow validates a smaller share of walls that are not plain, finds must be backed.
    #: Evidence: church_2 and church_1 in `fast` have 0.45 and 0.33, and the sweep made 4.5 and 13.6
    #: % of 2.0 and 10.3 % beyond 10 cm; façades and balconies have 0.8 and more.
    least_valid: float = 0.6
    #: Below this share a pair is left alone.
    #: Evidence: what is backed on white 5001 (0.20) and palazzo 5001 (0.11): painted and wrong 21.5
    #: to 20.3, 40.7 to 40.6 %, but tears 117 to 124, 143 to 150 m; castle_B (0.43): lines bent by a
    #: far pixel 5.37 to 4.59 %, tears 214 to 197 m.
    least_backed: float = 0.4
    #: The same of a pair of a set, whose other photos tell what is right.
    #: Evidence: a crop of balcony 1203 has 0.505 in the far photo and one aside, and there the
    #: sweep finds 42.7 % of the rails instead of 2.7; with 0.4 four photos of the church had 12.3 %
    #: of the points beyond 3 cm, with 0.6 11.8.
    least_valid_of_set: float = 0.5
    #: Pixels of the 5 x 5 around that must have a pixel's relief: for it to be taken as backed, and
    #: to vouch for the part in which it lies.
    #: Evidence: street 5001, right to 1 px, of finds that 1 to 2, 9 to 10, 13 to 14, 18 to 21 and
    #: 22 or more have: 8, 40, 63, 90 and 98 %; castle_B, lines bent by a far pixel, 5.37 % without
    #: any, 9 and 13 5.64, 9 and 18 5.01, 13 and 18 4.57 % (before the other rules).
    backing: tuple[int, int] = (13, 18)
    #: Relief is the same within this parallax. [px]
    same: float = 0.7
    #: Backed finds stand out from flow by this parallax: thin things stand before what flow found.
    #: [px]
    #: Evidence: arcade and street 5001: of finds 1 to 3 px off flow this was right at 28 to 36 %,
    #: of those farther off at 1 to 9 %; castle_B, tears, 210 m with those that fall back, 195 m
    #: without.
    stands_out: float = 4.0
    #: Pixels that must vouch for a part. [px]
    #: Evidence: white 5001, tears: 200 px 126, 350 px 124, 600 px 123 m; castle_B's slab is whole
    #: with 350.
    vouching: int = 350
    #: Both photos must be alike there: correlation in windows of `alike_window`.
    #: Evidence: castle_B: balcony 0.82 to 0.98, a tractor that stands in one photo 0.27 to 0.52.
    alike: float = 0.6
    #: Side of these windows. [px]
    alike_window: int = 15
    #: Backed finds lie so far within photo 2: at its rim flow has nothing to compare with. [px]
    rim: int = 15


HYPOTHESIS = HypothesisTuning()


class _Level(NamedTuple):
    """Photos at one resolution, and what flow found between them."""

    frame: Frame
    relief: Float32Array
    valid: BoolArray
    support: BoolArray


class _Found(NamedTuple):
    """What a sweep found where it looked: relief [m], its cost, and how much better it fits."""

    relief: Float32Array
    cost: Float32Array
    better: Float32Array


def with_swept(frame: Frame, matched: Measurement) -> tuple[Measurement, BoolArray]:
    """Return a measurement with the relief of a sweep where that fits better, and where it does.

    Notes
    -----
    At half the resolution tiles where flow is not sure are swept through all reliefs around them;
    where that finds what flow does not, through what either found at full resolution. Plain walls
    are swept in photos blurred like those of their flow. Where flow finds little in walls that are
    not plain, photos are oblique, much of them is hidden, or something stands in one of them: fit
    alone does not tell (church_2, `fast`, beyond 10 cm 2.0 to 4.5 %), and only what is backed is
    taken; where it finds hardly any, nothing.
    """
    sigma = sigma_of_relief(frame, matched.r, matched.sigma_px)
    valid = evidence.validated(matched.across, matched.loop, sigma, frame.distances[1])
    if matched.plain:
        first, second = (
            cv2.GaussianBlur(image, (0, 0), QUIET_BLUR) for image in (frame.image1, frame.image2)
        )
        frame = replace(frame, image1=first, image2=second)
    share = 1.0 if matched.plain else float(valid[frame.seen1].mean())
    if share < (HYPOTHESIS.least_valid_of_set if frame.of_set else HYPOTHESIS.least_backed):
        return matched, np.zeros_like(valid)
    doubtful = share < HYPOTHESIS.least_valid and not frame.of_set
    fine = _Level(frame, np.nan_to_num(matched.r), valid, evidence.supported(valid))
    half = coarse_level.halved(frame)
    every = np.s_[: 2 * half.grid.height : 2, : 2 * half.grid.width : 2]
    coarse = _Level(half, fine.relief[every], fine.valid[every], fine.support[every])
    guess = _guessed(coarse)
    hypothesis = _refined(fine, guess, _taken(coarse, guess))
    accepted = _taken(fine, hypothesis)
    accepted = (_backed if doubtful else _in_company)(fine, hypothesis, accepted)
    swept: dict[str, Any] = {
        "r": hypothesis.relief,
        "loop": 0,
        "across": 0,
        "sigma_px": HYPOTHESIS.sigma,
    }
    bands: dict[str, Any] = {
        name: np.where(accepted, np.float32(new), getattr(matched, name))
        for name, new in swept.items()
    }
    return replace(matched, **bands), accepted


def without_small(swept: BoolArray, measured: BoolArray) -> BoolArray:
    """Return what is measured but for small parts of what a sweep found: they may be chance."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(swept.astype(np.uint8), connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] < HYPOTHESIS.least_area
    small[0] = False
    return np.asarray(measured & ~small[label])


def _guessed(level: _Level) -> _Found:
    """Return what a sweep through all reliefs around each tile finds where flow is not sure."""
    hypothesis, shape = _nothing(level), level.valid.shape
    unsure = level.frame.seen1 & ~level.valid
    low, high = _ranges(level)
    for tile, box in _tiles(shape):
        if low[tile] < high[tile] and unsure[box].mean() > HYPOTHESIS.unsure:
            wide = _widened(box, shape)
            tried = Hypotheses.between(level.frame, wide, float(low[tile]), float(high[tile]))
            _sweep(hypothesis, level, box, wide, tried)
    return hypothesis


def _refined(level: _Level, guess: _Found, chosen: BoolArray) -> _Found:
    """Return what a sweep through the reliefs at hand finds where a guess differs from flow."""
    hypothesis, shape = _nothing(level), level.valid.shape
    for _, box in _tiles(shape):
        if chosen[_halves(box)].sum() > HYPOTHESIS.wanted:
            wide = _widened(box, shape)
            values = guess.relief[_halves(wide)]
            supported = level.relief[wide][level.support[wide]][::4]
            values = np.concatenate([values[np.isfinite(values)], supported])
            _sweep(hypothesis, level, box, wide, Hypotheses.near(level.frame, wide, values))
    return hypothesis


def _nothing(level: _Level) -> _Found:
    """Return a result without any."""
    empty = np.full(level.valid.shape, np.nan, np.float32)
    return _Found(empty, empty.copy(), empty.copy())


def _sweep(best: _Found, level: _Level, box: Box, wide: Box, tried: Hypotheses) -> None:
    """Sweep a tile with what is around it (in place)."""
    if len(tried.numbers) < HYPOTHESIS.fewest_tried:
        return
    relief, cost = plane_sweep.swept(level.frame, wide, tried)
    start_relief = np.where(np.isnan(relief), level.relief[wide], relief)
    cost_kept, new = (
        plane_sweep.misfit(level.frame, wide, values)
        for values in (level.relief[wide], start_relief)
    )
    inner = tuple(
        slice(part.start - around.start, part.stop - around.start)
        for part, around in zip(box, wide, strict=True)
    )
    for band, values in zip(best, (relief, cost, cost_kept - new), strict=True):
        band[box] = values[inner]


def _tiles(shape: tuple[int, int]) -> Iterator[tuple[tuple[int, int], Box]]:
    """Yield the tiles of an image, with row and column of each among them."""
    side = HYPOTHESIS.tile
    for i, j in np.ndindex(-(-shape[0] // side), -(-shape[1] // side)):
        rows, columns = (
            slice(n * side, min((n + 1) * side, length))
            for n, length in zip((i, j), shape, strict=True)
        )
        yield (i, j), (rows, columns)


def _widened(box: Box, shape: tuple[int, int]) -> Box:
    """Return a tile with its margin, as far as the image reaches."""
    rows, columns = (
        slice(max(part.start - HYPOTHESIS.margin, 0), min(part.stop + HYPOTHESIS.margin, length))
        for part, length in zip(box, shape, strict=True)
    )
    return rows, columns


def _halves(box: Box) -> Box:
    """Return a box at half the resolution."""
    rows, columns = (slice(part.start // 2, part.stop // 2) for part in box)
    return rows, columns


def _ranges(level: _Level) -> tuple[Float32Array, Float32Array]:
    """Return the least and greatest relief around every tile, and beyond. [m]"""
    height, width = level.valid.shape
    size = (-(-height // HYPOTHESIS.tile), -(-width // HYPOTHESIS.tile))
    low, high = np.full(size, np.inf, np.float32), np.full(size, -np.inf, np.float32)
    for tile, box in _tiles(level.valid.shape):
        values = level.relief[box][level.support[box]]
        if len(values) > HYPOTHESIS.fewest:
            low[tile], high[tile] = np.percentile(values, HYPOTHESIS.outliers)
    around = np.ones((HYPOTHESIS.around, HYPOTHESIS.around), np.uint8)
    beyond = np.float32(HYPOTHESIS.beyond)
    return cv2.erode(low, around) - beyond, cv2.dilate(high, around) + beyond


def _taken(level: _Level, found: _Found) -> BoolArray:
    """Return where a sweep fits better than flow, and best of all at its place of photo 2."""
    accepted = np.zeros(level.valid.shape, bool)
    at = np.nonzero(np.isfinite(found.relief))
    if not len(at[0]):
        return accepted
    relief = found.relief[at]
    column, row, parallax = plane_sweep.places(level.frame, (at[0], at[1]), relief)
    height, width = level.valid.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    index = np.where(inside, row * width + column, 0)
    inside &= level.frame.seen2.ravel()[index]
    # Of two pixels at one place of photo 2 the one that fits worse is hidden there.
    fit = np.where(inside, -found.cost[at], -np.inf).astype(np.float32)
    best = np.full(accepted.size, -np.inf, np.float32)
    forward_projection.highest(fit, index, best)
    placed = np.full(accepted.size, np.nan, np.float32)
    first = inside & (best[index] == fit)
    placed[index[first]] = relief[first]
    alone = np.abs(placed[index] - relief) * parallax < HYPOTHESIS.alone
    differs = np.abs(relief - level.relief[at]) * parallax > HYPOTHESIS.differs
    margin = np.where(level.valid[at], HYPOTHESIS.better, HYPOTHESIS.better_invalid)
    margin = margin * max(_misfit(level) / HYPOTHESIS.usual, 1.0)
    accepted[at] = inside & alone & differs & (found.better[at] > margin)
    return accepted


def _misfit(level: _Level) -> float:
    """Return the median cost of what flow validates, in a third of the tiles: what noise costs."""
    tiles = [box for tile, box in _tiles(level.valid.shape) if sum(tile) % 3 == 0]
    costs = [
        plane_sweep.misfit(level.frame, box, level.relief[box])[level.valid[box]] for box in tiles
    ]
    cost = np.concatenate(costs)
    return float(np.median(cost)) if len(cost) else 0.0


def _in_company(level: _Level, hypothesis: _Found, finds: BoolArray) -> BoolArray:
    """Return the finds with enough of the same relief around: true rails lie in one plane.

    Neighbours need not touch: a rail of two pixels comes in pieces, what is chance scatters over
    all reliefs. Finds are counted in cells of row, column and relief, 3 x 3 x 3 of them, and by
    what they would be if all finds around were spread evenly over their reliefs.
    """
    kept = np.zeros_like(finds)
    at = np.nonzero(finds)
    if not len(at[0]):
        return kept
    relief = hypothesis.relief[at]
    scale = float(np.median(parallax_per_metre(level.frame)[at])) / (2 * HYPOTHESIS.same / 3)
    places = (*(n // HYPOTHESIS.cell for n in at), ((relief - relief.min()) * scale).astype(int))
    cells = tuple(n + 1 for n in places)
    shape = tuple(int(n.max()) + 2 for n in cells)
    index = np.ravel_multi_index(cells, shape)
    count = np.bincount(index, minlength=math.prod(shape)).astype(np.uint16).reshape(shape)
    for axis in (0, 1):
        count += np.roll(count, 1, axis) + np.roll(count, -1, axis)
    some = count > 0
    span = shape[2] - some.argmax(2) - some[..., ::-1].argmax(2)
    chance = 3 * count.sum(2) / np.maximum(span, HYPOTHESIS.least_span)
    enough = np.maximum(HYPOTHESIS.company, HYPOTHESIS.above_chance * chance)
    count += np.roll(count, 1, 2) + np.roll(count, -1, 2)
    kept[at] = count[cells] > enough[cells[:2]]
    return kept


def _backed(level: _Level, best: _Found, chosen: BoolArray) -> BoolArray:
    """Return the parts of what is taken whose relief is even and at which both photos are alike."""
    frame, relief = level.frame, np.where(chosen, best.relief, level.relief)
    scale = parallax_per_metre(frame)
    side = 2 * HYPOTHESIS.rim + 1
    inside = is_inside(frame, level.relief).astype(np.uint8)
    out = (relief - level.relief) * scale > HYPOTHESIS.stands_out
    backing = _backing(relief, scale)
    least, most = HYPOTHESIS.backing
    kept = chosen & out & (backing >= least) & (cv2.erode(inside, np.ones((side, side))) > 0)
    vouching = kept & (backing >= most) & (_likeness(frame, relief) > HYPOTHESIS.alike)
    count, part = cv2.connectedComponents(kept.astype(np.uint8), connectivity=8)
    enough = np.bincount(part[vouching], minlength=count) >= HYPOTHESIS.vouching
    return np.asarray(kept & enough[part])


def _backing(relief: Float32Array, scale: Float32Array) -> ByteArray:
    """Return how many of the 5 x 5 px around have the relief of a pixel."""
    count = np.zeros(relief.shape, np.uint8)
    bordered = cv2.copyMakeBorder(relief, 2, 2, 2, 2, cv2.BORDER_REFLECT)
    for y, x in np.ndindex(5, 5):
        beside = bordered[y : y + relief.shape[0], x : x + relief.shape[1]]
        count += np.abs(beside - relief) * scale < HYPOTHESIS.same
    return count


def _likeness(frame: Frame, relief: Float32Array) -> Float32Array:
    """Return the correlation of both photos around every pixel at its relief."""

    def mean(values: Float32Array) -> Float32Array:
        return np.asarray(cv2.blur(values, (HYPOTHESIS.alike_window,) * 2), np.float32)

    far = frame.image1.astype(np.float32)
    near = cv2.remap(frame.image2.astype(np.float32), *zoom_map(frame, relief), cv2.INTER_LINEAR)
    a, b = mean(far), mean(near)
    # Below two grey levels contrast is noise.
    spread = np.sqrt(
        np.maximum(mean(far * far) - a * a, 4) * np.maximum(mean(near * near) - b * b, 4)
    )
    return np.asarray((mean(far * near) - a * b) / spread)
