"""The relief map made whole: strips behind steps, noise, what camera 2 cannot see, sigma."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import forward_projection
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, offsets
from bifocal.relief_maps.snapping import surroundings
from bifocal.relief_maps.tuning import EVIDENCE, MAP
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.shrinkage import shrink_noise


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
    known = np.isfinite(bands.r)
    wanted = cv2.medianBlur(known.astype(np.uint8), MAP.outline)
    _, label, stats, _ = cv2.connectedComponentsWithStats(wanted, connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA]
    if len(area) > 1:
        scrap = area < min(MAP.scrap, MAP.scrap_share * area[1:].max())
        scrap[0] = False
        if scrap.any():
            wanted[scrap[label]] = 0
    _, label, stats, _ = cv2.connectedComponentsWithStats(1 - wanted, connectivity=4)
    pinhole = stats[:, cv2.CC_STAT_AREA] < MAP.hole
    pinhole[0] = False
    if pinhole.any():
        wanted[pinhole[label]] = 1
    forward_projection.fill_small(bands, (wanted > 0) & ~known)
    lost = wanted == 0
    bands.r[lost] = bands.sigma[lost] = np.nan
    bands.quality[lost] = Quality.UNKNOWN
    return bands
