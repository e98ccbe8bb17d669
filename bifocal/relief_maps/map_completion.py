"""The relief map made whole: strips behind steps, noise, what camera 2 cannot see, sigma."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import forward_projection
from bifocal.relief_maps.evidence import EVIDENCE
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, offsets
from bifocal.relief_maps.snapping import surroundings
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.shrinkage import shrink_noise


@dataclass(frozen=True, slots=True, kw_only=True)
class MapTuning:
    """The map made whole."""

    #: Noise that is taken out of measured relief of the map, in parallax: what is smaller casts
    #: shadows that are not there. [px]
    #: Evidence: 94 % of the small holes of a church; semireal church: 3.27 mm, with 0.25 px 3.39
    #: mm.
    noise: float = 0.05
    #: The same of other relief. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / -0.00, plaster facade -0.01 / -0.00,
    #: church +0.01 / -0.02.
    noise_unmeasured: float = 2.0
    #: Half windows on the map, where relief is final and casts shadows. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.34 / +0.39, plaster facade -0.13 / +0.62,
    #: church -0.13 / +0.07.
    map_windows: tuple[int, int] = (2, 4)
    #: Pixels this far inwards of what camera 2 cannot see are not called measured: raised parts
    #: come out too fat. [px]
    #: Evidence: façade 62, loggia 301: three pixels took 0.2 % of the measured ones and no more
    #: wrong ones than one does.
    guard: int = 1
    #: Share of a step within `step_window` added to sigma: which side a pixel is on is uncertain.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / +0.00,
    #: church +0.00 / +0.00.
    sigma_of_step: float = 0.25
    #: Side of the square in which a step makes sigma doubtful: optical flow places one to half a
    #: patch. [px]
    #: Evidence: loggia 202 and 203 in plaster, 201 and 206 in stone, error/sigma of measured
    #: pixels: 5 px 1.51, 1.88, 0.80, 0.72; 7 px 1.02, 1.19, 0.62, 0.60; 9 px 0.92, 0.89, 0.55,
    #: 0.55; 11 px 0.89, 0.80, 0.53, 0.53.
    step_window: int = 9
    #: Side of the square in which a step that makes sigma too large makes a pixel not measured.
    #: [px]
    #: Evidence: The same scenes, measured [%] with 5 and 7 px: 56.7 and 56.3, 57.0 and 56.6, 93.9
    #: and 93.0, 93.7 and 92.9; called measured but hidden from photo 2: 4.1 and 4.0, 4.9 and 4.8,
    #: 3.3 and 3.1, 3.2 and 3.1.
    on_step: int = 5
    #: The outline of what is known is that of most pixels in a window of this side. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / -0.00.
    outline: int = 7
    #: A piece of map with nothing around it goes if it has fewer pixels, and by `scrap_share`. [px]
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    scrap: int = 4000
    #: Such a piece goes if it is less than this share of the largest one.
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    scrap_share: float = 0.05
    #: A hole of so few pixels is closed. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster facade +0.00 / +0.00.
    hole: int = 25


MAP = MapTuning()


def filled_from_behind(frame: Frame, bands: MapBands, grid: Grid) -> MapBands:
    """Fill strips that nobody sees with the surface behind the step (in place)."""
    holes = ~np.isfinite(bands.r) & _cover(frame, grid)
    forward_projection.fill_from_behind(bands, holes, grid, frame.foot(1).nadir)
    return bands


def filled(frame: Frame, bands: MapBands, grid: Grid) -> MapBands:
    """Fill other holes within what both photos see; those outside stay unknown (in place)."""
    holes = ~np.isfinite(bands.r) & _cover(frame, grid)
    forward_projection.fill_small(bands, holes)
    return bands


def without_noise(frame: Frame, bands: MapBands, grid: Grid, matched: Measurement) -> MapBands:
    """Return the map without noise, of which photos of twice the resolution leave half."""
    per_pixel = _relief_per_pixel(frame, grid)
    noise = np.where(
        bands.quality == Quality.MEASURED,
        np.float32(MAP.noise / 2 if matched.refined else MAP.noise),
        np.float32(MAP.noise_unmeasured),
    )
    quiet = np.minimum(bands.sigma, noise * per_pixel)
    return bands._replace(r=shrink_noise(bands.r, quiet, MAP.map_windows))


def _cover(frame: Frame, grid: Grid) -> BoolArray:
    """Return which pixels of the map both photos cover (taken at r = 0)."""
    both = (frame.seen1 & frame.seen2).astype(np.uint8)
    column, row = frame.grid.offset_in(grid)
    scale = frame.grid.gsd / grid.gsd
    matrix = np.array([[scale, 0, column], [0, scale, row]])
    return np.asarray(
        cv2.warpAffine(both, matrix, (grid.width, grid.height), flags=cv2.INTER_NEAREST) > 0
    )


def _relief_per_pixel(frame: Frame, grid: Grid) -> Float32Array:
    """Return the relief that shifts a point by one pixel between the photos: B / s. [m]"""
    x = (grid.columns_x - frame.zoom_centre[0]).astype(np.float32)[None, :]
    y = (grid.rows_y - frame.zoom_centre[1]).astype(np.float32)[:, None]
    reach = np.sqrt(x * x + y * y) / np.float32(frame.grid.gsd)
    return np.float32(frame.pair.base_factor) / np.maximum(reach, np.float32(0.5))


def with_sigma_of_steps(frame: Frame, bands: MapBands, grid: Grid) -> MapBands:
    """Return a map whose sigma knows the doubt of which side of a step a pixel is on."""
    return bands._replace(sigma=_sigma_at_steps(frame, bands, grid, MAP.step_window))


def _sigma_at_steps(frame: Frame, bands: MapBands, grid: Grid, side: int) -> Float32Array:
    """Return sigma with a share of the step within a square of pixels. [m]"""
    high, low = surroundings(bands.r, side)
    height = high - low
    step = np.where(
        height > _relief_per_pixel(frame, grid), np.float32(MAP.sigma_of_step) * height, 0
    )
    return np.where(np.isfinite(bands.r), np.hypot(bands.sigma, step), np.float32(np.nan))


def guarded(frame: Frame, bands: MapBands, grid: Grid) -> MapBands:
    """Call nothing measured that camera 2 cannot see, or hardly, or that is on a step, in place."""
    sigma = _sigma_at_steps(frame, bands, grid, MAP.on_step)
    vague = ~(sigma < EVIDENCE.sigma_share * frame.distances[1])
    bands.quality[vague & (bands.quality == Quality.MEASURED)] = Quality.INTERPOLATED
    rays = frame.fields and frame.fields[1]
    hidden = forward_projection.hidden_on_map(bands.r, grid, frame.foot(2), rays)
    near = _spread_inwards(hidden, grid.pixel_of(frame.foot(2).nadir), MAP.guard)
    bands.quality[near & (bands.quality == Quality.MEASURED)] = Quality.HIDDEN
    return bands


def _spread_inwards(mask: BoolArray, middle: FloatArray, reach: int) -> BoolArray:
    """Return a mask grown towards a point (column, row) by some pixels."""
    x, y = (np.asarray(axis) for axis in offsets(mask.shape, middle))
    outwards = 1 / np.maximum(np.sqrt(x * x + y * y), np.float32(1))
    flags = mask.astype(np.uint8)
    result = mask.copy()
    column, row = offsets(mask.shape)
    for step in range(1, reach + 1):
        maps = (column + step * x * outwards, row + step * y * outwards)
        result |= cv2.remap(flags, *maps, cv2.INTER_NEAREST) > 0
    return result


def tidied(bands: MapBands) -> MapBands:
    """Round the outline of what is known, drop pieces that float, close pinholes (in place)."""
    finite = np.isfinite(bands.r)
    smooth = cv2.medianBlur(finite.astype(np.uint8), MAP.outline)
    _, label, stats, _ = cv2.connectedComponentsWithStats(smooth, connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA]
    if len(area) > 1:
        scrap = area < min(MAP.scrap, MAP.scrap_share * area[1:].max())
        scrap[0] = False
        if scrap.any():
            smooth[scrap[label]] = 0
    _, label, stats, _ = cv2.connectedComponentsWithStats(1 - smooth, connectivity=4)
    pinhole = stats[:, cv2.CC_STAT_AREA] < MAP.hole
    pinhole[0] = False
    if pinhole.any():
        smooth[pinhole[label]] = 1
    forward_projection.fill_small(bands, (smooth > 0) & ~finite)
    lost = smooth == 0
    bands.r[lost] = bands.sigma[lost] = np.nan
    bands.quality[lost] = Quality.UNKNOWN
    return bands
