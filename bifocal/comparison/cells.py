"""The difference of two relief maps, on pixels and coarser cells, and what is common to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from bifocal.comparison.tuning import CHANGE
from bifocal.model import Grid, Quality, ReliefMap
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.errors import LARGEST, InputError


def difference_of(before: ReliefMap, after: ReliefMap) -> tuple[ReliefMap, BoolArray, list[str]]:
    """Return after minus before on the coarser of both grids, where it is of two surfaces; remarks.

    Only what both have measured is known, and what is of one surface: where a column stands before
    a wall one date may have seen the column and the other, past it, the wall. Beside steps and on
    slopes half the relief's range among the neighbours joins the standard deviation: a pixel may
    belong to either side.

    Raises
    ------
    InputError
        If nothing is known in both.
    """
    for relief in (before, after):
        measured = relief.quality == Quality.MEASURED
        if (relief.sigma[measured] < 0).any() or (np.abs(relief.r[measured]) > LARGEST).any():
            raise InputError(remark("compare.no_relief"))
    base, finer = (before, after) if before.gsd >= after.gsd else (after, before)
    finer = on_grid(finer, base.grid)
    sign = 1 if base is before else -1
    r = sign * (finer.r.astype(np.float64) - base.r)
    variance = np.zeros(r.shape)
    for one in (base, finer):
        variance += one.sigma.astype(np.float64) ** 2 + _beside_steps(one) ** 2
    both = (base.quality == Quality.MEASURED) & (finer.quality == Quality.MEASURED)
    both &= np.isfinite(r) & np.isfinite(variance)
    if not both.any():
        raise InputError(remark("compare.nothing_in_common"))
    remarks: list[str] = []
    if not (np.nan_to_num(base.sigma[both]).any() and np.nan_to_num(finer.sigma[both]).any()):
        spread = max(1.4826 * float(np.median(np.abs(r[both]))), 1e-6)
        variance += spread**2
        remarks.append(remark("compare.no_sigma", sigma=1000 * spread))
    two = _two_surfaces(base, finer, np.sqrt(variance), both)
    both &= ~two
    if two.any():
        remarks.append(remark("compare.two_surfaces", area=float(two.sum()) * base.gsd**2))
    unknown = np.where(both, 0.0, np.nan)
    difference = ReliefMap(
        r=np.asarray(r + unknown, np.float32),
        sigma=np.asarray(np.sqrt(variance) + unknown, np.float32),
        quality=both * np.uint8(Quality.MEASURED), plane_from_pixel=base.plane_from_pixel,
    )  # fmt: skip
    return difference, two, remarks


def _two_surfaces(
    base: ReliefMap, second: ReliefMap, sigma: FloatArray, valid: BoolArray
) -> BoolArray:
    """Return where each map shows, nearby, the surface that the other one shows here.

    What really moved leaves its old surface in one map only.
    """
    gsd = base.gsd
    reach = round(CHANGE.beside / gsd)
    # Sigma beside a step is nearly the step's own half: the wall's usual one says what is noise.
    least = np.fmax(3 * sigma, CHANGE.apart * float(np.median(sigma[valid])))
    far = valid & (np.abs(second.r - base.r) > least)
    rows, columns = np.nonzero(far)
    if not reach or not len(rows):
        return np.zeros_like(valid)
    step = max(1, reach // 8)
    offsets = np.arange(-reach, reach + 1, step)
    met = np.zeros((2, len(rows)), np.int64)
    step_here = np.abs(second.r - base.r)[rows, columns]
    tolerance = np.fmax(3 * sigma[rows, columns], CHANGE.round * step_here)
    # What is interpolated beside a step is of one of its two surfaces, too.
    padded = [np.pad(one.r, reach, constant_values=np.nan) for one in (base, second)]
    for dy in offsets:
        for dx in offsets[np.hypot(offsets, dy) <= reach]:
            for k, here in enumerate((second, base)):
                shifted = padded[k][rows + reach + dy, columns + reach + dx]
                met[k] += np.abs(shifted - here.r[rows, columns]) <= tolerance
    two = np.zeros_like(valid)
    two[rows, columns] = (met >= CHANGE.met * len(offsets) ** 2).all(axis=0)
    return two


def on_grid(relief: ReliefMap, grid: Grid) -> ReliefMap:
    """Return a map at the pixels of a grid; relief and sigma between them bilinear."""
    if relief.shape == grid.shape and relief.grid.whole_offset_in(grid) == (0, 0):
        return relief
    places = np.stack(np.meshgrid(grid.columns_x, grid.rows_y), axis=-1)
    return ReliefMap(
        r=relief.sample(places), sigma=replace(relief, r=relief.sigma).sample(places),
        quality=relief.sample_quality(places), plane_from_pixel=grid.plane_from_pixel,
    )  # fmt: skip


def _beside_steps(relief: ReliefMap) -> FloatArray:
    """Return half of what the relief varies among eight neighbours beyond its noise. [m]"""
    finite, square = np.isfinite(relief.r), np.ones((3, 3), np.uint8)
    high = cv2.dilate(np.where(finite, relief.r, np.float32(-np.inf)), square)
    low = cv2.erode(np.where(finite, relief.r, np.float32(np.inf)), square)
    with np.errstate(invalid="ignore"):
        beyond = high.astype(np.float64) - low - 5 * relief.sigma
    return np.asarray(np.where(finite, np.maximum(beyond, 0.0) / 2, np.nan))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """The difference on coarser cells, quick enough to draw a hundred walls of."""

    grid: Grid
    known: BoolArray
    difference: FloatArray
    sigma: FloatArray
    z: FloatArray
    least: float

    @classmethod
    def of(cls, difference: ReliefMap, side: int) -> Cells:
        """Return averages of cells of so many pixels a side; known where half of them are."""
        grid = difference.grid
        rows, columns = (-(-length // side) for length in grid.shape)
        below, right = rows * side - grid.height, columns * side - grid.width

        def averaged(field: Any) -> FloatArray:
            filled = cv2.copyMakeBorder(
                np.where(measured, field, 0.0), 0, below, 0, right, cv2.BORDER_CONSTANT, value=0.0
            )
            small = cv2.resize(filled, (columns, rows), interpolation=cv2.INTER_AREA)
            return np.asarray(small, np.float64)

        measured = difference.quality == Quality.MEASURED
        share = averaged(1.0)
        covered = share >= 0.5
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.clip(difference.r / difference.sigma, -CHANGE.clip, CHANGE.clip)
            parts = [
                np.where(covered, averaged(part) / share, 0.0)
                for part in (difference.r, difference.sigma, z)
            ]
        squared = float(np.mean(z[measured] ** 2))
        half = (side - 1) / 2 * grid.gsd
        coarse = Grid(
            x0=grid.x0 + half, y0=grid.y0 - half, gsd=grid.gsd * side, width=columns, height=rows
        )
        return cls(
            grid=coarse, known=covered, difference=parts[0], sigma=parts[1], z=parts[2],
            least=1 / min(1.0, max(squared, 0.05)),
        )  # fmt: skip


def trend_terms(grid: Grid, bounds: Sequence[float]) -> FloatArray:
    """Return 1, X and Y counted from the middle of bounds, shape (height, width, 3). [m]"""
    xmin, ymin, xmax, ymax = bounds
    x, y = np.meshgrid(grid.columns_x - (xmin + xmax) / 2, grid.rows_y - (ymin + ymax) / 2)
    return np.stack([np.ones_like(x), x, y], axis=-1)


def inside(polygons: Sequence[ArrayLike], grid: Grid) -> BoolArray:
    """Return which pixels of a grid lie in any of some polygons (X, Y). [m]"""
    mask = np.zeros(grid.shape, np.uint8)
    for polygon in polygons:
        pixels = grid.pixel_of(as_points(polygon, "stable", dimension=2))
        cv2.fillPoly(mask, [np.rint(np.clip(pixels, -1e6, 1e6)).astype(np.int32)], 1)
    return mask > 0


def trend_of(cells: Cells, still: BoolArray, correlated: float) -> tuple[FloatArray, FloatArray]:
    """Return offset and slopes of the difference where a wall stood still, and their covariance.

    Parameters
    ----------
    cells : Cells
    still : ndarray of bool
        Where; a part of it may have moved: what lies far off counts less (Cauchy weights).
    correlated : float
        Cells that err as one.

    Raises
    ------
    InputError
        If it is too little.
    """
    from scipy.optimize import least_squares

    if int(still.sum()) < CHANGE.least * max(correlated, 1.0):
        raise InputError(
            remark("compare.little_stable", area=float(still.sum()) * cells.grid.gsd**2)
        )
    sigma = np.maximum(cells.sigma[still], 1e-9)
    design = trend_terms(cells.grid, cells.grid.bounds)[still] / sigma[:, None]
    observed = cells.difference[still] / sigma
    start = np.array([np.median(cells.difference[still]), 0.0, 0.0])
    done = least_squares(
        lambda x: design @ x - observed, start, jac=lambda _: design, loss="cauchy",
        x_scale="jac",
    )  # fmt: skip
    residuals = observed - design @ done.x
    weighted = design / np.sqrt(1 + residuals**2)[:, None]
    covariance = np.linalg.pinv(weighted.T @ weighted) * max(correlated, 1.0)
    return np.asarray(done.x), np.asarray(covariance)


def without_trend(
    difference: ReliefMap, bounds: Sequence[float], trend: FloatArray, covariance: FloatArray
) -> ReliefMap:
    """Return a difference less a trend, whose uncertainty joins its standard deviation."""
    terms = trend_terms(difference.grid, bounds)
    variance = np.einsum("...i,ij,...j", terms, covariance, terms)
    sigma = np.sqrt(difference.sigma.astype(np.float64) ** 2 + variance)
    r = np.asarray(difference.r - terms @ trend, np.float32)
    return replace(difference, r=r, sigma=np.asarray(sigma, np.float32))
