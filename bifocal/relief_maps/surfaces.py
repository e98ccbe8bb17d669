"""From flow to surfaces: relief, sigma and quality of the pixels of photo 1."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.image import local_contrast
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import (
    edges,
    evidence,
    facets,
    flow,
    forward_projection,
    lost_regions,
    seed,
)
from bifocal.relief_maps.forward_projection import STRETCH, MapBands
from bifocal.relief_maps.frame import Frame, offsets
from photocore.arrays import BoolArray, Float32Array
from photocore.shrinkage import WINDOWS, shrink_noise

#: Error across the radius that counts as noise rather than as an edge, for smoothing: what is
#: typical of the frame, and more near the zoom centre, where noise is all there is; within limits.
#: A fixed 0.25 px took small steps for noise (façade 83, 35/28: 2.44 to 2.15 % beyond 3 cm; less
#: near the centre than 20 px²/distance left noise: loggia 201). [px², px]
NOISE_AT_CENTRE, NOISE_CLIP = 20.0, (0.05, 0.25)
#: Share of the error across the radius that smoothing takes for noise where matching is precise:
#: the rest stems from edges within its window, or is wider than the windows (façade 83, 35/28,
#: beyond 3 cm: 1.93 to 1.89 %, loggia 94 1.19 to 1.15; 35/19 as before). Of imprecise matching it
#: is all (façade 84, poor texture: 13.3 %, with 0.7 13.5).
NOISE_SHARE = 0.85
#: Half windows of relief that photos of twice the resolution refined: those of their pixels (façade
#: 83, fast, beyond 3 cm: 4.1 to 3.8 %). [px]
REFINED_WINDOWS = (4, 9)
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
#: How much higher what covers a pixel in photo 2 must be: parallax [px] and share of d2. Supported
#: relief covers all, any relief only what is not validated.
COVERS, COVERS_UNVALIDATED = (0.7, 0.0005), (1.5, 0.002)

#: A pixel of a plain wall whose own relief is so many sigmas off its facet is not measured: one of
#: the two is wrong (façade 62: wrongly measured 8.7 to 7.6 %, measured beyond 3 cm 4.8 to 3.8 %).
OFF_FACET = 3.0


def surfaces(
    frame: Frame, matched: flow.Measurement, relief_range: tuple[float, float] | None,
    backing: BoolArray | None = None, half: Frame | None = None,
) -> tuple[MapBands, BoolArray]:  # fmt: skip
    """Return relief, sigma and quality of the pixels of photo 1, and which of them to use.

    Parameters
    ----------
    frame : Frame
    matched : Measurement
        Flow between the photos.
    relief_range : tuple of float, optional
        Least and greatest relief to expect. [m]
    backing : ndarray of bool, optional
        Pixels whose relief another level validates: to be believed, if not called measured.
    half : Frame, optional
        At half the resolution, for plain walls: there relief is put on `facets`.
    """
    d2 = frame.distances[1]
    low, high = relief_range or seed.usual_range(d2)
    margin = 0.1 * (high - low)
    relief = np.clip(np.nan_to_num(matched.r), low - margin, high + margin).astype(np.float32)
    sigma = flow.sigma_of_relief(frame, relief, matched.sigma_px)
    valid = evidence.validated(matched.across, matched.loop, sigma, d2)
    support = evidence.supported(valid if backing is None else valid | backing)
    relief = evidence.held_back(relief, support, d2)
    least = _covering(frame, COVERS)
    relief = lost_regions.put_behind(frame, relief, matched.loop, support, least)
    side_face = forward_projection.side_faces(frame, relief)
    typical = float(np.median(matched.sigma_px[::8, ::8]))
    relief, misfit = edges.sharpen(frame, relief, typical)
    precise = edges.precision(typical)
    own = relief
    if half is None:
        share = precise * NOISE_SHARE + (1 - precise)
        quiet = np.float32(share) * np.minimum(matched.sigma_px, _noise(frame, typical))
        windows = REFINED_WINDOWS if matched.refined else WINDOWS
        relief = shrink_noise(relief, flow.sigma_of_relief(frame, relief, quiet), windows)
    else:
        relief = facets.fitted(half, frame.image1, relief)
    sigma = flow.sigma_of_relief(frame, relief, matched.sigma_px)
    measured = valid if backing is not None else valid | _pardoned(frame, matched, sigma, misfit)
    measured = measured & ~_falls_away(frame, relief, misfit, precise)
    if half is not None:
        measured &= np.abs(relief - own) < OFF_FACET * sigma
    quality = np.where(measured, Quality.MEASURED, Quality.INTERPOLATED).astype(np.uint8)
    bands = MapBands(relief, sigma, quality)
    covered, filled = _uncover(frame, bands, valid, support)
    steep = forward_projection.stretch(frame, relief) > STRETCH
    usable = flow.is_inside(frame, relief) & ~(steep & ~filled & ~valid)
    usable &= ~side_face
    bands.quality[covered] = Quality.HIDDEN
    return bands, usable


def _noise(frame: Frame, typical: float) -> Float32Array:
    """Return the most error across the radius that counts as noise. [px]"""
    x, y = frame.from_centre()
    near = np.float32(NOISE_AT_CENTRE) / np.maximum(np.sqrt(x * x + y * y), np.float32(1))
    return np.clip(np.maximum(near, np.float32(typical)), *NOISE_CLIP)


def _pardoned(
    frame: Frame, matched: flow.Measurement, sigma: Float32Array, misfit: Float32Array
) -> BoolArray:
    """Return the pixels beside steps that fail on the way back only: the photos fit there."""
    loop = matched.loop * np.float32(evidence.LOOP_LIMIT / PARDON_LOOP)
    near = evidence.validated(matched.across, loop, sigma, frame.distances[1])
    fits = cv2.blur(misfit, (3, 3)) < PARDON_MISFIT
    return np.asarray(near & fits & (local_contrast(frame.image1) > PARDON_CONTRAST))


def _falls_away(
    frame: Frame, relief: Float32Array, misfit: Float32Array, precise: float = 1.0
) -> BoolArray:
    """Return where relief falls outwards and the photos do not fit: camera 2 may see nothing there.

    Half of the wrongly measured pixels lie in strips of two to four pixels that the map does not
    know to be hidden: flow runs over the step as a slope. It is taken as a share of the slope of
    camera 2's rays, the steepest that camera 2 can see.
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
    return np.asarray(falls * misfit * misfit > _most_falling(frame, precise))


def _most_falling(frame: Frame, precise: float = 1.0) -> float:
    """Return the limit of slope times misfit squared, `FALLS_AWAY`. [grey levels²]"""
    d1, d2 = frame.distances
    limit = FALLS_AWAY * (1 - d2 / d1) ** FALLS_POWER
    return float(precise * limit + (1 - precise) * FALLS_AWAY_IMPRECISE)


def _covering(frame: Frame, covers: tuple[float, float]) -> Float32Array:
    """Return how much higher than another a surface must be to cover it in photo 2. [m]"""
    x, y = frame.from_centre()
    reach = np.maximum(np.sqrt(x * x + y * y), 1)
    parallax = covers[0] * frame.pair.base_factor / reach
    return np.asarray(parallax + covers[1] * frame.distances[1], dtype=np.float32)


def _uncover(
    frame: Frame, bands: MapBands, valid: BoolArray, support: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Give what photo 2 cannot see the surface behind (in place); return it and what changed."""
    relief, least = bands.r, _covering(frame, COVERS)
    covered = forward_projection.hidden_in_second(frame, relief, least, support)
    unsure = _covering(frame, COVERS_UNVALIDATED)
    perhaps = forward_projection.hidden_in_second(frame, relief, unsure)
    covered |= perhaps & ~valid
    before = MapBands(bands.r.copy(), bands.sigma.copy(), bands.quality.copy())
    nadir = frame.foot(1).nadir
    filled = forward_projection.fill_from_behind(bands, covered, frame.grid, nadir)
    # What is behind lies lower: a fill that rises leans on the wrong surface.
    rises = filled & (bands.r > before.r + least)
    bands.put(rises, before.at(rises))
    return covered, filled & ~rises
