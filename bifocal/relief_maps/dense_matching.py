"""Dense relief of a bifocal pair: seed, flow, edges, noise, plane."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import cv2
import numpy as np

from bifocal.files.haze import greys_of_pair
from bifocal.model.grid import Bounds, Grid, bounds_of
from bifocal.model.pair import Pair
from bifocal.model.relief_map import Quality, ReliefMap
from bifocal.rays import object_rays, plane_position
from bifocal.relief_maps import coarse_level, flow, seed, smoothing
from bifocal.relief_maps.exposure import match_exposure
from bifocal.relief_maps.flow import FLOW
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import (
    LONGEST_SIDE,
    common_bounds,
    make_frame,
    working_grid,
    zoomed_box,
)
from bifocal.relief_maps.orientation_sigma import orientation_sigma
from bifocal.relief_maps.registration import Registration, check_registration
from bifocal.relief_maps.seed import SEED
from bifocal.relief_maps.stages import relief_map
from bifocal.remarks import remark
from photocore.arrays import ByteArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.large_photos import Pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitsTuning:
    """What is refused, and what small frames can afford."""

    #: Working frames of fewer pixels can afford the finer search. [px]
    small: float = 3e6
    #: Relief maps of more pixels are refused: a unit has been mistaken. [px]
    largest_map: float = 400e6
    #: A GSD coarser than this, and coarser than twice the far photo's pixel, is a slip, too. [m]
    coarsest_gsd: float = 0.2
    #: So is a GSD coarser than the photo's that leaves fewer pixels a side. [px]
    fewest_pixels: int = 64
    #: Matching needs this many working pixels a side. [px]
    smallest_work: int = 24


LIMITS = LimitsTuning()
#: Coarsening of the working frame, and the most pixels it may have. Every second pixel of a frame
#: is matched in `fast`, but all of them refine it.
QUALITIES = {"fast": (2.0, 3.2e6), "standard": (1.0, 9e6), "best": (1.0, 30e6)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DenseRelief(ReliefMap):
    """A relief map and how it came about.

    Attributes
    ----------
    registration : Registration
        Whether the photos fit each other; its remarks are for the user.
    working_gsd : float
        Pixel at which the photos were matched. [m]
    used : tuple of tuple of str
        Of a set the names of the photos of each pair that was measured; empty for a pair.
    notes : tuple of str
        What the user should know of a set's pairs.
    """

    registration: Registration
    working_gsd: float
    used: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()

    def summary(self) -> dict[str, object]:
        """Return the figures of `bifocal relief --json`."""
        figures = {"min": 0, "p1": 1, "median": 50, "p99": 99, "max": 100}
        values = np.percentile(self.r[self.known], list(figures.values())).tolist()
        sigma = self.sigma[self.quality == Quality.MEASURED]
        return {
            "size": [self.shape[1], self.shape[0]],
            "gsd": self.gsd,
            "working_gsd": self.working_gsd,
            "bounds": list(self.bounds),
            "shares": {q.name.lower(): float((self.quality == q).mean()) for q in Quality},
            "relief": dict(zip(figures, values, strict=True)),
            "sigma_median": float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else None,
            "registration": asdict(self.registration) | {"remarks": self.registration.remarks},
            **({"pairs": [list(names) for names in self.used]} if self.used else {}),
        }


def pair_relief(
    pair: Pair,
    image1: Pixels,
    image2: Pixels,
    *,
    gsd: float | None = None,
    bounds: Bounds | None = None,
    quality: str = "standard",
    relief_range: tuple[float, float] | None = None,
    sideways: bool = False,
    of_set: bool = False,
    progress: Progress = no_progress,
) -> DenseRelief:
    """Measure the relief of everything both photos of a pair show: `dense_relief` of a pair."""
    grey1, grey2 = greys_of_pair(pair, image1, image2)
    if quality not in QUALITIES:
        raise InputError(f"quality: expected {', '.join(QUALITIES)}, got {quality!r}.")
    if relief_range is not None:
        _check_range(relief_range, pair.image2.distance)
    if pair.refracted:  # nothing stands out of the water, or through the glass
        low, high = relief_range or seed.usual_range(pair.image2.distance)
        relief_range = (low, min(high, 0.999 * pair.highest_relief))
        if not low < relief_range[1]:
            raise InputError(
                f"relief_range: the last interface lies {pair.highest_relief:.3g} m before the "
                f"plane, and nothing beyond it is measured; got {low:g}, {high:g}."
            )
    map_grid, target, work = _grids(pair, (grey1, grey2), gsd, bounds, quality, relief_range)
    whole = make_frame(pair, grey1, grey2, work, relief_range, sideways=sideways, of_set=of_set)
    fast = quality == "fast"
    frame = coarse_level.halved(whole) if fast else whole
    progress(0.1, 1.0, "First relief")
    side = SEED.fast_side if fast else SEED.coarse_side
    coarse, _ = seed.coarse_relief(frame, relief_range, side=side)
    whole = match_exposure(whole, coarse)
    frame = coarse_level.halved(whole) if fast else whole
    progress(0.2, 1.0, "Matching")
    small = not fast and work.width * work.height < LIMITS.small
    stride = FLOW.fine_stride if small else FLOW.stride
    matched = flow.measure(frame, coarse, stride=stride, finer=whole if fast else None)
    del whole
    registration = check_registration(frame, matched)
    progress(0.7, 1.0, "Relief map")
    if not fast and (matched.plain or coarse_level.is_unsure(matched)):
        matched, backing, half = coarse_level.backed(frame, matched, coarse)
        bands = relief_map(
            frame, matched, relief_range, target, backing=backing,
            half=half if matched.plain else None,
        )  # fmt: skip
    else:
        bands = relief_map(frame, matched, relief_range, target)
    progress(1.0, 1.0)
    bands = _resampled(bands, target, map_grid)
    finite = np.isfinite(bands.r)
    return DenseRelief(
        r=bands.r,
        sigma=np.where(
            finite,
            np.hypot(bands.sigma, orientation_sigma(pair, bands.r, map_grid)),
            np.float32("nan"),
        ),
        quality=np.where(finite, bands.quality, np.uint8(Quality.UNKNOWN)),
        plane_from_pixel=map_grid.plane_from_pixel,
        registration=registration,
        working_gsd=frame.grid.gsd,
    )


def _grids(
    pair: Pair,
    images: tuple[ByteArray, ByteArray],
    gsd: float | None,
    bounds: Bounds | None,
    quality: str,
    relief_range: tuple[float, float] | None,
) -> tuple[Grid, Grid, Grid]:
    """Return the grid of the map, the same at working resolution at the finest, and the work's."""
    native = pair.image1.gsd((images[0].shape[1], images[0].shape[0]))
    common = common_bounds(pair, (images[0].shape, images[1].shape))
    step = native if gsd is None else float(gsd)
    box = common if bounds is None else bounds
    map_grid = Grid.from_bounds(box, gsd=step)
    about = {"gsd": step, "wide": box[2] - box[0], "high": box[3] - box[1], "native": native}
    about |= {"width": map_grid.width, "height": map_grid.height}
    if map_grid.width * map_grid.height > LIMITS.largest_map or max(map_grid.shape) > LONGEST_SIDE:
        raise InputError(remark("relief.gsd_too_fine", **about))
    few = min(map_grid.shape) < LIMITS.fewest_pixels and step > 1.01 * native
    if few or min(map_grid.shape) < 2 or step > max(LIMITS.coarsest_gsd, 2 * native):
        about |= {"coarsest": LIMITS.coarsest_gsd, "fewest": LIMITS.fewest_pixels}
        raise InputError(remark("relief.gsd_too_coarse", **about))
    low, high = relief_range or seed.usual_range(pair.image2.distance)
    reach = _seen_box(pair, box, low, high) if bounds is not None else box
    lower, upper = np.maximum(reach[:2], common[:2]), np.minimum(reach[2:], common[2:])
    reach = (*lower.tolist(), *upper.tolist())
    if reach[2] - reach[0] < 16 * native or reach[3] - reach[1] < 16 * native:
        rounded = tuple(round(v, 2) for v in common)
        raise InputError(remark("relief.bounds_outside", bounds=box, seen=rounded))
    factor, most = QUALITIES[quality]
    area = (reach[2] - reach[0]) * (reach[3] - reach[1])
    fine = max(native * factor, np.sqrt(area / most), step / 2)
    if fine < 1.01 * factor * native:
        fine = factor * native
    wide = zoomed_box(pair, images[1].shape, reach, min(high, 0.6 * pair.image2.distance))
    # Matched at half of what it is refined at.
    halved = 2 if quality == "fast" else 1
    work = working_grid(pair, images[0].shape, wide, fine / halved)
    if min(work.shape) < LIMITS.smallest_work * halved:
        raise InputError(
            f"the photos would be matched on {work.width // halved} x {work.height // halved} px "
            f"of {fine:.3g} m; at least {LIMITS.smallest_work} a side are needed. Give larger "
            "bounds, a finer gsd or quality standard."
        )
    if bounds is None and gsd is None:
        # The map's pixels are those of photo 1, where that is square to the wall.
        map_grid = working_grid(pair, images[0].shape, common, native)
    target = map_grid if step >= 0.999 * fine else Grid.from_bounds(map_grid.bounds, gsd=fine)
    return map_grid, target, work


def _check_range(relief_range: tuple[float, float], d2: float) -> None:
    """Refuse a relief range that is none, or that reaches to the near camera."""
    low, high = relief_range
    if not (np.isfinite(relief_range).all() and low < high < 0.9 * d2):
        raise InputError(
            f"relief_range: expected two numbers, the least and the greatest relief [m], below "
            f"90 % of d2 ({0.9 * d2:.2f} m); got {low:g}, {high:g}."
        )


def _seen_box(pair: Pair, box: Bounds, low: float, high: float) -> Bounds:
    """Return where photo 1 sees, on the plane, what stands within a box between two reliefs."""
    foot = pair.image1.foot
    corners = (box[:2], box[2:])
    reliefs = (low, 0.0, min(high, 0.6 * foot.distance))
    xyz = np.array([[x, y, r] for r in reliefs for x, y in corners])
    return bounds_of(object_rays(plane_position(xyz, foot), foot).position)


def _resampled(bands: MapBands, grid: Grid, target: Grid) -> MapBands:
    """Return the map on the grid asked for, interpolated if that is finer, but for steps."""
    if target.gsd >= 0.999 * grid.gsd:
        return bands
    column, row = target.offset_in(grid)
    ratio = target.gsd / grid.gsd
    matrix = np.array([[ratio, 0, column], [0, ratio, row]])

    def warp(band: np.ndarray, how: int) -> np.ndarray:
        size, flags = (target.width, target.height), how | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(band, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)

    nearest, smoothed = warp(bands.r, cv2.INTER_NEAREST), warp(bands.r, cv2.INTER_LINEAR)
    step = warp(smoothing.steps(bands.r).astype(np.uint8), cv2.INTER_NEAREST) > 0
    smoothed = np.where(step, cv2.medianBlur(nearest, 3), smoothed)
    return MapBands(
        np.where(np.isfinite(smoothed), smoothed, nearest),
        warp(bands.sigma, cv2.INTER_NEAREST),
        warp(bands.quality, cv2.INTER_NEAREST),
    )
