"""Height of the water from tie points, some on the surface, many on the bottom below it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree
from scipy.special import ndtr
from scipy.stats import poisson

from multimedia.media import Plane
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.errors import GeometryError, InputError

#: Fewest points that may be called a water surface.
FEWEST = 5
#: The surface may hold this share of the points of the largest group and still be the surface.
SMALLEST_SHARE = 0.1
#: So many standard deviations to either side the surface and what surrounds it are told apart.
WINDOW = 6.0
#: Widths at which groups are looked for, from the extent of the heights downwards.
SCALES, FINEST = 14, 2.0
#: A group is one if chance fills its place from its surroundings with less than this probability.
CHANCE = 1e-7
#: Flanks of a group from which its surroundings are judged, near and far. [widths]
INNER, NEAR, FAR = 3.0, 8.0, 25.0
#: The middle of a group holds at most so much more, in density, than the whole of it.
SAME = 0.4
#: Heights among which groups are looked for.
ENOUGH = 4000
ROUNDS = 400
#: Neighbours that show whether a point lies on a slope.
NEIGHBOURS = 16
#: Steeper than this no water stands, level or tilted; banks and bottoms rise by 0.05 and more.
STEEPEST = (0.02, 0.04)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaterLevel:
    """The water surface fitted to tie points.

    Attributes
    ----------
    level : float
        Mean height; of a tilted surface at ``centre``. [m]
    sigma : float
        Standard deviation of the level, if the points are independent. [m]
    spread : float
        Standard deviation of a single point: measurement and waves together. [m]
    used : ndarray of bool, shape (n,)
        Points on the surface.
    below, above : int
        Rejected points under the surface (bottom) and over it.
    surface : Plane
        Ready for `correct_bathymetry`.
    slope : ndarray, shape (2,)
        Rise per metre along X and Y; zero unless fitted.
    slope_sigma : ndarray, shape (2,)
        Its standard deviation.
    centre : ndarray, shape (2,)
        Mean X and Y of the used points. [m]
    larger : tuple of (int, float), optional
        Points and height of the largest group, where that is not the highest. [m]
    """

    level: float
    sigma: float
    spread: float
    used: BoolArray
    below: int
    above: int
    surface: Plane
    slope: FloatArray
    slope_sigma: FloatArray
    centre: FloatArray
    larger: tuple[int, float] | None = None


def mean_water_level(
    points: ArrayLike, *, tilted: bool = False, spread: float | None = None
) -> WaterLevel:
    """Estimate the mean water height from tie points, rejecting those on the bottom.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        Tie points, Z up; a mixture of surface, bottom and blunders is expected. [m]
    tilted : bool
        Fit a tilted plane instead of a height.
    spread : float, optional
        Expected standard deviation of a surface point, waves included; estimated from the data
        when not given. [m]

    Returns
    -------
    WaterLevel
        Level with its standard deviation, and which points were used.

    Raises
    ------
    InputError
        If there are fewer than 5 points.
    GeometryError
        If no group of points looks like a surface.

    Notes
    -----
    The water surface is the highest dense group of heights, not the largest: clear water gives
    more tie points on the bottom. A group is a place that holds more points than its flanks let
    chance put there; of those that hold at least 5 points and a tenth of the largest, the highest
    is taken. Points that lie with their neighbours on a slope steeper than water are no group's.
    Around it heights are a mixture: a normal distribution (the surface), and the bottom
    below and the bank above it, whose densities may differ and end at the surface, as unsharp as
    its points are. Points count with the probability that they belong to the surface, so that a
    bank that starts at the water line does not pull the level; the standard deviation is that of
    the estimating equations (sandwich), the cost of not knowing which point belongs included.

    Examples
    --------
    >>> bottom = [[x, 0, 1.60 + 0.002 * x] for x in range(30)]
    >>> surface = [[x, 1, 1.807 + 0.001 * (x % 2)] for x in range(10)]
    >>> water = mean_water_level(bottom + surface)
    >>> print(round(water.level, 4), int(water.used.sum()), water.below)
    1.8075 10 30
    """
    xyz = as_points(points, "points", dimension=3).reshape(-1, 3)
    finite = np.asarray(np.isfinite(xyz).all(-1))
    if finite.sum() < FEWEST:
        raise InputError(remark("bathymetry.few_ties", count=int(finite.sum()), fewest=FEWEST))
    if spread is not None and not spread > 0:
        raise InputError(f"spread: must be above zero [m], got {spread}.")
    heights = xyz[finite, 2]
    some = xyz[finite][:: max(1, len(heights) // ENOUGH)]
    level = _level_points(some, STEEPEST[tilted])
    start, width, larger = _highest_group(
        some[level, 2] if level.sum() >= FEWEST else heights, spread
    )
    near = np.abs(heights - start) <= 3.0 * width
    centre = xyz[finite][near, :2].mean(0)
    design = np.ones((len(xyz), 1))
    if tilted:
        design = np.column_stack([design, xyz[:, :2] - centre])
    floor = 1e-9 * max(1.0, float(np.abs(heights).max()))
    fitted = _Mixture(design[finite], heights, floor).settled(start, width)
    used = np.zeros(len(xyz), dtype=bool)
    used[finite] = fitted.shares[:, 0] > 0.5
    _refuse_weak(design, used)
    solution = fitted.solution
    residual = xyz[:, 2] - design @ solution
    sigma = fitted.sigmas()
    slope = solution[1:] if tilted else np.zeros(2)
    at_origin = solution[0] - slope @ centre
    return WaterLevel(
        level=float(solution[0]),
        sigma=float(sigma[0]),
        spread=fitted.spread if fitted.spread > floor else 0.0,
        used=used,
        below=int((finite & ~used & (residual < 0)).sum()),
        above=int((finite & ~used & (residual > 0)).sum()),
        surface=Plane.tilted(float(at_origin), slope_x=float(slope[0]), slope_y=float(slope[1])),
        slope=slope,
        slope_sigma=sigma[1:] if tilted else np.zeros(2),
        centre=centre, larger=larger,
    )  # fmt: skip


def _level_points(xyz: FloatArray, steepest: float) -> BoolArray:
    """Return which points do not lie, with their neighbours, on ground steeper than water.

    Points that crowd on a bank are at one height, too; those around them show that it is a slope.
    """
    tree = cKDTree(xyz[:, :2])
    count = min(NEIGHBOURS, len(xyz) - 1)
    radius = float(np.median(tree.query(xyz[:, :2], [count + 1])[0]))
    level = np.ones(len(xyz), dtype=bool)
    for row, near in enumerate(tree.query_ball_point(xyz[:, :2], radius)):
        around = xyz[near] - xyz[row]
        design = np.column_stack([np.ones(len(near)), around[:, :2]])
        kept = np.ones(len(near), dtype=bool)
        for _ in range(3):
            plane = np.linalg.lstsq(design[kept], around[kept, 2], rcond=None)[0]
            away = np.abs(around[:, 2] - design @ plane)
            scatter = 1.4826 * float(np.median(away))
            kept = away <= 3.0 * scatter
            if kept.sum() < FEWEST:
                break
        else:
            rise = float(np.std(design[kept, 1:] @ plane[1:]))
            # Surface and bottom lie on a plane as well where each is a line of points: a step.
            heights = np.sort(around[kept, 2])
            is_step = np.diff(heights)[3:-3].max(initial=0.0) > 0.6 * (heights[-1] - heights[0])
            steep = float(np.hypot(*plane[1:])) > steepest and rise > scatter and not is_step
            level[row] = not (steep and abs(plane[0]) <= 3.0 * scatter)
    return level


def _highest_group(
    heights: FloatArray, spread: float | None
) -> tuple[float, float, tuple[int, float] | None]:
    """Return middle and width of the highest group that may be a surface, and any larger group."""
    ordered = np.sort(heights)
    extent = float(ordered[-1] - ordered[0])
    if extent == 0:
        return float(ordered[0]), 1e-9 * max(1.0, abs(float(ordered[0]))), None
    # Of very many heights some thousands show the groups as well.
    few = ordered[:: max(1, len(ordered) // ENOUGH)]
    widths = [spread] if spread is not None else _widths(few)
    kept: list[_Group] = []
    for width in sorted(widths):
        for group in _groups(few, width):
            inside = [k for k, o in enumerate(kept) if abs(o.middle - group.middle) <= 4.0 * width]
            if not inside:
                kept.append(group)
            elif len(inside) == 1 and group.is_more_of(kept[inside[0]]):
                kept[inside[0]] = group._replace(density=kept[inside[0]].density)
    counts, middles = [], []
    for group in kept:
        part = _Mixture(np.ones((len(few), 1)), few, 1e-9 * max(1.0, float(np.abs(few).max())))
        part.settled(group.middle, group.width)
        counts.append(float(part.shares[:, 0].sum()))
        middles.append(float(part.solution[0]))
    least = max((SMALLEST_SHARE * group.points for group in kept), default=0.0)
    least = max(least, (FEWEST - 0.5) * len(few) / len(ordered))
    good = [k for k, count in enumerate(counts) if count >= least]
    if not good:
        raise GeometryError(remark("bathymetry.no_surface", fewest=FEWEST))
    highest, most = max(good, key=lambda k: middles[k]), max(good, key=lambda k: counts[k])
    share = len(ordered) / len(few)
    larger = None if most == highest else (round(counts[most] * share), middles[most])
    return kept[highest].middle, kept[highest].width, larger


def _widths(ordered: FloatArray) -> list[float]:
    """Return the widths of groups that the heights may show, wide to narrow."""
    count = min(FEWEST, len(ordered)) - 1
    shortest = float((ordered[count:] - ordered[: len(ordered) - count]).min())
    extent = float(ordered[-1] - ordered[0])
    # Heights rounded to the millimetre repeat; the rounding is then no spread of its own.
    gaps = np.diff(ordered)
    repeats = gaps <= 1e-9 * extent
    rounding = float(gaps[~repeats].min()) if repeats.sum() > len(ordered) // 10 else 0.0
    finest = max(shortest / FINEST, 2.0 * rounding, 1e-4 * extent)
    widths: list[float] = np.geomspace(extent / 6.0, min(finest, extent / 6.0), SCALES).tolist()
    return widths


class _Group(NamedTuple):
    """Heights that lie denser than chance would have it."""

    chance: float  # logarithm
    middle: float
    width: float
    density: float
    points: int

    def is_more_of(self, narrow: _Group) -> bool:
        """Whether this is the same group seen wider, not what surrounds it."""
        same = abs(self.middle - narrow.middle) <= self.width
        return same and self.density >= SAME * narrow.density and self.chance < narrow.chance


def _groups(ordered: FloatArray, width: float) -> list[_Group]:
    """Return the groups of a width, the surest first.

    Around every height the points within two widths are counted, and what the density of either
    flank, near or far, would put there.
    """

    def between(low: float, high: float) -> FloatArray:
        first = np.searchsorted(ordered, ordered + low * width, side="left")
        last = np.searchsorted(ordered, ordered + high * width, side="right")
        return np.asarray(last - first, dtype=np.float64)

    inside = between(-2.0, 2.0)
    # The denser flank counts: the edge of a slope has nothing on one side and is no group.
    flanks = np.maximum(between(INNER, NEAR), between(-NEAR, -INNER))
    expected = flanks * 4.0 / (NEAR - INNER)
    far = between(-FAR, FAR) - between(-INNER, INNER) + 1.0
    expected = np.maximum(expected, far * 4.0 / (2.0 * (FAR - INNER)))
    # The point in the middle is there anyway: how likely are the others?
    chance = poisson.logsf(inside - 2.0, expected)
    order = np.argsort(chance, kind="stable")
    groups: list[_Group] = []
    for k in order[chance[order] < np.log(CHANCE)].tolist():
        middle = float(ordered[k])
        if inside[k] >= FEWEST and all(abs(middle - g.middle) > 4.0 * width for g in groups):
            within = ordered[np.abs(ordered - middle) <= 2.0 * width]
            density = float(inside[k]) / (4.0 * width)
            groups.append(
                _Group(float(chance[k]), float(np.median(within)), width, density, len(within))
            )
    return groups


class _Mixture:
    """Heights about a surface: the surface, what is below and what is above it."""

    def __init__(self, design: FloatArray, heights: FloatArray, floor: float) -> None:
        self.design, self.heights, self.floor = design, heights, floor
        self.solution: FloatArray = np.zeros(design.shape[1])
        self.spread, self.reach = floor, floor
        self.weights = np.array([0.8, 0.1, 0.1])
        self.shares: FloatArray = np.zeros((len(heights), 3))
        #: Who is in the window; None while it moves.
        self.window: BoolArray | None = None

    def settled(self, start: float, width: float) -> _Mixture:
        """Return the mixture fitted from a start, window and all.

        Raises
        ------
        GeometryError
            If too few points are left, or those of a tilted surface lie on one line.
        """
        self.solution[0], self.spread = start, max(width, self.floor)
        self.reach = WINDOW * self.spread
        for _ in range(ROUNDS):
            before = np.array([*self.solution, self.spread, *self.weights])
            self.shares = self._shares(before)
            self._maximise()
            self.reach = WINDOW * self.spread
            moved = np.abs(np.array([*self.solution[:1], self.spread]) - before[[0, -4]])
            settled = np.abs(self.weights - before[-3:]).max() < 1e-7
            if settled and (moved <= max(1e-7 * self.spread, self.floor)).all():
                break
        self.shares = self._shares(np.array([*self.solution, self.spread, *self.weights]))
        return self

    def _densities(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the density of each part, 0 out of the window, and residuals in spreads."""
        count = self.design.shape[1]
        spread = values[count]
        u = (self.heights - self.design @ values[:count]) / spread
        parts = np.stack(
            [np.exp(-0.5 * u * u) / (spread * np.sqrt(2 * np.pi)), ndtr(-u) / self.reach,
             ndtr(u) / self.reach], axis=-1,
        )  # fmt: skip
        near = self.window if self.window is not None else np.abs(u) * spread <= self.reach
        return parts * near[:, None], u

    def _shares(self, values: FloatArray) -> FloatArray:
        """Return the probability that each point belongs to each part; 0 out of the window."""
        parts = self._densities(values)[0] * values[-3:]
        total = parts.sum(-1, keepdims=True)
        return np.divide(parts, total, out=np.zeros_like(parts), where=total > 0)

    def _maximise(self) -> None:
        """Take surface, spread and weights from the shares."""
        surface = self.shares[:, 0]
        solution, _ = _fit(self.design, self.heights, surface)
        residual = self.heights - self.design @ solution
        freedom = surface.sum() * max(1.0 - self.design.shape[1] / max(surface.sum(), 1e-9), 0.1)
        variance = float((surface * residual**2).sum()) / freedom
        self.solution, self.spread = solution, max(float(np.sqrt(variance)), self.floor)
        totals = self.shares.sum(axis=0)
        self.weights = totals / totals.sum()

    def sigmas(self) -> FloatArray:
        """Return the standard deviations of the surface's parameters.

        Sandwich of the estimating functions: their derivative and their scatter.
        """
        count = self.design.shape[1]
        free = [k for k in (1, 2) if self.weights[k] * self.shares.sum() > 0.5]
        at = np.array([*self.solution, self.spread, *self.weights])
        # A point that steps over the edge of the window would be no derivative.
        self.window = np.asarray(self.shares.sum(axis=1) > 0)

        def functions(step: FloatArray) -> FloatArray:
            values = at.copy()
            values[: count + 1] += step[: count + 1] * self.spread
            for k, change in zip(free, step[count + 1 :], strict=True):
                values[count + 1 + k] += change
                values[count + 1] -= change
            shares = self._shares(values)
            u = self._densities(values)[1]
            score = [shares[:, :1] * self.design * u[:, None], shares[:, :1] * (u * u - 1)[:, None]]
            score += [
                (shares[:, k] / values[count + 1 + k] - shares[:, 0] / values[count + 1])[:, None]
                for k in free
            ]
            return np.concatenate(score, axis=1)

        size = count + 1 + len(free)
        here = functions(np.zeros(size))
        steps = 1e-4 * np.eye(size)
        slope = np.column_stack(
            [(functions(d).sum(0) - functions(-d).sum(0)) / 2e-4 for d in steps]
        )
        turn = np.linalg.pinv(slope, rcond=1e-12)
        covariance = turn @ (here.T @ here) @ turn.T
        surface = float(self.shares[:, 0].sum())
        small = surface / max(surface - count, 1.0)
        sigma: FloatArray = self.spread * np.sqrt(np.diag(covariance)[:count] * small)
        return sigma


def _refuse_weak(design: FloatArray, used: BoolArray) -> None:
    """Refuse a surface that too few points show.

    Raises
    ------
    GeometryError
        Saying how many there are.
    """
    needed = max(FEWEST, design.shape[1] + 2)
    if used.sum() < needed:
        raise GeometryError(remark("bathymetry.few_agree", count=int(used.sum()), needed=needed))


def _fit(
    design: FloatArray, heights: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted least-squares solution and all residuals.

    Raises
    ------
    GeometryError
        If the points of a tilted surface lie on one line.
    """
    root = np.sqrt(weights)
    solution, _, rank, _ = np.linalg.lstsq(design * root[:, None], heights * root, rcond=1e-12)
    if rank < design.shape[1]:
        raise GeometryError(remark("bathymetry.ties_on_line"))
    return solution, heights - design @ solution
