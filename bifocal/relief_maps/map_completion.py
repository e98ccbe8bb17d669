"""The relief map made whole: strips behind steps, noise, what camera 2 cannot see, sigma."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import evidence, forward_projection, levels, rims, smoothing, snapping
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, offsets
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.shrinkage import shrink_noise

#: Noise that is taken out of the map, of measured and of other relief, in parallax: what is smaller
#: casts shadows that are not there (94 % of the small holes of a church). More of the measured
#: takes detail (semireal church: 0.25 px 3.39 mm, 0.05 px 3.27 mm). [px]
NOISE, NOISE_UNMEASURED = 0.05, 2.0
#: Half windows on the map, where relief is final and casts shadows. [px]
MAP_WINDOWS = (2, 4)
#: Pixels this far inwards of what camera 2 cannot see are not called measured: raised parts come
#: out too fat. Three pixels took 0.2 % of the measured ones and no more wrong ones than one does,
#: since relief that falls away is told by itself (`surfaces`; façade 62, loggia 301). [px]
GUARD = 1
#: Share of a step within 5 x 5 px that is added to sigma: which side a pixel is on is uncertain.
SIGMA_OF_STEP = 0.25
#: The outline of what is known is that of most pixels in a window of this side. [px]
OUTLINE = 7
#: A piece of map with nothing around it goes if it has fewer pixels and is less than this share of
#: the largest piece; a hole of so few pixels is closed.
SCRAP, SCRAP_SHARE, HOLE = 4000, 0.05, 25


def complete(
    frame: Frame, bands: MapBands, grid: Grid, *, plain: bool = False, refined: bool = False
) -> MapBands:
    """Return the map with hidden strips filled, noise taken out and its precision stated.

    Parameters
    ----------
    frame : Frame
    bands : MapBands
        Map with holes.
    grid : Grid
        Of the map.
    plain : bool
        Walls without texture: relief is drawn to the levels around it. On texture sigma is up to
        three times too large, and drawing costs detail (semireal church: 3.39 to 3.55 mm).
    refined : bool
        Measured at twice the resolution of the frame: there is half the noise to take out.
    """
    # Holes outside what both photos see stay unknown.
    holes = ~np.isfinite(bands.r) & _cover(frame, grid)
    forward_projection.fill_from_behind(bands, holes, grid, frame.foot(1).nadir)
    forward_projection.fill_small(bands, holes)
    bands = bands._replace(r=smoothing.tidy_steps(bands.r))
    rims.draw_in(frame, bands, grid)
    per_pixel = _relief_per_pixel(frame, grid)
    quiet = np.where(
        bands.quality == Quality.MEASURED,
        np.minimum(bands.sigma, np.float32(NOISE / 2 if refined else NOISE) * per_pixel),
        np.minimum(bands.sigma, np.float32(NOISE_UNMEASURED) * per_pixel),
    )
    relief = shrink_noise(bands.r, quiet, MAP_WINDOWS)
    if plain:
        relief = levels.drawn_to_levels(relief, bands.sigma, bands.quality == Quality.MEASURED)
    bounds = _around(relief)
    relief = snapping.snapped(frame, relief, grid, bounds)
    bands = bands._replace(r=relief, sigma=_sigma_at_steps(bands, per_pixel, bounds))
    _guard(frame, bands, grid)
    forward_projection.forget_outside(bands, plain=plain)
    _tidy_outline(bands)
    return bands


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


def _around(relief: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return the greatest and the least known relief of 5 x 5 pixels."""
    known = np.isfinite(relief)
    square = np.ones((5, 5), np.uint8)
    high = cv2.dilate(np.where(known, relief, np.float32(-1e3)), square)
    low = cv2.erode(np.where(known, relief, np.float32(1e3)), square)
    return high, low


def _sigma_at_steps(
    bands: MapBands, per_pixel: Float32Array, bounds: tuple[Float32Array, Float32Array]
) -> Float32Array:
    """Return sigma with the doubt of which side of a step a pixel is on."""
    height = bounds[0] - bounds[1]
    step = np.where(height > per_pixel, np.float32(SIGMA_OF_STEP) * height, 0)
    return np.where(np.isfinite(bands.r), np.hypot(bands.sigma, step), np.float32(np.nan))


def _guard(frame: Frame, bands: MapBands, grid: Grid) -> None:
    """Call nothing measured that camera 2 cannot see, or hardly (in place)."""
    vague = ~(bands.sigma < evidence.SIGMA_SHARE * frame.distances[1])
    bands.quality[vague & (bands.quality == Quality.MEASURED)] = Quality.INTERPOLATED
    rays = frame.fields and frame.fields[1]
    hidden = forward_projection.hidden_on_map(bands.r, grid, frame.foot(2), rays)
    near = _spread_inwards(hidden, grid.pixel_of(frame.foot(2).nadir), GUARD)
    bands.quality[near & (bands.quality == Quality.MEASURED)] = Quality.HIDDEN


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


def _tidy_outline(bands: MapBands) -> None:
    """Round the outline of what is known, drop pieces that float, close pinholes (in place)."""
    known = np.isfinite(bands.r)
    wanted = cv2.medianBlur(known.astype(np.uint8), OUTLINE)
    _, label, stats, _ = cv2.connectedComponentsWithStats(wanted, connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA]
    if len(area) > 1:
        scrap = area < min(SCRAP, SCRAP_SHARE * area[1:].max())
        scrap[0] = False
        if scrap.any():
            wanted[scrap[label]] = 0
    _, label, stats, _ = cv2.connectedComponentsWithStats(1 - wanted, connectivity=4)
    pinhole = stats[:, cv2.CC_STAT_AREA] < HOLE
    pinhole[0] = False
    if pinhole.any():
        wanted[pinhole[label]] = 1
    forward_projection.fill_small(bands, (wanted > 0) & ~known)
    lost = wanted == 0
    bands.r[lost] = bands.sigma[lost] = np.nan
    bands.quality[lost] = Quality.UNKNOWN
