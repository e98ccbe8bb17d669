"""Cells that moved sideways, brought back onto the grid."""

from __future__ import annotations

import numpy as np

from photocore.arrays import FloatArray

#: Steps of the fixed point; the shift of neighbouring cells differs by a few per cent of a cell.
STEPS = 6


def pull_back(values: FloatArray, move: FloatArray) -> FloatArray:
    """Return values on the grid after every cell has moved.

    Parameters
    ----------
    values : ndarray, shape (k, rows, columns)
        Layers, at the cells before they moved.
    move : ndarray, shape (rows, columns, 2)
        Movement of each cell by (column, row); NaN where the cell is unknown.

    Returns
    -------
    pulled : ndarray, shape (k, rows, columns)
        For each cell q the value at the place a that moved there, a + move(a) = q, bilinear. A
        cell whose source lies beside unknown cells keeps its own value; unknown cells stay NaN.

    Examples
    --------
    A ramp whose cells all move half a cell to the right:

    >>> ramp = np.tile(np.arange(5.0), (3, 1))
    >>> move = np.tile([0.5, 0.0], (3, 5, 1))
    >>> print(pull_back(ramp[None], move)[0, 1])
    [0.  0.5 1.5 2.5 3.5]
    """
    rows, columns = move.shape[:2]
    home = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(np.float64)
    known = np.asarray(np.isfinite(move).all(axis=-1))
    if not np.nan_to_num(move).any():
        return values
    place = home.copy()
    for _ in range(STEPS):
        shift = bilinear(np.moveaxis(move, -1, 0), place)
        source = home - np.moveaxis(shift, 0, -1)
        inside = np.asarray(np.isfinite(source).all(axis=-1))
        place = np.where(inside[..., None], source, place)
    pulled = bilinear(values, place)
    return np.where(np.isfinite(pulled), pulled, np.where(known, values, np.nan))


def bilinear(layers: FloatArray, place: FloatArray) -> FloatArray:
    """Return layers (k, rows, columns) at places (..., 2) of (column, row); NaN outside."""
    rows, columns = layers.shape[1:]
    column, row = place[..., 0], place[..., 1]
    inside = (column >= 0) & (column <= columns - 1) & (row >= 0) & (row <= rows - 1)
    c0 = np.clip(np.floor(column), 0, max(columns - 2, 0)).astype(np.int64)
    r0 = np.clip(np.floor(row), 0, max(rows - 2, 0)).astype(np.int64)
    u, v = column - c0, row - r0
    total = np.zeros((len(layers), *place.shape[:-1]))
    for dr, weight_r in ((0, 1 - v), (1, v)):
        for dc, weight_c in ((0, 1 - u), (1, u)):
            part = layers[:, np.minimum(r0 + dr, rows - 1), np.minimum(c0 + dc, columns - 1)]
            weight = weight_r * weight_c
            # An unknown neighbour without weight does no harm.
            total += np.where(weight == 0, 0.0, weight * part)
    return np.where(inside, total, np.nan)
