"""A corrected surface held against soundings and check points, by classes of depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.remarks import remark
from photocore.adjustment.outliers import robust_sigma
from photocore.arrays import FloatArray, as_floats
from photocore.errors import GeometryError, InputError

#: Most classes that are made of themselves, and steps of their width.
MOST_CLASSES, STEPS = 8, (1.0, 2.0, 5.0, 10.0)
#: Robust sigmas beyond which an offset does not count for the line over depth.
GROSS = 3.5
#: Fewest soundings of a line over depth.
FEWEST = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthClass:
    """Offsets of the soundings in one class of depth. All lengths in m.

    Attributes
    ----------
    shallow, deep : float
        Its bounds.
    count : int
    mean, spread, rmse : float
        Of the offsets, sounding minus surface.
    mean_sigma : float
        Of the mean, from the spread alone: what all soundings share, it does not know.
    median, robust : float
        Median and 1.4826 times the median distance from it: what gross errors leave alone.
    expected : float
        Root mean square of the offsets' own sigmas; NaN if none are known.
    gross : int
        Offsets farther than 3.5 robust sigmas from the median.
    """

    shallow: float
    deep: float
    count: int
    mean: float
    spread: float
    rmse: float
    mean_sigma: float
    median: float
    robust: float
    expected: float
    gross: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthTrend:
    """The line offset = at_surface + per_metre * depth through the soundings, without gross ones.

    Attributes
    ----------
    at_surface, per_metre : float
        [m, m per m]
    at_surface_sigma, per_metre_sigma : float
        From the spread about the line.
    count : int
    """

    at_surface: float
    per_metre: float
    at_surface_sigma: float
    per_metre_sigma: float
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthOffsets:
    """Offsets of soundings by depth.

    Attributes
    ----------
    classes : tuple of DepthClass
        Those that hold soundings, shallow ones first.
    total : DepthClass
        All of them together.
    trend : DepthTrend or None
        Their line over depth; None for fewer than ten, or all of one depth.
    """

    classes: tuple[DepthClass, ...]
    total: DepthClass
    trend: DepthTrend | None


def depth_offsets(
    offsets: ArrayLike,
    depths: ArrayLike,
    *,
    sigmas: ArrayLike | None = None,
    edges: Sequence[float] | None = None,
) -> DepthOffsets:
    """Return what soundings say about a surface, by depth.

    Parameters
    ----------
    offsets : array_like, shape (n,)
        Sounding minus surface: positive where the surface lies too deep. NaN is left out. [m]
    depths : array_like, shape (n,)
        Of the soundings. [m]
    sigmas : array_like, shape (n,), optional
        Of the offsets: of surface and sounding together. [m]
    edges : sequence of float, optional
        Bounds of the classes, ascending; by default up to eight of a round width. [m]

    Returns
    -------
    DepthOffsets

    Raises
    ------
    InputError
        If the edges do not ascend.
    GeometryError
        If no sounding has an offset in a class.

    Notes
    -----
    With a level wrong by dL every offset is (1 - n) dL, with an index wrong by dn it is -dn/n of
    the depth: a line over depth tells them apart.

    Examples
    --------
    >>> depth = np.linspace(0.5, 7.5, 50)
    >>> found = depth_offsets(0.01 - 0.004 * depth, depth)
    >>> len(found.classes), round(found.trend.at_surface, 6), round(found.trend.per_metre, 6)
    (8, 0.01, -0.004)
    """
    offset, depth = as_floats(offsets, "offsets"), as_floats(depths, "depths")
    sigma = np.full(offset.shape, np.nan) if sigmas is None else as_floats(sigmas, "sigmas")
    finite = np.isfinite(offset) & np.isfinite(depth)
    offset, depth, sigma = offset[finite], depth[finite], sigma[finite]
    if not len(offset):
        raise GeometryError("no sounding lies on the surface.")
    bounds = _round_edges(depth) if edges is None else as_floats(edges, "depth classes")
    if len(bounds) < 2 or not (np.diff(bounds) > 0).all():
        raise InputError("depth classes: expected two or more depths that increase, as 0,1,2,5.")
    place = np.digitize(depth, bounds)
    classes = [
        _class(offset[place == k], sigma[place == k], bounds[k - 1], bounds[k])
        for k in range(1, len(bounds))
        if (place == k).any()
    ]
    if not classes:
        raise GeometryError(remark("bathymetry.no_class", least=depth.min(), most=depth.max()))
    inside = (place > 0) & (place < len(bounds))
    total = _class(offset[inside], sigma[inside], bounds[0], bounds[-1])
    return DepthOffsets(
        classes=tuple(classes), total=total, trend=_trend(offset[inside], depth[inside])
    )


def _round_edges(depth: FloatArray) -> FloatArray:
    """Return bounds of up to eight classes of a round width that hold all depths."""
    span = max(float(np.ptp(depth)), 1e-3)
    power = 10 ** np.floor(np.log10(span / MOST_CLASSES))
    for step in power * np.array(STEPS):
        first, last = np.floor(depth.min() / step), np.floor(depth.max() / step) + 1
        if last - first <= MOST_CLASSES:
            break
    return np.arange(first, last + 1) * step


def _class(offset: FloatArray, sigma: FloatArray, shallow: float, deep: float) -> DepthClass:
    """Return the statistics of one class."""
    count, median = len(offset), float(np.median(offset))
    spread = float(np.std(offset, ddof=1)) if count > 1 else np.nan
    robust = robust_sigma(offset - median) if count > 1 else np.nan
    return DepthClass(
        shallow=float(shallow), deep=float(deep), count=count, mean=float(offset.mean()),
        spread=spread, rmse=float(np.sqrt((offset**2).mean())),
        mean_sigma=spread / np.sqrt(count), median=median, robust=robust,
        expected=float(np.sqrt((sigma**2).mean())),
        gross=int((np.abs(offset - median) > GROSS * robust).sum()),
    )  # fmt: skip


def _trend(offset: FloatArray, depth: FloatArray) -> DepthTrend | None:
    """Return the line over depth, gross offsets left out one after the other; None: too few."""
    used = np.ones(len(offset), dtype=bool)
    while used.sum() >= FEWEST and np.ptp(depth[used]) > 0:
        design = np.column_stack([np.ones(len(depth)), depth])
        inverse = np.linalg.inv(design[used].T @ design[used])
        line = inverse @ design[used].T @ offset[used]
        residuals = offset - design @ line
        inside = np.abs(residuals) <= GROSS * max(robust_sigma(residuals[used]), 1e-12)
        if (inside | ~used).all():
            freedom = int(used.sum()) - 2
            sigma = np.sqrt(np.diag(inverse) * (residuals[used] ** 2).sum() / freedom)
            return DepthTrend(
                at_surface=float(line[0]), per_metre=float(line[1]),
                at_surface_sigma=float(sigma[0]), per_metre_sigma=float(sigma[1]),
                count=int(used.sum()),
            )  # fmt: skip
        used &= inside
    return None
