"""What is believed of a measurement: which pixels are validated, and how far the rest may stray."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from photocore.arrays import BoolArray, Float32Array

#: Limits of a validated pixel: across the radius and there and back. [px]
ACROSS_LIMIT, LOOP_LIMIT = 0.5, 0.8
#: A measured relief is known better than this share of d2.
SIGMA_SHARE = 0.01
#: Sides of the blocks, fine and coarse, that a pixel's validated surroundings consist of; blocks of
#: 4 px clip relief that is right (plaster, façade 12: 10.5 instead of 9.6 % beyond 3 cm). [px]
BLOCKS = (16, 64)
#: A block with fewer supported pixels says nothing.
FEWEST = 6
#: Share of d2 by which a pixel may leave the range of its surroundings.
SLACK = 0.002


def validated(
    across: Float32Array, loop: Float32Array, sigma: Float32Array, distance: float
) -> BoolArray:
    """Return which pixels are measured: matched there and back, on the radius, precise enough."""
    valid = (np.abs(across) < ACROSS_LIMIT) & (loop < LOOP_LIMIT)
    return np.asarray(valid & (sigma < SIGMA_SHARE * distance))


def supported(valid: BoolArray) -> BoolArray:
    """Return the validated pixels that lie in 3 x 3 validated ones: single ones are chance."""
    square = np.ones((3, 3), np.uint8)
    return np.asarray(cv2.morphologyEx(valid.astype(np.uint8), cv2.MORPH_OPEN, square) > 0)


class _Range(NamedTuple):
    """Least and greatest supported relief of blocks, infinite the wrong way where none is."""

    low: Float32Array
    high: Float32Array


def held_back(relief: Float32Array, support: BoolArray, distance: float) -> Float32Array:
    """Return relief whose unsupported pixels lie between what is supported around them.

    Parameters
    ----------
    relief : ndarray of float32, shape (height, width)
        Measured relief. [m]
    support : ndarray of bool
        Pixels to be believed; they are left alone.
    distance : float
        d2. [m]

    Notes
    -----
    What is nearer than any validated thing around it has been seen by nobody: a mismatch. Held
    back rather than taken out it leaves no hole, and beside a step it still is on one side.
    """
    slack = np.float32(SLACK * distance)
    coarse, fine = (_surroundings(relief, support, side) for side in reversed(BLOCKS))
    factor = BLOCKS[1] // BLOCKS[0]
    rows, columns = fine.low.shape
    bounds = []
    for near, far in zip(fine, coarse, strict=True):
        wide = far.repeat(factor, 0)[:rows].repeat(factor, 1)[:, :columns]
        bounds.append(np.where(np.isfinite(near), near, wide))
    height, width = relief.shape
    low, high = (
        cv2.resize(band, (columns * BLOCKS[0], rows * BLOCKS[0]), interpolation=cv2.INTER_NEAREST)[
            :height, :width
        ]
        for band in bounds
    )
    known = ~support & (low <= high)
    held = np.minimum(np.maximum(relief, low - slack), high + slack)
    return np.where(known, held, relief)


def _surroundings(relief: Float32Array, support: BoolArray, side: int) -> _Range:
    """Return the range of supported relief in the blocks around every block."""
    height, width = relief.shape
    rows, columns = -(-height // side), -(-width // side)
    edge = ((0, rows * side - height), (0, columns * side - width))
    blocks = (rows, side, columns, side)
    known = np.pad(support, edge).reshape(blocks)
    values = np.pad(relief, edge).reshape(blocks)
    enough = known.sum((1, 3)) >= FEWEST
    low = np.where(known, values, np.inf).min((1, 3))
    high = np.where(known, values, -np.inf).max((1, 3))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    # OpenCV pads by what changes nothing; infinities stay where no block around says anything.
    return _Range(
        cv2.erode(np.where(enough, low, np.inf).astype(np.float32), disc),
        cv2.dilate(np.where(enough, high, -np.inf).astype(np.float32), disc),
    )
