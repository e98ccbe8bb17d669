"""What is believed of a measurement: which pixels are validated, and how far the rest may stray."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model.image import local_contrast
from bifocal.relief_maps import edges
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.frame import Frame, offsets
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
#: Slope outwards, as a share of that of camera 2's rays, times the square of the misfit of the
#: photos [grey levels²] from which a pixel counts as not measured: of 14 features of façade 61 and
#: loggia 301 these two tell best. Such pixels are not called measured, but placed all the same:
#: left out, 1.57 instead of 1.33 % of the orthophoto were beyond 1 px (81). Where matching is
#: imprecise the second: measured 72 and 65 % of the points of church_2 and church_1, as good as the
#: 69 and 62 % that the first leaves. The first is to be multiplied by a power of 1 - d2 / d1, the
#: parallax of a step whose strip is one pixel wide: the less of it, the less misfit tells the strip
#: (at 95 % measured 35/19 bears 6.3 and 4.2 % false, façade 81, 35/28 2.0 and 4.8 %, façade 83).
FALLS_AWAY, FALLS_POWER, FALLS_AWAY_IMPRECISE = 20.0, 1.4, 25.0
#: A pixel that does not come back to itself is measured all the same if it lands no farther away
#: than this [px], and the photos fit at it better than this, and have this contrast [grey levels].
#: Flow back runs as a ramp over every step, on its seen side, too: 3.3 % of façade 81 failed by it
#: alone, nine in ten of them right to a centimetre. In weaker texture anything fits.
PARDON_LOOP, PARDON_MISFIT, PARDON_CONTRAST = 5.0, 6.0, 3.0
#: A pixel of a plain wall whose own relief is so many sigmas off its plane patch is not measured:
#: one of the two is wrong (façade 62: wrongly measured 8.7 to 7.6 %, measured beyond 3 cm 4.8 to
#: 3.8 %).
OFF_PATCH = 3.0


def validated(
    across: Float32Array, loop: Float32Array, sigma: Float32Array, distance: float
) -> BoolArray:
    """Return which pixels are measured: matched there and back, on the radius, precise enough."""
    valid = (np.abs(across) < ACROSS_LIMIT) & (loop < LOOP_LIMIT)
    return np.asarray(valid & (sigma < SIGMA_SHARE * distance))


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


def with_pardoned(
    frame: Frame, matched: Measurement, sigma: Float32Array, misfit: Float32Array,
    measured: BoolArray, backing: BoolArray | None,
) -> BoolArray:  # fmt: skip
    """Return what is measured with pixels beside steps that fail on the way back only.

    The photos fit there. What half the resolution backs has too little texture to tell.
    """
    if backing is not None:
        return measured
    loop = matched.loop * np.float32(LOOP_LIMIT / PARDON_LOOP)
    near = validated(matched.across, loop, sigma, frame.distances[1])
    fits = cv2.blur(misfit, (3, 3)) < PARDON_MISFIT
    textured = local_contrast(frame.image1) > PARDON_CONTRAST
    return np.asarray(measured | (near & fits & textured))


def without_falling(
    frame: Frame, relief: Float32Array, misfit: Float32Array, typical: float, measured: BoolArray
) -> BoolArray:
    """Return what is measured but where relief falls outwards and the photos do not fit.

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
    return np.asarray(measured & ~(falls * misfit * misfit > most_falling(frame, typical)))


def most_falling(frame: Frame, typical: float = 0.0) -> float:
    """Return the limit of slope times misfit squared, `FALLS_AWAY`. [grey levels²]"""
    d1, d2 = frame.distances
    precise = edges.precision(typical)
    limit = FALLS_AWAY * (1 - d2 / d1) ** FALLS_POWER
    return float(precise * limit + (1 - precise) * FALLS_AWAY_IMPRECISE)


def without_unpatched(
    relief: Float32Array, unpatched: Float32Array, sigma: Float32Array, measured: BoolArray
) -> BoolArray:
    """Return what is measured but where a plane patch lies far from the relief found there."""
    return np.asarray(measured & ~(np.abs(relief - unpatched) > OFF_PATCH * sigma))
