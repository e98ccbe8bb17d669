"""What both photos tell of relief: their noise, and the texture that they share.

The noise is that of the registered pair, and texture counts only as far as both photos show it
alike: neither photo's noise, nor the dirt of JPEG, is taken for information.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import flow, forward_projection
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, radial_stretch, values_at, zoom_map
from bifocal.relief_maps.tuning import INFORMATION
from photocore.arrays import BoolArray, Float32Array


class Information(NamedTuple):
    """What the photos tell at the pixels of photo 1.

    Attributes
    ----------
    sigma_px : ndarray of float32
        Of matching along the radius, by noise and the texture that both photos share. [px]
    agreement : ndarray of float32
        Correlation of both photos' radial gradients.
    """

    sigma_px: Float32Array
    agreement: Float32Array


def information(frame: Frame, relief: Float32Array, matched: BoolArray) -> Information:
    """Return what the photos tell at a relief [m]; ``matched`` says where they show one thing.

    With radial gradients g1, g2 the normal equation of a shift along the radius has the weight
    S12 = sum g1 g2 over a window, so that sigma = s_e / sqrt(S12).
    """
    places = zoom_map(frame, relief)
    laid = cv2.remap(
        frame.image2, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(np.float32)
    first = frame.image1.astype(np.float32)
    x, y = frame.from_centre()
    radius = np.maximum(np.hypot(x, y), np.float32(1))
    slopes = []
    for image in (first, laid):
        quiet = cv2.GaussianBlur(image, (0, 0), INFORMATION.blur)
        across, down = (
            cv2.Sobel(quiet, cv2.CV_32F, *order, ksize=3, scale=0.125) for order in ((1, 0), (0, 1))
        )
        slopes.append((across * x + down * y) / radius)
    n = INFORMATION.window
    one, two, both = (cv2.blur(slopes[i] * slopes[j], (n, n)) for i, j in ((0, 0), (1, 1), (0, 1)))
    least = np.float32(1e-4)
    return Information(
        _noise(first - laid, matched) / np.sqrt(np.maximum(both, least)) / n,
        both / np.sqrt(np.maximum(one * two, least * least)),
    )


def measured_by_texture(
    frame: Frame, source: MapBands, valid: BoolArray, bands: MapBands, grid: Grid
) -> MapBands:
    """Return the map whose measured pixels are those that both photos tell precisely.

    Stages build on more: what is smooth between edges is believed, but not measured. Sigma of what
    is measured has its share of the noise.
    """
    told = information(frame, source.r, valid)
    places = forward_projection.seen_by_first(frame, grid, np.nan_to_num(bands.r))
    sigma_px = np.minimum(told.sigma_px, np.float32(INFORMATION.precise)) * radial_stretch(frame)
    noise = values_at(
        flow.sigma_of_relief(frame, source.r, sigma_px), places, cv2.INTER_NEAREST
    )
    enough = (told.sigma_px < INFORMATION.precise) & (told.agreement > INFORMATION.agreement)
    told_here = values_at(enough.view(np.uint8), places, cv2.INTER_NEAREST) > 0
    measured = bands.quality == Quality.MEASURED
    return bands._replace(
        sigma=np.where(measured & told_here, np.hypot(bands.sigma, noise), bands.sigma),
        quality=np.where(measured & ~told_here, np.uint8(Quality.INTERPOLATED), bands.quality),
    )


def _noise(apart: Float32Array, matched: BoolArray) -> Float32Array:
    """Return the robust deviation of a difference in tiles, interpolated. [grey levels]"""
    fine, side = np.abs(apart - cv2.blur(apart, (5, 5))), INFORMATION.tile
    tiles = np.full([-(-length // side) for length in apart.shape], np.nan, np.float32)
    for i, j in np.ndindex(tiles.shape):
        box = np.s_[i * side : (i + 1) * side : 2, j * side : (j + 1) * side : 2]
        values = fine[box][matched[box]]
        if len(values) > INFORMATION.fewest:
            tiles[i, j] = 1.4826 * np.median(values)
    known = np.isfinite(tiles)
    tiles[~known] = np.median(tiles[known]) if known.any() else np.median(1.4826 * fine)
    tiles = np.maximum(tiles, np.float32(INFORMATION.least_noise))
    if min(tiles.shape) > 2:
        tiles = cv2.medianBlur(tiles, 3)
    return np.asarray(cv2.resize(tiles, apart.shape[::-1], interpolation=cv2.INTER_LINEAR))
