"""Two relief maps of one wall: their difference, its precision, and where it is significant."""

from __future__ import annotations

from collections.abc import Sequence
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
from bifocal.comparison.tuning import CHANGE
from bifocal.model.relief_map import ReliefMap
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
        Its middle. [m]
    area, volume, mean, largest : float
        Positive where the wall came forward; the mean over the outline, the largest as an average
        over the smallest patch. [m², m³, m, m]
    sigma_area, sigma_volume, sigma_mean, sigma_largest : float
        Their standard deviations.
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
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """What has changed on a wall between two dates.

    Attributes
    ----------
    difference : ReliefMap
        After minus before: positive where the wall came forward. [m]
    region : ndarray of int64, shape as the difference's
        Number of the changed region of each pixel; 0 where no change is proven.
    smooth : ndarray, shape as the difference's
        Difference averaged over the smallest patches, bilinear between cells; 0 where unknown. [m]
    regions : tuple of ChangedRegion
        The largest volume first.
    level : float
        Probability that chance alone makes any region at all on the whole wall.
    trend, sigma_trend : tuple of float
        What was taken off as common to the whole wall: offset [m] at the middle of the map and
        slopes along X and Y; zeros where the maps were taken as they stand.
    patches : tuple of (float, float)
        Area of a patch [m²], and the mean change over it that would be found [m].
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
    patches: tuple[tuple[float, float], ...]
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
    deviations, cut off at 3 so that one blunder proves nothing, are averaged over patches; the
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
    difference, remarks = difference_of(before, after)
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
    patches, bounds = Patches(cells.known, radii), cells.grid.bounds
    if stable or fit:
        still = cells.known & inside(stable, cells.grid) if stable else cells.known
        trend, _ = trend_of(cells, still, 1.0)
        cells = Cells.of(without_trend(difference, bounds, trend, covariance), pixels)
        correlated = chance(cells.z, still, patches, cells.least, rng).cells
        covariance = trend_of(cells, still, correlated)[1]
        difference = without_trend(difference, bounds, trend, covariance)
        cells = Cells.of(difference, pixels)
    # Chance is learned without what looks like a change, then without what is proven to be one.
    unchanged = cells.known & ~_wider(np.abs(_tested(cells.z, cells.known, patches)[0]) > 3)
    for _ in range(CHANGE.rounds):
        by_chance = chance(cells.z, unchanged, patches, cells.least, rng)
        test, sigmas = _tested(cells.z, unchanged, patches, by_chance)
        limit = by_chance.limit(level)
        labels = _labelled(test, limit)
        proven, unchanged = unchanged, cells.known & ~_wider(labels > 0)
        if (proven == unchanged).all() or not unchanged.any():
            break
    regions, labels = _regions(cells, labels, test, by_chance, patches, sigmas[0], covariance)
    usual = float(np.median(cells.sigma[unchanged]))
    if not (stable or fit):
        common, variance = trend_of(cells, unchanged, by_chance.cells)
        if abs(common[0]) > 3 * np.sqrt(variance[0, 0]):
            remarks.append(remark("compare.offset", offset=1000 * float(common[0])))
    smooth = np.nan_to_num(patches.averages(cells.difference)[0])
    whole = labels.repeat(pixels, axis=0).repeat(pixels, axis=1)
    return Comparison(
        difference=difference,
        region=whole[: difference.shape[0], : difference.shape[1]],
        smooth=cv2.resize(smooth, None, fx=pixels, fy=pixels, interpolation=cv2.INTER_LINEAR)[
            : difference.shape[0], : difference.shape[1]
        ],
        regions=regions,
        level=level,
        trend=_three(trend),
        sigma_trend=_three(np.sqrt(np.diag(covariance))),
        patches=tuple(
            (float(4 * np.pi * (radius * cells.grid.gsd) ** 2), limit * float(sigma) * usual)
            for radius, sigma in zip(radii, sigmas, strict=True)
        ),
        correlation_length=by_chance.length * cells.grid.gsd,
        compared=float(cells.known.sum() * cells.grid.gsd**2),
        remarks=tuple(remarks),
    )


def _three(values: FloatArray) -> tuple[float, float, float]:
    one, two, three = values.tolist()
    return one, two, three


def _wider(cells: BoolArray) -> BoolArray:
    """Return cells and the two about each."""
    return cv2.dilate(cells.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0


def _tested(
    z: FloatArray, unchanged: BoolArray, patches: Patches, by_chance: Chance | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the average over the size of patch that tells most, over its sigma; and the sigmas.

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
    best = np.abs(tests).argmax(axis=0)[None]
    medians = [np.nanmedian(part) for part in sigmas] * factors
    return np.take_along_axis(tests, best, axis=0)[0], medians


def _labelled(test: FloatArray, limit: float) -> IntArray:
    """Return the numbers of coherent parts beyond a limit; rise and fall are kept apart."""
    from scipy.ndimage import label

    labels = np.zeros(test.shape, np.int64)
    for way in (1, -1):
        parts, _ = label(way * test > limit, np.ones((3, 3)))
        labels += np.where(parts > 0, parts + labels.max(), 0)
    return labels


def _regions(
    cells: Cells, labels: IntArray, test: FloatArray, by_chance: Chance, patches: Patches,
    sigma: float, covariance: FloatArray,
) -> tuple[tuple[ChangedRegion, ...], IntArray]:  # fmt: skip
    """Return the regions and their cells, outlined by the change over the smallest patches.

    A region is what hangs together with a significant part and has changed by a quarter of its
    largest change at least, and by two standard deviations.
    """
    from scipy.ndimage import binary_fill_holes, label

    smooth = np.nan_to_num(patches.averages(cells.difference)[0])
    terms, cell = trend_terms(cells.grid, cells.grid.bounds), cells.grid.gsd**2
    numbered, made = np.zeros_like(labels), list[ChangedRegion]()
    parts = [labels == number for number in range(1, int(labels.max()) + 1)]
    for part in sorted(parts, key=lambda one: -np.abs(smooth[one]).max()):
        change = smooth * np.sign(test[part][0])
        peak, own = float(change[part].max()), sigma * float(np.median(cells.sigma[part]))
        edge = max(CHANGE.outline * peak, 2 * own)
        spread_out, _ = label((change >= edge) & cells.known & (numbered == 0))
        inner = np.isin(spread_out, np.setdiff1d(spread_out[part], [0]))
        inner = binary_fill_holes(inner) & cells.known & (numbered == 0)
        if not inner.any():
            continue
        common, weights = terms[inner].sum(axis=0), np.where(inner, cells.sigma, 0.0)
        variance = by_chance.variance_of_sum(weights) + common @ covariance @ common
        volume, spread = cell * float(cells.difference[inner].sum()), cell * float(variance**0.5)
        if abs(volume) < 3 * spread:
            continue
        near = _wider(inner) & cells.known
        wide, narrow = (int((near & (change >= edge + way * own)).sum()) for way in (-1, 1))
        y, x = (float(index.mean()) for index in np.nonzero(inner))
        area = int(inner.sum()) * cell
        numbered[inner] = len(made) + 1
        made.append(ChangedRegion(
            number=len(made) + 1,
            X=cells.grid.x0 + x * cells.grid.gsd, Y=cells.grid.y0 - y * cells.grid.gsd,
            area=area, sigma_area=max(cell, (wide - narrow) / 2 * cell),
            volume=volume, sigma_volume=spread, mean=volume / area, sigma_mean=spread / area,
            largest=peak * float(np.sign(volume)), sigma_largest=own,
            probability=by_chance.probability(float(np.abs(test[part]).max())),
        ))  # fmt: skip
    order = sorted(made, key=lambda one: -abs(one.volume))
    ranks = np.zeros(len(made) + 1, np.int64)
    for rank, one in enumerate(order, start=1):
        ranks[one.number] = rank
    return tuple(replace(one, number=int(ranks[one.number])) for one in order), ranks[numbered]
