"""What the orientation's own uncertainty does to a relief map, where the pair file states it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.pair import Pair
from photocore.arrays import Float32Array, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SigmaTuning:
    """Sigma of orientation."""

    #: Cells of the map in either direction between which the covariance is interpolated: it is a
    #: polynomial of low degree.
    #: Evidence: a pair tilted by 20 degrees: exact to 0.1 %.
    nodes: int = 24


SIGMA = SigmaTuning()


def orientation_sigma(pair: Pair, relief: Float32Array, grid: Grid) -> Float32Array:
    """Return the standard deviation of relief that comes from the orientation, cell by cell. [m]

    Parameters
    ----------
    pair : Pair
        Its ``orientation`` is the covariance that `bifocal align` wrote; zero without it.
    relief : ndarray, shape (h, w)
        [m]
    grid : Grid
        Of the map.

    Notes
    -----
    At a place of the plane the variance is nearly quadratic in relief; it is found at three reliefs
    on a coarse net and interpolated. These errors are common to the whole map: a profile or an area
    does not average them out.
    """
    if pair.whole_orientation is None:
        return np.zeros(relief.shape, dtype=np.float32)
    import cv2

    height, width = relief.shape
    columns = np.linspace(0, width - 1, min(SIGMA.nodes, width))
    rows = np.linspace(0, height - 1, min(SIGMA.nodes, height))
    x, y = grid.columns_x[np.rint(columns).astype(int)], grid.rows_y[np.rint(rows).astype(int)]
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    finite = relief[np.isfinite(relief)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    middle, half = (low + high) / 2, max((high - low) / 2, 1e-3 * pair.d2)
    low_, mid_, high_ = (
        _variance(pair, places, level).reshape(len(rows), len(columns))
        for level in (middle - half, middle, middle + half)
    )
    at = np.clip((relief - middle) / half, -1.0, 1.0)
    terms = (mid_, (high_ - low_) / 2, (high_ + low_) / 2 - mid_)
    across, down = np.meshgrid(
        np.interp(np.arange(width), columns, np.arange(len(columns))).astype(np.float32),
        np.interp(np.arange(height), rows, np.arange(len(rows))).astype(np.float32),
    )
    constant, linear, square = (
        cv2.remap(term.astype(np.float32), across, down, cv2.INTER_LINEAR) for term in terms
    )
    variance = constant + at * (linear + at * square)
    return np.sqrt(np.maximum(variance, 0.0)).astype(np.float32)


def _variance(pair: Pair, places: FloatArray, relief: float) -> FloatArray:
    """Return the variance of relief at places of one relief; the greatest where none is. [m²]"""
    xyz = np.column_stack([places, np.full(len(places), relief)])
    variance = pair.covariance_of_orientation(xyz)[:, 2, 2]
    return np.nan_to_num(variance, nan=float(np.nanmax(variance, initial=0.0)))
