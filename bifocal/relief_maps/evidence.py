"""What is believed of a measurement: which pixels are validated, and how far the rest may stray."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np

from bifocal.model.image import local_contrast
from bifocal.relief_maps import edges
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.frame import Frame, offsets
from bifocal.relief_maps.tuning import EVIDENCE
from photocore.arrays import BoolArray, Float32Array


def validated(
    across: Float32Array, loop: Float32Array, sigma: Float32Array, distance: float
) -> BoolArray:
    """Return which pixels are measured: matched there and back, on the radius, precise enough."""
    valid = (np.abs(across) < EVIDENCE.across_limit) & (loop < EVIDENCE.loop_limit)
    return np.asarray(valid & (sigma < EVIDENCE.sigma_share * distance))


def supported(support: BoolArray) -> BoolArray:
    """Return the pixels to be believed that lie in 3 x 3 such ones: single ones are chance."""
    square = np.ones((3, 3), np.uint8)
    return np.asarray(cv2.morphologyEx(support.astype(np.uint8), cv2.MORPH_OPEN, square) > 0)


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
    slack = np.float32(EVIDENCE.slack * distance)
    coarse, fine = (_surroundings(relief, support, side) for side in reversed(EVIDENCE.blocks))
    factor = EVIDENCE.blocks[1] // EVIDENCE.blocks[0]
    rows, columns = fine.low.shape
    bounds = []
    for near, far in zip(fine, coarse, strict=True):
        wide = far.repeat(factor, 0)[:rows].repeat(factor, 1)[:, :columns]
        bounds.append(np.where(np.isfinite(near), near, wide))
    height, width = relief.shape
    low, high = (
        cv2.resize(
            band,
            (columns * EVIDENCE.blocks[0], rows * EVIDENCE.blocks[0]),
            interpolation=cv2.INTER_NEAREST,
        )[:height, :width]
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
    enough = known.sum((1, 3)) >= EVIDENCE.fewest
    low = np.where(known, values, np.inf).min((1, 3))
    high = np.where(known, values, -np.inf).max((1, 3))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    # OpenCV pads by what changes nothing; infinities stay where no block around says anything.
    return _Range(
        cv2.erode(np.where(enough, low, np.inf).astype(np.float32), disc),
        cv2.dilate(np.where(enough, high, -np.inf).astype(np.float32), disc),
    )


def with_pardoned(
    frame: Frame, matched: Measurement, sigma: Float32Array, misfit: Float32Array,
    measured: BoolArray, backing: BoolArray | None,
) -> BoolArray:  # fmt: skip
    """Return what is measured with pixels beside steps that fail on the way back only.

    The photos fit there. What half the resolution backs has too little texture to tell.
    """
    if backing is not None:
        return measured
    loop = matched.loop * np.float32(EVIDENCE.loop_limit / EVIDENCE.lost_loop)
    near = validated(matched.across, loop, sigma, frame.distances[1])
    fits = cv2.blur(misfit, (3, 3)) < EVIDENCE.pardon_misfit
    textured = local_contrast(frame.image1) > EVIDENCE.pardon_contrast
    return np.asarray(measured | (near & fits & textured))


def without_falling(
    frame: Frame, relief: Float32Array, misfit: Float32Array, typical: float, swept: BoolArray,
    measured: BoolArray,
) -> BoolArray:  # fmt: skip
    """Return what is measured but where relief falls outwards and the photos do not fit.

    What a sweep found has been asked how it fits.

    Camera 2 may see nothing there: half of the wrongly measured pixels lie in strips of two to four
    pixels that the map does not know to be hidden, for flow runs over the step as a slope. It is
    taken as a share of the slope of camera 2's rays, the steepest that camera 2 can see.
    """
    foot = frame.foot(2)
    quiet = cv2.GaussianBlur(cv2.medianBlur(relief, 5), (0, 0), 1.0)
    across = cv2.Sobel(quiet, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    down = cv2.Sobel(quiet, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    if not frame.pair.refracted:
        x, y = offsets(frame.grid.shape, frame.grid.pixel_of(foot.nadir))
        falls = -(across * x + down * y) / (np.float32(foot.distance) - relief)
    else:
        x, y = frame.slopes(2, *offsets(frame.grid.shape), relief)
        falls = across * x + down * y
    misfit = cv2.blur(misfit, (3, 3))
    doubted = falls * misfit * misfit > most_falling(frame, typical)
    return np.asarray(measured & (swept | ~doubted))


def most_falling(frame: Frame, typical: float = 0.0) -> float | Float32Array:
    """Return the limit of slope times misfit squared, `falls_away`. [grey levels²]

    It goes by what relief shifts a point between the photos to what it shifts it in photo 2, which
    is 1 - d2 / d1 for cameras before one another, and b / s2 for cameras beside each other.
    """
    d1, d2 = frame.distances
    share: Any = 1 - d2 / d1
    if frame.sideways:
        x, y = frame.from_centre()
        own_x, own_y = offsets(frame.grid.shape, frame.grid.pixel_of(frame.foot(2).nadir))
        own = np.maximum(np.sqrt(own_x * own_x + own_y * own_y), np.float32(1))
        share = np.minimum(np.float32(share) * np.sqrt(x * x + y * y) / own, np.float32(1))
    precise = edges.precision(typical)
    limit = EVIDENCE.falls_away * share**EVIDENCE.falls_power
    return precise * limit + (1 - precise) * EVIDENCE.falls_away_imprecise


def without_unpatched(
    relief: Float32Array, unpatched: Float32Array, sigma: Float32Array, measured: BoolArray
) -> BoolArray:
    """Return what is measured but where a plane patch lies far from the relief found there."""
    return np.asarray(measured & ~(np.abs(relief - unpatched) > EVIDENCE.off_patch * sigma))
