"""Walls are planes: imprecise relief drawn to the levels that prevail around it.

On half a metre of plain wall relief is measured hundreds of times, each time within its sigma of
the same few levels: the wall, a pilaster, a reveal. A pixel moves to the mean of what is measured
around it at about its own relief, weighted by precision, and never by more than its own sigma.
Where matching is precise nothing moves; on slopes the mean is the pixel's own relief.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from bifocal.model.relief_map import Quality
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.forward_projection import MapBands
from photocore.arrays import BoolArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelTuning:
    """Levels of plain walls."""

    #: Side of the blocks levels are counted in. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.51 / +0.21.
    block: int = 64
    #: Side of the surroundings, in blocks.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.07 / +0.24.
    surroundings: int = 3
    #: Height of a class of the count. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.05 / -0.15.
    class_height: float = 0.004
    #: Reach of the mean, as a share of sigma. [sigma]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.22 / -0.04.
    share: float = 0.8
    #: The reach is no more than this. [m]
    #: Evidence: plaster, façade 62: 6.4 to 4.9 mm of median error, 13.9 to 13.3 % beyond 3 cm;
    #: twice the reach takes the panel of a pilaster for the wall (16 %).
    farthest: float = 0.012
    #: Reaches the means are made for; relief more precise than half the first is left alone, and
    #: counts no more. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.99 / +0.00.
    reaches: tuple[float, float] = (0.005, 0.01)
    #: Relief beyond these percentiles is left out. [per cent]
    #: Evidence: benchmarks/relief_tuning.py, beyond 3 cm with half of it: plaster balcony +1.33
    #: points of per cent.
    tails: tuple[float, float] = (0.2, 99.8)


LEVELS = LevelTuning()


def of_plain_walls(bands: MapBands, matched: Measurement) -> MapBands:
    """Return a map whose relief is drawn to levels if the walls are plain.

    On texture sigma is up to three times too large, and drawing costs detail (semireal church: 3.39
    to 3.55 mm).
    """
    if not matched.plain:
        return bands
    drawn = drawn_to_levels(bands.r, bands.sigma, bands.quality == Quality.MEASURED)
    return bands._replace(r=drawn)


def drawn_to_levels(relief: Float32Array, sigma: Float32Array, measured: BoolArray) -> Float32Array:
    """Return relief drawn to the levels around it, as far as its sigma allows.

    Parameters
    ----------
    relief, sigma : ndarray of float32, shape (height, width)
        Relief map and its standard deviation; what is unknown (NaN) stays so. [m]
    measured : ndarray of bool
        Pixels that count.

    Notes
    -----
    A step of mean shift (Comaniciu and Meer 2002) in the weighted histogram of the surroundings.
    """
    if not measured.any():
        return relief
    low, high = (float(v) for v in np.percentile(relief[measured], LEVELS.tails))
    count = int((high - low) / LEVELS.class_height) + 2
    inside = np.isfinite(relief) & (relief > low) & (relief < high)
    place, shape = _blocks(relief.shape)
    weight, total = _count(relief, sigma, inside & measured, place, shape, (low, count))
    reach = np.minimum(np.float32(LEVELS.share) * sigma, np.float32(LEVELS.farthest))
    limits = (
        LEVELS.reaches[0] / np.sqrt(2),
        *(np.sqrt(a * b) for a, b in pairwise(LEVELS.reaches)),
        np.inf,
    )
    result = relief.copy()
    for width, (least, most) in zip(LEVELS.reaches, pairwise(limits), strict=True):
        chosen = inside & (reach >= least) & (reach < most)
        r = relief[chosen]
        cell = place[chosen] * count + ((r - low) / LEVELS.class_height).astype(np.int64)
        around, sums = (_spread(values, width).ravel()[cell] for values in (weight, total))
        mean = np.where(around > 0, sums / np.maximum(around, np.float32(1e-9)), r)
        move = np.clip(mean - r, -reach[chosen], reach[chosen])
        result[chosen] = r + move
    return result


def _blocks(shape: tuple[int, int]) -> tuple[IntArray, tuple[int, int]]:
    """Return the number of each pixel's block, and how many there are, down and across."""
    rows, columns = (-(-length // LEVELS.block) for length in shape)
    row, column = (np.arange(length) // LEVELS.block for length in shape)
    return row[:, None] * columns + column[None, :], (rows, columns)


def _count(
    relief: Float32Array,
    sigma: Float32Array,
    use: BoolArray,
    place: IntArray,
    shape: tuple[int, int],
    classes: tuple[float, int],
) -> tuple[Float32Array, Float32Array]:
    """Return weights and weighted relief by block and class, summed over the surroundings.

    Both of shape (blocks, classes).
    """
    low, count = classes
    r = relief[use]
    cell = place[use] * count + ((r - low) / LEVELS.class_height).astype(np.int64)
    share = 1 / np.maximum(sigma[use], np.float32(LEVELS.reaches[0] / 2)) ** 2
    # A full square: fewer blocks at the corners would draw a slope to the middle of its block.
    side = (LEVELS.surroundings, LEVELS.surroundings)

    def around(weights: FloatArray) -> Float32Array:
        sums = np.bincount(cell, weights, shape[0] * shape[1] * count).astype(np.float32)
        layers = np.ascontiguousarray(sums.reshape(-1, count).T).reshape(count, *shape)
        spread = [
            cv2.boxFilter(x, -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
            for x in layers
        ]
        return np.ascontiguousarray(np.stack(spread).reshape(count, -1).T)

    return around(share), around(share * r)


def _spread(values: Float32Array, reach: float) -> Float32Array:
    """Return the classes of every block blurred by a Gaussian of a reach in metres."""
    side = 2 * int(3 * reach / LEVELS.class_height) + 1
    bell = cv2.getGaussianKernel(side, reach / LEVELS.class_height).astype(np.float32)
    return np.asarray(cv2.sepFilter2D(values, -1, bell, np.ones(1, np.float32)))
