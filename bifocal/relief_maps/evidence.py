"""What is believed of a measurement: which pixels are validated, and how far the rest may stray."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from bifocal.model.image import local_contrast
from bifocal.relief_maps import edges
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.frame import Frame, offsets
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceTuning:
    """What is believed of a measurement."""

    #: Limit of a validated pixel across the radius. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.08 / +0.01, plaster facade +0.72 / +0.13,
    #: church +0.29 / -0.08.
    across_limit: float = 0.5
    #: Limit of a validated pixel there and back. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.89 / -0.17, plaster facade +1.19 / -0.80,
    #: church +3.07 / -0.57.
    loop_limit: float = 0.8
    #: A measured relief is known better than this share of d2.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.68 / +0.00, plaster facade +1.52 / -0.32,
    #: church +0.31 / -0.03.
    sigma_share: float = 0.01
    #: Sides of the blocks, fine and coarse, that a pixel's validated surroundings consist of. [px]
    #: Evidence: plaster, façade 12: blocks of 4 px clip relief that is right, 10.5 instead of 9.6 %
    #: beyond 3 cm.
    blocks: tuple[int, int] = (16, 64)
    #: A block with fewer supported pixels says nothing. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / -0.00, plaster facade +0.02 / +0.02,
    #: church +0.00 / -0.00.
    fewest: int = 6
    #: Share of d2 by which a pixel may leave the range of its surroundings.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.05 / +0.00, plaster facade +0.00 / +0.08,
    #: church +0.11 / -0.14.
    slack: float = 0.002
    #: Slope outwards, as a share of that of camera 2's rays, times the square of the misfit of the
    #: photos from which a pixel counts as not measured; such pixels are placed all the same. To be
    #: multiplied by a power of 1 - d2 / d1, the parallax of a step whose strip is one pixel wide:
    #: the less of it, the less misfit tells the strip. [grey levels²]
    #: Evidence: of 14 features of façade 61 and loggia 301 these two tell best; façade 81, left out
    #: 1.57 instead of 1.33 % of the orthophoto beyond 1 px.
    falls_away: float = 20.0
    #: That power.
    #: Evidence: at 95 % measured 35/19 bears 6.3 and 4.2 % false (façade 81), 35/28 2.0 and 4.8 %
    #: (façade 83).
    falls_power: float = 1.4
    #: The same where matching is imprecise, without the power. [grey levels²]
    #: Evidence: church_2 and church_1: measured 72 and 65 % of the points, as good as the 69 and 62
    #: % that `falls_away` leaves.
    falls_away_imprecise: float = 25.0
    #: Farther away is lost, not imprecise. A pixel that does not come back to itself is measured
    #: all the same if it lands no farther away: flow back runs as a ramp over every step, on its
    #: seen side, too. [px]
    #: Evidence: façade 81: 3.3 % failed by it alone, nine in ten of them right to a centimetre.
    lost_loop: float = 5.0
    #: Such a pixel is measured if the photos fit at it better than this. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.12 / -0.05, church +0.15 / -0.14.
    pardon_misfit: float = 6.0
    #: Such a pixel is measured if they have this contrast at it: in weaker texture anything fits.
    #: [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.01, church +0.00 / +0.01.
    pardon_contrast: float = 3.0
    #: A pixel of a plain wall whose own relief is so far off its plane patch is not measured: one
    #: of the two is wrong. [sigma]
    #: Evidence: façade 62: wrongly measured 8.7 to 7.6 %, measured beyond 3 cm 4.8 to 3.8 %.
    off_patch: float = 3.0


EVIDENCE = EvidenceTuning()


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
    bounded = ~support & (low <= high)
    held = np.minimum(np.maximum(relief, low - slack), high + slack)
    return np.where(bounded, held, relief)


def _surroundings(relief: Float32Array, support: BoolArray, side: int) -> _Range:
    """Return the range of supported relief in the blocks around every block."""
    height, width = relief.shape
    rows, columns = -(-height // side), -(-width // side)
    edge = ((0, rows * side - height), (0, columns * side - width))
    blocks = (rows, side, columns, side)
    inside = np.pad(support, edge).reshape(blocks)
    values = np.pad(relief, edge).reshape(blocks)
    enough = inside.sum((1, 3)) >= EVIDENCE.fewest
    low = np.where(inside, values, np.inf).min((1, 3))
    high = np.where(inside, values, -np.inf).max((1, 3))
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
        steepness = np.maximum(np.sqrt(own_x * own_x + own_y * own_y), np.float32(1))
        share = np.minimum(np.float32(share) * np.sqrt(x * x + y * y) / steepness, np.float32(1))
    precise = edges.precision(typical)
    limit = EVIDENCE.falls_away * share**EVIDENCE.falls_power
    return precise * limit + (1 - precise) * EVIDENCE.falls_away_imprecise


def without_unpatched(
    relief: Float32Array, unpatched: Float32Array, sigma: Float32Array, measured: BoolArray
) -> BoolArray:
    """Return what is measured but where a plane patch lies far from the relief found there."""
    return np.asarray(measured & ~(np.abs(relief - unpatched) > EVIDENCE.off_patch * sigma))
