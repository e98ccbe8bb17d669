"""What a client would send back: figures of a relief map and of the orthophoto made with it.

Truth is the ray caster's. Figures without truth (holes, scraps, bars) serve real photos, too.
"""

from __future__ import annotations

import cv2
import numpy as np

from bifocal import Orthophoto, Quality, ReliefMap
from tests.scenes.arrays import BoolArray, FloatArray
from tests.scenes.rendering import Rendering

#: Errors beyond this are visible at 1:50. [m]
GROSS = 0.03
#: A step of the truth, and pixels nearer to one than this are at an edge. [m, px]
STEP, AWAY = 0.03, 15.0
#: Holes and specks of fewer pixels cannot be told at 1:50. [px]
SMALL = 25
#: Relief this far beyond anything the truth holds within the window is a phantom. [m, px]
PHANTOM, AROUND = 0.25, 41
#: A bar: an empty part this long and this many times as long as wide, along the radius. [px]
BAR_LENGTH, BAR_RATIO = 60.0, 5.0
#: A scrap: a piece of picture of fewer pixels with nothing around it. [px]
SCRAP = 4000


def edge_distance(truth: FloatArray, step: float = STEP) -> FloatArray:
    """Return the distance of every pixel from a step of the exact relief. [px]"""
    kernel = np.ones((3, 3), dtype=np.uint8)
    steps = cv2.dilate(truth, kernel) - cv2.erode(truth, kernel) > step
    return cv2.distanceTransform((~steps).astype(np.uint8), cv2.DIST_L2, 3)


def in_frames(shot: Rendering) -> BoolArray:
    """Return which points of the truth lie within both photos, hidden or not."""
    places, inside = shot.truth.plane_positions(), np.isfinite(shot.truth.r)
    for photo, image in ((shot.pair.image1, shot.image1), (shot.pair.image2, shot.image2)):
        share = photo.distance / (photo.distance - shot.truth.r.astype(float))
        pixels = photo.pixels_from_plane(photo.nadir + (places - photo.nadir) * share[..., None])
        inside &= ((pixels >= 0) & (pixels <= np.subtract(image.shape[1::-1], 1))).all(-1)
    return inside


def relief_figures(found: ReliefMap, shot: Rendering) -> dict[str, float]:
    """Return errors of a map on the grid of the truth; mm, per cent, or a ratio by name."""
    truth, both = shot.truth.r, shot.visible1 & shot.visible2
    unknown = ~np.isfinite(found.r)
    error = np.where(unknown, np.float32(1.0), np.abs(found.r - truth))
    away = edge_distance(truth) > AWAY
    measured = both & (found.quality == Quality.MEASURED)
    x, y = np.moveaxis(shot.truth.plane_positions() - shot.pair.image1.nadir, -1, 0)
    off = error * np.hypot(x, y) / shot.pair.image1.distance / shot.truth.gsd
    inside = in_frames(shot)
    hidden2 = inside & ~shot.visible2
    ratio = error / np.maximum(found.sigma, 1e-6)
    around = np.ones((AROUND, AROUND), np.uint8)
    phantom = found.r > cv2.dilate(truth, around) + PHANTOM
    phantom |= found.r < cv2.erode(truth, around) - PHANTOM

    def rms(values: FloatArray) -> float:
        return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))

    return {
        "median mm": 1e3 * float(np.median(error[both])),
        "beyond 3 cm %": 100 * float((error[both] > GROSS).mean()),
        "beyond 10 cm %": 100 * float((error[both] > 0.1).mean()),
        "rmse off edges mm": 1e3 * rms(error[both & away]),
        "ortho beyond 1 px %": 100 * float((off[both] > 1).mean()),
        "measured %": 100 * float(measured.sum() / both.sum()),
        "measured beyond 3 cm %": 100 * float((error[measured] > GROSS).mean()),
        "measured rmse off edges mm": 1e3 * rms(error[measured & away]),
        "measured error/sigma off edges": rms(ratio[measured & away]),
        "measured error/sigma": rms(ratio[measured]),
        "within 2 sigma %": 100 * float((ratio[measured & away] < 2).mean()),
        "median error/sigma": float(np.median(ratio[measured & away])),
        "false measured %": 100 * float((found.quality[hidden2] == Quality.MEASURED).mean()),
        "phantom px": float((phantom & inside).sum()),
    }


def hidden_figures(hidden: BoolArray, shot: Rendering) -> dict[str, float]:
    """Return how well pixels hidden from the far camera are told, to 2 px."""
    inside = in_frames(shot)
    covered, hidden = inside & ~shot.visible1, hidden & inside
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    near, called = (cv2.dilate(part.astype(np.uint8), disc) > 0 for part in (covered, hidden))
    return {
        "hidden recall": float(called[covered].mean()),
        "hidden precision": float(near[hidden].mean()) if hidden.any() else 1.0,
        "wrongly hidden %": 100 * float((hidden & ~near).sum() / inside.sum()),
    }


def ortho_figures(ortho: Orthophoto, relief: ReliefMap) -> dict[str, float]:
    """Return holes, empty parts, scraps and bars of an orthophoto on the grid of its relief."""
    valid, known = ortho.valid, relief.known
    seen = cv2.morphologyEx(valid.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)) > 0
    empty = known & ~valid
    # Known relief outside the photo is no hole of the orthophoto.
    empty &= ortho.hidden | seen
    _, _, holes, _ = cv2.connectedComponentsWithStats((~valid).astype(np.uint8), connectivity=8)
    _, _, pieces, _ = cv2.connectedComponentsWithStats(valid.astype(np.uint8), connectivity=8)
    area = pieces[1:, cv2.CC_STAT_AREA]
    measured = relief.quality == Quality.MEASURED
    return {
        "shown %": 100 * float(valid.mean()),
        "empty of known %": 100 * float(empty.sum() / max(known.sum(), 1)),
        "empty of measured %": 100 * float((empty & measured).sum() / max(measured.sum(), 1)),
        "small holes": float((holes[1:, cv2.CC_STAT_AREA] < SMALL).sum()),
        "specks": float((area < SMALL).sum()),
        "scraps": float(((area >= SMALL) & (area < SCRAP)).sum()),
    }


def bars(empty: BoolArray, middle: FloatArray) -> int:
    """Return how many empty parts are long and narrow and run along the radius from a point.

    Parameters
    ----------
    empty : ndarray of bool, shape (height, width)
    middle : ndarray, shape (2,)
        Column and row of the nadir.
    """
    _, label, stats, _ = cv2.connectedComponentsWithStats(empty.astype(np.uint8))
    large = np.flatnonzero(stats[:, cv2.CC_STAT_AREA] > BAR_LENGTH)
    count = 0
    for part in large[large > 0]:
        left, top, width, height = stats[part, :4]
        row, column = np.nonzero(label[top : top + height, left : left + width] == part)
        places = np.stack([column + left, row + top], axis=-1) - middle
        outwards = places.mean(0) / max(np.linalg.norm(places.mean(0)), 1e-9)
        along, across = places @ outwards, places @ [-outwards[1], outwards[0]]
        length, breadth = 4 * along.std(), max(4 * across.std(), 1.0)
        count += bool(length > BAR_LENGTH and length > BAR_RATIO * breadth)
    return count
