"""Height of the water from tie points, some on the surface, many on the bottom below it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.surfaces import Plane
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.errors import GeometryError, InputError

#: Fewest points that may be called a water surface.
FEWEST = 5
#: The surface may hold this share of the points of the largest group and still be the surface.
SMALLEST_SHARE = 0.1
#: Points beyond this many standard deviations do not belong to the surface.
REJECT = 3.0
#: Median absolute deviation to standard deviation of a normal distribution.
MAD_TO_SIGMA = 1.4826
#: Standard deviation of a normal distribution cut at `REJECT` sigma, over the uncut one.
CUT_SIGMA = 0.98658
ROUNDS = 50


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
    more tie points on the bottom. Groups are the maxima of the density of Z; of those that hold
    at least 5 points and a tenth of the largest group, the highest is taken. From its mode the
    mean is iterated, rejecting points beyond 3 sigma, until the choice no longer changes.

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
        raise InputError(
            f"points: {int(finite.sum())} tie points; at least {FEWEST} on the water surface are "
            "needed for a level with a standard deviation."
        )
    if spread is not None and not spread > 0:
        raise InputError(f"spread: must be above zero [m], got {spread}.")
    heights = xyz[finite, 2]
    start, width = _highest_group(heights, spread)
    centre = xyz[finite][np.abs(heights - start) <= REJECT * width, :2].mean(0)
    design = np.ones((len(xyz), 1))
    if tilted:
        design = np.column_stack([design, xyz[:, :2] - centre])
    used = finite & (np.abs(xyz[:, 2] - start) <= REJECT * width)
    floor = 1e-9 * max(1.0, float(np.abs(heights).max()))
    for _ in range(ROUNDS):
        solution, residual, single = _fit(design, xyz[:, 2], used)
        chosen = finite & (np.abs(residual) <= REJECT * max(single, floor))
        if (chosen == used).all():
            break
        used = chosen
    else:
        solution, residual, single = _fit(design, xyz[:, 2], used)
    cofactor = np.linalg.inv(design[used].T @ design[used])
    sigma = single * np.sqrt(np.diag(cofactor))
    slope = solution[1:] if tilted else np.zeros(2)
    at_origin = solution[0] - slope @ centre
    return WaterLevel(
        level=float(solution[0]),
        sigma=float(sigma[0]),
        spread=single,
        used=used,
        below=int((finite & ~used & (residual < 0)).sum()),
        above=int((finite & ~used & (residual > 0)).sum()),
        surface=Plane.tilted(float(at_origin), slope_x=float(slope[0]), slope_y=float(slope[1])),
        slope=slope,
        slope_sigma=sigma[1:] if tilted else np.zeros(2),
        centre=centre,
    )


def _highest_group(heights: FloatArray, spread: float | None) -> tuple[float, float]:
    """Return mode and standard deviation of the highest group that may be a surface."""
    ordered = np.sort(heights)
    extent = float(ordered[-1] - ordered[0])
    if extent == 0:
        return float(ordered[0]), 1e-9 * max(1.0, abs(float(ordered[0])))
    width = spread if spread is not None else _bandwidth(ordered)
    # Density of the heights on a fine grid, with a Gaussian of that width.
    cells = int(min(max(4 * extent / width, 64), 20_000))
    step = extent / cells
    counts, edges = np.histogram(ordered, bins=cells, range=(ordered[0], ordered[-1]))
    reach = np.arange(-4 * width, 4 * width + step, step)
    kernel = np.exp(-0.5 * (reach / width) ** 2)
    density = np.convolve(counts, kernel, mode="full")
    first = edges[0] + step / 2 + reach[0]
    place = first + step * np.arange(len(density))
    peaks = np.flatnonzero((density[1:-1] >= density[:-2]) & (density[1:-1] > density[2:])) + 1
    sizes = np.searchsorted(ordered, place[peaks] + 2 * width, side="right")
    sizes = sizes - np.searchsorted(ordered, place[peaks] - 2 * width, side="left")
    good = peaks[sizes >= max(FEWEST, SMALLEST_SHARE * sizes.max(initial=0))]
    if not good.size:
        raise GeometryError(
            f"points: no {FEWEST} tie points lie at about one height, so none of them shows the "
            "water surface. Add points on the surface, or give their expected spread."
        )
    mode = float(place[good[-1]])
    near = ordered[np.abs(ordered - mode) <= 2 * width]
    deviation = MAD_TO_SIGMA * float(np.median(np.abs(near - np.median(near))))
    return mode, max(deviation, width / 4)


def _bandwidth(ordered: FloatArray) -> float:
    """Return a width that resolves the tightest twentieth of the heights.

    The spread of all heights is that of the bottom; the shortest interval that holds a twentieth
    of the points (at least five) lies within one group. Too narrow does no harm: a piece of a
    normal distribution, cut at 3 sigma of its own again and again, grows into the whole.
    """
    count = max(FEWEST, len(ordered) // 20)
    if count >= len(ordered):
        return float(max(ordered[-1] - ordered[0], 1e-9)) / 2
    shortest = float((ordered[count - 1 :] - ordered[: len(ordered) - count + 1]).min())
    extent = float(ordered[-1] - ordered[0])
    # Heights rounded to the millimetre repeat; the rounding is then no spread of its own.
    gaps = np.diff(ordered)
    repeats = gaps <= 1e-9 * extent
    rounding = float(gaps[~repeats].min()) if repeats.sum() > len(ordered) // 10 else 0.0
    return min(max(2 * shortest, 2 * rounding, extent / 500), extent / 6)


def _fit(
    design: FloatArray, heights: FloatArray, used: BoolArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the least-squares solution of the used rows, all residuals, and one point's sigma.

    Raises
    ------
    GeometryError
        If too few points are left, or those of a tilted surface lie on one line.
    """
    needed = max(FEWEST, design.shape[1] + 2)
    if used.sum() < needed:
        raise GeometryError(
            f"points: only {int(used.sum())} tie points agree on one water surface; at least "
            f"{needed} are needed. Add points, or give their expected spread."
        )
    solution, _, rank, _ = np.linalg.lstsq(design[used], heights[used], rcond=1e-12)
    if rank < design.shape[1]:
        raise GeometryError(
            "points: the tie points on the water surface lie on one line, about which it may tilt "
            "at will. Add points beside the line, or fit a level surface (without --tilted)."
        )
    residual = heights - design @ solution
    variance = (residual[used] ** 2).sum() / (used.sum() - design.shape[1])
    # The residuals are cut at `REJECT` sigma.
    return solution, residual, float(np.sqrt(variance)) / CUT_SIGMA
