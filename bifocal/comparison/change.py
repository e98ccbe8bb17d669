"""Two relief maps of one wall: their difference, its precision, and where it is significant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike

from bifocal.comparison.cells import (
    Cells,
    difference_of,
    inside,
    trend_of,
    trend_terms,
    without_trend,
)
from bifocal.comparison.chance import Chance, Patches, chance
from bifocal.comparison.photo_evidence import PhotosOfDate, contradicted, parallax_of
from bifocal.comparison.tuning import CHANGE
from bifocal.model import ReliefMap
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, IntArray, positive
from photocore.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangedRegion:
    """A part of a wall whose relief has changed.

    Attributes
    ----------
    number : int
        The largest volume is 1.
    X, Y : float
        Its middle, weighted by the change. [m]
    area, volume, mean, largest : float
        Positive where the wall came forward; the volume with its rim and its unmeasured holes, the
        mean over the outline, the largest as an average over the smallest patch that proves it.
        [m², m³, m, m]
    sigma_area, sigma_volume, sigma_mean, sigma_largest : float
        Their standard deviations; of area and volume with the unmeasured ground beside the rim,
        where the change may go on.
    measured : float
        Share of the area that both maps have measured.
    open_rim : float
        Share of its rim beyond which a map has measured nothing: the change may go on there.
    probability : float
        That chance alone makes so large an average anywhere on the wall; never below 0.0001.
    """

    number: int
    X: float
    Y: float
    area: float
    sigma_area: float
    volume: float
    sigma_volume: float
    mean: float
    sigma_mean: float
    largest: float
    sigma_largest: float
    measured: float
    open_rim: float
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """What has changed on a wall between two dates.

    Attributes
    ----------
    difference : ReliefMap
        After minus before: positive where the wall came forward. [m]
    region : ndarray of int64, shape as the difference's
        Number of the changed region of each pixel; 0 where no change is proven, -1 where each
        date shows another surface of those that are there.
    smooth : ndarray, shape as the difference's
        Difference averaged over the smallest patches, bilinear between cells; 0 where unknown. [m]
    regions : tuple of ChangedRegion
        The largest volume first.
    level : float
        Probability that chance alone makes any region at all on the whole wall.
    trend, sigma_trend : tuple of float
        What was taken off as common to the whole wall: offset [m] at the middle of the map and
        slopes along X and Y; zeros where the maps were taken as they stand.
    patches : tuple of (float, float, float)
        Area of a patch [m²], and the mean change that would be found where it fills such a patch,
        over half and over nine tenths of the wall; infinite where none would [m].
    correlation_length : float
        Distance at which the correlation of the errors has fallen to 1/e. [m]
    compared : float
        Area of the wall that both maps have measured. [m²]
    remarks : tuple of str
    """

    difference: ReliefMap
    region: IntArray
    smooth: FloatArray
    regions: tuple[ChangedRegion, ...]
    level: float
    trend: tuple[float, float, float]
    sigma_trend: tuple[float, float, float]
    patches: tuple[tuple[float, float, float], ...]
    correlation_length: float
    compared: float
    remarks: tuple[str, ...]


def compare(
    before: ReliefMap,
    after: ReliefMap,
    *,
    stable: Sequence[ArrayLike] = (),
    fit: bool = False,
    level: float = 0.01,
    smallest: float = 0.02,
    dates: tuple[PhotosOfDate, PhotosOfDate] | None = None,
    seed: int = 1,
) -> Comparison:
    """Return what has changed between two relief maps of one wall in one plane frame.

    Parameters
    ----------
    before, after : ReliefMap
        In the same frame: both oriented on the same control. Only what both have measured is
        compared. A map without standard deviations gets them from the differences themselves.
    stable : sequence of array_like, each of shape (n, 2)
        Polygons (X, Y) of parts that did not move: offset and tilt between the maps are found
        there and taken off. [m]
    fit : bool
        Find offset and tilt on the whole wall instead, robustly: right where most of it did not
        move.
    level : float
        Probability that chance alone makes any region on the whole wall.
    smallest : float
        Area of the smallest patch whose mean change is tested; it and patches of 4, 16 and 64
        times as much are. [m²]
    dates : tuple of Pair or PhotoSet, optional
        The photos that both maps are of: what is found is held against them.
    seed : int
        Of the walls drawn to learn what chance does.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If the maps do not overlap, or an argument is unusable.

    Notes
    -----
    See "Two dates compared" among the pages for the method: the differences over their standard
    deviations, cut off at 4 so that one blunder proves nothing, are averaged over patches; the
    limit is what the largest average of the whole wall exceeds by chance with probability
    ``level``, drawn from walls whose errors are correlated as those of the maps are.

    Examples
    --------
    A wall of 4 x 3 m, measured twice to 1 mm, that came forward by 5 mm over half a square metre:

    >>> from bifocal.model.grid import Grid
    >>> rng = np.random.default_rng(7)
    >>> grid = Grid.from_bounds((0.0, 0.0, 4.0, 3.0), gsd=0.02)
    >>> def measured(moved):
    ...     r = rng.normal(0, 0.001, grid.shape)
    ...     r[50:85, 60:95] += moved
    ...     flat = ReliefMap.from_relief(r, plane_from_pixel=grid.plane_from_pixel)
    ...     return replace(flat, sigma=np.full(grid.shape, 0.001))
    >>> done = compare(measured(0.0), measured(0.005))
    >>> [(round(one.volume, 3), round(one.area, 1)) for one in done.regions]
    [(0.002, 0.5)]
    """
    for name, value in (("level", level), ("smallest", smallest)):
        positive(value, name)
    if level >= 1:
        raise InputError(f"level: {level:g} is no probability; give for example 0.01.")
    difference, two_surfaces, remarks = difference_of(before, after)
    wall = difference.r.size * difference.gsd**2
    if smallest > wall:
        raise InputError(remark("compare.patch_too_large", smallest=smallest, area=wall))
    radius = np.sqrt(smallest / (4 * np.pi))
    side = max(difference.gsd, radius / 2, max(difference.shape) * difference.gsd / CHANGE.side)
    pixels = max(1, round(side / difference.gsd))
    cells = Cells.of(difference, pixels)
    if int(cells.known.sum()) < CHANGE.least:
        raise InputError(remark("compare.nothing_in_common"))
    radii = [max(radius * 2**k / cells.grid.gsd, 0.5) for k in range(4)]
    rng = np.random.default_rng(seed)
    trend: FloatArray = np.zeros(3)
    covariance: FloatArray = np.zeros((3, 3))
    patches = Patches(cells.known, radii)
    if stable or fit:
        still = cells.known & inside(stable, cells.grid) if stable else cells.known
        trend, covariance = _common(difference, cells, still, patches, rng)
        difference = without_trend(difference, cells.grid.bounds, trend, covariance)
        cells = Cells.of(difference, pixels)
    # Chance is learned without what looks like a change, then without what is proven to be one.
    unchanged = cells.known & ~_wider(np.abs(_tested(cells.z, cells.known, patches)[0]) > 3)
    for _ in range(CHANGE.rounds):
        by_chance = chance(cells.z, unchanged, patches, cells.least, rng)
        test, sigmas, sizes = _tested(cells.z, unchanged, patches, by_chance)
        limit = by_chance.limit(level)
        labels = _labelled(test, limit)
        proven, unchanged = unchanged, cells.known & ~_wider(labels > 0)
        if (proven == unchanged).all() or not unchanged.any():
            break
    outlined = _Outlined(cells, test, sizes, by_chance, patches, sigmas, covariance)
    regions, labels = outlined.regions(labels)
    # What errs as one over most of the wall tells no offset either.
    if not (stable or fit) and unchanged.sum() >= CHANGE.least * max(by_chance.cells, 1.0):
        common, variance = trend_of(cells, unchanged, by_chance.cells)
        if abs(common[0]) > 3 * np.sqrt(variance[0, 0]):
            remarks.append(remark("compare.offset", offset=1000 * float(common[0])))
    smooth = np.nan_to_num(patches.averages(cells.difference)[0])
    height, width = difference.shape
    whole = labels.repeat(pixels, axis=0).repeat(pixels, axis=1)[:height, :width]
    if dates is not None and regions:
        moved = _moved_by(difference, parallax_of(difference, (before, after), dates))
        refuted = {"photos_contradict": contradicted(whole, difference, (before, after), dates)}
        two_surfaces |= np.isin(whole, refuted["photos_contradict"])
        weak = without_parallax(Cells.of(moved, pixels).z, cells.known, labels, patches)
        refuted["little_parallax"] = [n for n in weak if n not in refuted["photos_contradict"]]
        remarks += _refutations(whole, difference.gsd, refuted)
        regions, whole = _without(regions, whole, [n for each in refuted.values() for n in each])
    if numbers := [one.number for one in regions if one.open_rim > CHANGE.open]:
        remarks.append(remark("compare.goes_on", numbers=", ".join(map(str, numbers))))
    return Comparison(
        difference=difference,
        region=np.where(two_surfaces & (whole == 0), -1, whole),
        smooth=cv2.resize(smooth, None, fx=pixels, fy=pixels)[:height, :width],
        regions=regions,
        level=level,
        trend=_three(trend),
        sigma_trend=_three(np.sqrt(np.diag(covariance))),
        patches=_provable(cells, patches, by_chance, sigmas, limit),
        correlation_length=by_chance.length * cells.grid.gsd,
        compared=float(cells.known.sum() * cells.grid.gsd**2),
        remarks=tuple(remarks),
    )


def _common(
    difference: ReliefMap, cells: Cells, still: BoolArray, patches: Patches,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return offset and slopes of cells that did not move, and their covariance."""
    trend, _ = trend_of(cells, still, 1.0)
    pixels = round(cells.grid.gsd / difference.gsd)
    flat = without_trend(difference, cells.grid.bounds, trend, np.zeros((3, 3)))
    cells = Cells.of(flat, pixels)
    correlated = chance(cells.z, still, patches, cells.least, rng).cells
    return trend, trend_of(cells, still, correlated)[1]


def without_parallax(
    moved: FloatArray, measured: BoolArray, labels: IntArray, patches: Patches
) -> list[int]:
    """Return the numbers of regions that move photos no more than errors of the wall about them.

    Parameters
    ----------
    moved : ndarray
        By how much the difference of each cell moves the photos. [px]
    labels : ndarray of int64
        Numbers of the regions, cell by cell.
    """
    sizes = [np.nan_to_num(np.abs(part)) for part in patches.averages(moved)]
    still = measured & ~_wider(labels > 0)
    return [
        number
        for number in range(1, int(labels.max()) + 1)
        if all(part[labels == number].max() <= part[still].max(initial=0.0) for part in sizes)
    ]


def _moved_by(difference: ReliefMap, parallax: FloatArray) -> ReliefMap:
    """Return differences in pixels of the photos, given the pixels of a metre; sigma is one."""
    field = (difference.r * parallax).astype(np.float32)
    return replace(difference, r=field, sigma=np.ones_like(difference.sigma))


def _refutations(whole: IntArray, gsd: float, refuted: Mapping[str, Sequence[int]]) -> list[str]:
    """Return what is said of regions that the photos refute, by the key of what says so."""
    areas = {key: float(np.isin(whole, numbers).sum()) * gsd**2 for key, numbers in refuted.items()}
    return [
        remark(f"compare.{key}", count=len(numbers), area=areas[key])
        for key, numbers in refuted.items()
        if numbers
    ]


def _without(
    regions: Sequence[ChangedRegion], labels: IntArray, wrong: Sequence[int]
) -> tuple[tuple[ChangedRegion, ...], IntArray]:
    """Return regions but some, and the pixels of each, numbered anew."""
    kept = [one for one in regions if one.number not in wrong]
    ranks = np.zeros(len(regions) + 1, np.int64)
    ranks[[one.number for one in kept]] = np.arange(1, len(kept) + 1)
    return tuple(replace(one, number=int(ranks[one.number])) for one in kept), ranks[labels]


def _provable(
    cells: Cells, patches: Patches, by_chance: Chance, sigmas: FloatArray, limit: float
) -> tuple[tuple[float, float, float], ...]:
    """Return areas of patches, and what change of one of them shows over half and most of a wall.

    A disc of the area of a Gaussian patch, 4 pi radius^2, holds 1 - exp(-2) of its weight.
    """
    held, weights = 1 - np.exp(-2.0), patches.averages(1 / np.maximum(cells.sigma, 1e-9))
    rows = []
    for radius, sigma, of_size, weight in zip(
        patches.radii, sigmas, by_chance.sigmas, weights, strict=True
    ):
        needed = limit * float(sigma) / np.nanmedian(of_size) * of_size / held
        change = np.where(needed < CHANGE.clip, needed / weight, np.inf)[cells.known]
        half, most = np.quantile(
            np.where(np.isnan(change), np.inf, change), CHANGE.shares, method="higher"
        )
        area = 4 * np.pi * (radius * cells.grid.gsd) ** 2
        rows.append((float(area), float(half), float(most)))
    return tuple(rows)


def _three(values: FloatArray) -> tuple[float, float, float]:
    one, two, three = values.tolist()
    return one, two, three


def _wider(cells: BoolArray, side: int = 5) -> BoolArray:
    """Return cells and those in a square about each."""
    return cv2.dilate(cells.astype(np.uint8), np.ones((side, side), np.uint8)) > 0


def _tested(
    z: FloatArray, unchanged: BoolArray, patches: Patches, by_chance: Chance | None = None
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the average over the size of patch that tells most, over its sigma; sigmas; that size.

    The sigma of each size is what the wall itself shows, or what chance makes of the covariance,
    whichever is more. The test is 0 where nothing is known.
    """
    means = np.stack(patches.averages(z))
    sigmas = np.ones_like(means) if by_chance is None else by_chance.sigmas
    tests = means / sigmas
    usual = np.array([1.4826 * np.nanmedian(np.abs(test[unchanged])) for test in tests])
    least = 1e-9 if by_chance is None else 1.0
    factors = np.fmax(usual, least)
    tests = np.nan_to_num(tests / factors[:, None, None])
    best = np.abs(tests).argmax(axis=0)
    medians = [np.nanmedian(part) for part in sigmas] * factors
    return np.take_along_axis(tests, best[None], axis=0)[0], medians, best


def _labelled(test: FloatArray, limit: float) -> IntArray:
    """Return the numbers of coherent parts beyond a limit; rise and fall are kept apart."""
    from scipy.ndimage import label

    labels = np.zeros(test.shape, np.int64)
    for way in (1, -1):
        parts, _ = label(way * test > limit, np.ones((3, 3)))
        labels += np.where(parts > 0, parts + labels.max(), 0)
    return labels


@dataclass(frozen=True, slots=True, eq=False)
class _Outlined:
    """What is known of the cells when the proven parts of the wall are outlined."""

    cells: Cells
    test: FloatArray
    sizes: IntArray
    by_chance: Chance
    patches: Patches
    sigmas: FloatArray
    covariance: FloatArray

    def regions(self, labels: IntArray) -> tuple[tuple[ChangedRegion, ...], IntArray]:
        """Return the regions about parts with these numbers, and the cells of each.

        A region is what hangs together with a proven part and has changed, over the smallest
        patches that show most of it, by a quarter of its largest change and by two standard
        deviations; what no outline shows is the proven part itself.
        """
        averages = [np.nan_to_num(part) for part in self.patches.averages(self.cells.difference)]
        numbered, changes = np.zeros_like(labels), list[ChangedRegion]()
        parts = [labels == number for number in range(1, int(labels.max()) + 1)]
        for part in sorted(parts, key=lambda one: -np.abs(averages[0][one]).max()):
            free = numbered == 0
            inner, level = self._outline(part & free, averages, free)
            if inner is None or (one := self._region(part, inner, averages, level, free)) is None:
                continue
            numbered[inner & self.cells.known] = len(changes) + 1
            changes.append(replace(one, number=len(changes) + 1))
        order = sorted(changes, key=lambda one: -abs(one.volume))
        ranks = np.zeros(len(changes) + 1, np.int64)
        for rank, one in enumerate(order, start=1):
            ranks[one.number] = rank
        ordered = tuple(replace(one, number=int(ranks[one.number])) for one in order)
        return ordered, ranks[numbered]

    def _outline(
        self, part: BoolArray, averages: Sequence[FloatArray], free: BoolArray
    ) -> tuple[BoolArray | None, int]:
        """Return the cells of the region about a part, holes too, and the size of its patches."""
        from scipy.ndimage import binary_fill_holes, label

        if not part.any():
            return None, 0
        measured, last = self.cells.known, int(self.sizes[part][np.abs(self.test[part]).argmax()])
        outlines = []
        for level in range(last + 1):
            change = averages[level] * np.sign(self.test[part][0])
            edge = max(CHANGE.outline * float(change[part].max()), 2 * self._own(part, level))
            spread_out, _ = label((change >= edge) & measured & free)
            outlines.append(np.isin(spread_out, np.setdiff1d(spread_out[part], [0])))
        changed = np.where(measured, self.cells.difference, 0.0)
        whole = outlines[last] | part
        for level, inner in enumerate(outlines):
            rest = whole & ~inner & measured
            spread = self.by_chance.variance_of_sum(np.where(rest, self.cells.sigma, 0.0)) ** 0.5
            if inner.any() and abs(float(changed[rest].sum())) <= CHANGE.held * float(spread):
                return binary_fill_holes(inner) & free, level
        return binary_fill_holes(outlines[last] | part) & free, last

    def _own(self, part: BoolArray, level: int) -> float:
        """Return the standard deviation of an average over patches of a size. [m]"""
        return float(self.sigmas[level]) * float(np.median(self.cells.sigma[part]))

    def _beyond(self, inner: BoolArray, way: float) -> tuple[float, float]:
        """Return over how many cells a region may go on where nothing is measured, and how high.

        As far as it is wide, through unmeasured ground alone, as high as it is beside that. What
        is uniform between nothing and the whole has a root mean square of the whole / sqrt(3).
        """
        measured, grown = self.cells.known, inner.copy()
        for _ in range(max(1, round(float(np.sqrt(inner.sum() / np.pi))))):
            grown |= _wider(grown, 3) & ~measured
        beside = inner & measured & _wider(grown & ~inner)
        height = (
            max(0.0, way * float(self.cells.difference[beside].mean())) if beside.any() else 0.0
        )
        return float((grown & ~inner).sum()) / np.sqrt(3), height

    def _region(
        self, part: BoolArray, inner: BoolArray, averages: Sequence[FloatArray], level: int,
        free: BoolArray,
    ) -> ChangedRegion | None:  # fmt: skip
        """Return a region, its number not yet given; None if its volume is within its sigma.

        That is two standard deviations of what is measured, one with what is not.

        What other regions hold already is not ``free``.
        """
        cells, sigma, cell = self.cells, self._own(part, level), self.cells.grid.gsd**2
        way = float(np.sign(self.test[part][0]))
        change = averages[level] * way
        # What the outline cuts off lies within a patch of it, and chance adds nothing there.
        radius = max(1, round(2 * self.patches.radii[level]))
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)
        about = cv2.dilate(inner.astype(np.uint8), disc) > 0
        about &= cells.known & free
        terms = trend_terms(cells.grid, cells.grid.bounds)
        common, weights = terms[about].sum(axis=0), np.where(about, cells.sigma, 0.0)
        variance = self.by_chance.variance_of_sum(weights) + common @ self.covariance @ common
        values, holes = cells.difference[inner & cells.known], int((inner & ~cells.known).sum())
        total = float(cells.difference[about].sum()) + holes * float(values.mean())
        variance += (holes * float(values.std())) ** 2
        volume, spread = cell * total, cell * float(variance**0.5)
        beyond, height = self._beyond(inner, way)
        sigma_volume = float(np.hypot(spread, cell * beyond * height))
        if way * volume < max(2 * spread, sigma_volume):
            return None
        peak = float(change[part].max())
        near = _wider(inner) & cells.known
        edge = max(CHANGE.outline * peak, 2 * sigma)
        wide, narrow = (int((near & (change >= edge + sign * sigma)).sum()) for sign in (-1, 1))
        # How far a change reaches that fades out, no outline knows better than this.
        fading = int((inner & cells.known & (change < 2 * edge)).sum())
        moved = np.maximum(averages[0] * way, 1e-9)[inner]
        y, x = (float(np.average(index, weights=moved)) for index in np.nonzero(inner))
        area, rim = int(inner.sum()) * cell, _wider(inner, 3) & ~inner
        return ChangedRegion(
            number=0,
            X=cells.grid.x0 + x * cells.grid.gsd, Y=cells.grid.y0 - y * cells.grid.gsd,
            area=area,
            sigma_area=cell
            * max(1.0, float(np.linalg.norm([(wide - narrow) / 2, fading / 2, beyond]))),
            volume=volume, sigma_volume=sigma_volume,
            mean=volume / area, sigma_mean=spread / area,
            largest=peak * way, sigma_largest=sigma,
            measured=float(cells.known[inner].mean()),
            open_rim=float(np.mean(~cells.known[rim])) if rim.any() else 0.0,
            probability=self.by_chance.probability(float(np.abs(self.test[part]).max())),
        )  # fmt: skip
