"""Steps of the map drawn to the edges that photo 1 shows of them, to a fraction of a pixel.

Every pixel of the map takes the relief of one pixel of photo 1, so that a step lies up to half a
pixel off even where the surfaces are known exactly. Its edge in the picture is sharper than that:
the grey values beside a step, averaged along it, say where the one surface ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.relief_maps.forward_projection import MapBands, shown_by_first
from bifocal.relief_maps.frame import Frame, offsets, values_at
from bifocal.relief_maps.smoothing import SMOOTHING
from photocore.arrays import Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSnappingTuning:
    """Steps put on edges of photo 1."""

    #: How far a step is moved at most. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.12 / +0.13, plaster facade +0.03 / +0.12.
    reach: float = 2.0
    #: How finely it is moved. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / +0.11, plaster facade +0.00 / -0.02.
    fine: float = 0.5
    #: Across how much of it grey values are compared. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.19, plaster facade -0.02 / +0.06.
    across: float = 1.5
    #: Height from which a step of the map is tidied, and drawn to edges where it is steeper than 45
    #: degrees. [grey levels]
    #: Evidence: façades 81 / 83: of the pixels moved at fainter edges one half was right before.
    contrast: float = 20.0


SNAPPING = StepSnappingTuning()


class _Steps(NamedTuple):
    """Pixels of the map beside a step.

    Attributes
    ----------
    row, column : ndarray of int, shape (n,)
    across, down : ndarray of float32
        Unit vector towards the upper surface.
    place : ndarray of float32
        Distance from the step, positive on its upper side. [px]
    """

    row: IntArray
    column: IntArray
    across: Float32Array
    down: Float32Array
    place: Float32Array


def snapped(frame: Frame, bands: MapBands, grid: Grid) -> MapBands:
    """Return a map whose steps lie at the edges of photo 1 beside them.

    Parameters
    ----------
    frame : Frame
    bands : MapBands
    grid : Grid
        Of the map.
    """
    relief, bounds = bands.r, surroundings(bands.r)
    steps = _steps(relief, bounds, grid.pixel_of(frame.foot(1).nadir), grid.gsd)
    if not len(steps.row):
        return bands
    here = (steps.row, steps.column)
    upper, lower = (bound[here] for bound in bounds)
    shift, clear = _strongest(_contrast(frame, grid, steps, upper))
    above = steps.place > shift
    moved = clear & (above != (steps.place > 0))
    result = relief.copy()
    at = (steps.row[moved], steps.column[moved])
    result[at] = np.where(above, upper, lower)[moved]
    return bands._replace(r=result)


def surroundings(relief: Float32Array, side: int = 5) -> tuple[Float32Array, Float32Array]:
    """Return the greatest and the least known relief of a square: the surfaces of a step."""
    finite = np.isfinite(relief)
    square = np.ones((side, side), np.uint8)
    high = cv2.dilate(np.where(finite, relief, np.float32(-1e3)), square)
    low = cv2.erode(np.where(finite, relief, np.float32(1e3)), square)
    return high, low


def _steps(
    relief: Float32Array,
    bounds: tuple[Float32Array, Float32Array],
    nadir: FloatArray,
    gsd: float,
) -> _Steps:
    """Return the pixels beside steps that rise outwards.

    Where a step falls outwards photo 1 sees behind it, and flow has found it as well as its edge
    (façades 81 and 83: of pixels moved there as many were right before as after).
    """
    least = np.float32(max(SMOOTHING.least_step, 4 * gsd))
    quiet = cv2.GaussianBlur(relief, (0, 0), 1.0)
    row, column = np.nonzero(bounds[0] - bounds[1] > least)
    slopes = [cv2.Sobel(quiet, cv2.CV_32F, *way, ksize=3, scale=0.125) for way in ((1, 0), (0, 1))]
    across, down = (slope[row, column] for slope in slopes)
    steepness = np.sqrt(across * across + down * down) + np.float32(1e-9)
    middle = (bounds[0][row, column] + bounds[1][row, column]) / 2
    place = (quiet[row, column] - middle) / steepness
    x, y = (offset.ravel() for offset in offsets(relief.shape, nadir))
    with np.errstate(invalid="ignore"):
        near = (across * x[column] + down * y[row] > 0) & (np.abs(place) < SNAPPING.reach)
    across, down = across / steepness, down / steepness
    return _Steps(row[near], column[near], across[near], down[near], place[near])


def _contrast(frame: Frame, grid: Grid, steps: _Steps, upper: Float32Array) -> Float32Array:
    """Return how grey values rise across steps moved by -REACH to REACH, (shifts, n)."""
    image = frame.image1.astype(np.float32)
    nadir = grid.pixel_of(frame.foot(1).nadir).astype(np.float32)
    ways = np.stack([steps.across, steps.down], axis=-1)
    places = np.stack([steps.column, steps.row], axis=-1).astype(np.float32)
    start = places - nadir - steps.place[:, None] * ways
    ratio = np.float32(grid.gsd / frame.grid.gsd)
    first, beyond = (shown_by_first(frame, away * ratio, upper) for away in (start, start + ways))
    half, count = SNAPPING.across / 2, round(SNAPPING.across / SNAPPING.fine)
    shifts = np.arange(
        -SNAPPING.reach - half,
        SNAPPING.reach + half + SNAPPING.fine / 2,
        SNAPPING.fine,
        dtype=np.float32,
    )
    greys = np.stack(
        [values_at(image, first + t * (beyond - first), cv2.INTER_LINEAR) for t in shifts]
    )
    return np.abs(np.nan_to_num(greys[count:] - greys[:-count]))


def _strongest(contrast: Float32Array) -> tuple[Float32Array, FloatArray]:
    """Return the shift to the strongest edge [px], and where there is one within reach."""
    shifts = np.arange(len(contrast), dtype=np.float32) * np.float32(SNAPPING.fine) - np.float32(
        SNAPPING.reach
    )
    best = contrast.argmax(0)
    peak = np.take_along_axis(contrast, best[None], 0)[0]
    clear = (peak > SNAPPING.contrast) & (best > 0) & (best < len(contrast) - 1)
    inner = np.clip(best, 1, len(contrast) - 2)
    before, at, after = (np.take_along_axis(contrast, inner[None] + i, 0)[0] for i in (-1, 0, 1))
    bend = np.minimum(before - 2 * at + after, np.float32(-1e-6))
    vertex = np.clip((before - after) / (2 * bend), -0.5, 0.5)
    return shifts[inner] + np.float32(SNAPPING.fine) * vertex, clear
