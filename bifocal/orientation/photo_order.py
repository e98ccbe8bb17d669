"""Which of two photos was taken from nearer, as the photos themselves show it.

Along one axis and with unknown lenses no measure tells: what stands out in one order lies back in
the other. What is hidden tells. The near camera sees no more of a relief than the far one: what it
sees less of is covered there, while what grows is seen in both.
"""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.orientation.interior_orientation import Images
from bifocal.orientation.relative_orientation import Ties
from photocore.arrays import BoolArray, ByteArray, FloatArray

#: Longer side of the pictures that are compared, and blocks a side for the scatter. [px]
SIDE, BLOCKS = 1500, 10
#: Steps of parallax are looked for between places so far apart, above so much. [px]
REACH, STEP = 6.0, 2.0
#: So many standard deviations are believed: the rendered church 9, church_1 4; the sample 2.6 and
#: church_2, seen from 18 degrees beside the axis, -1.5 tell nothing.
SURE = 4.0


def first_is_far(images: Images, ties: Ties) -> float:
    """Return by how many standard deviations the first photo shows itself the far one.

    Parameters
    ----------
    images : two ndarrays, shape (h, w), uint8
    ties : Ties
        Their common points.

    Notes
    -----
    Parallax, outwards from the centre of zoom, steps down where a photo shows less than the other.
    Where it does so from the far to the near photo the missing part is covered, and what the near
    photo shows in its place is something else; the other way round it is seen foreshortened.
    """
    pictures, seen, frame = _on_the_plane(images, ties)
    rows, columns = np.indices(seen.shape, dtype=np.float32)
    away = np.stack([columns, rows], axis=-1) - _centre(ties, frame)
    radius = np.linalg.norm(away, axis=-1)
    away = (away / np.maximum(radius, 1e-6)[..., None]).astype(np.float32)
    fair = seen & (radius > 0.12 * np.hypot(*seen.shape))
    first, variance1 = _change(pictures, away, fair)
    second, variance2 = _change(pictures[::-1], away, fair)
    test = (first - second) / np.sqrt(variance1 + variance2)
    return float(np.nan_to_num(test, nan=0.0, posinf=0.0, neginf=0.0))


def _on_the_plane(images: Images, ties: Ties) -> tuple[Images, BoolArray, FloatArray]:
    """Return the first photo, the second laid over it by the plane, where both are, the scale."""
    height, width = images[0].shape
    frame = np.diag([*[min(1.0, SIDE / max(height, width))] * 2, 1.0])
    size = round(width * frame[0, 0]), round(height * frame[0, 0])
    moved = frame @ np.linalg.inv(ties.homography)
    coarser = 1 / np.sqrt(abs(np.linalg.det(moved[:2, :2] / moved[2, 2])))
    second = cv2.blur(images[1], (max(1, round(coarser)),) * 2)
    shown = cv2.warpPerspective(np.full(second.shape, 1, np.uint8), moved, size)
    inside = cv2.erode(shown, np.ones((61, 61)), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    equal = cv2.createCLAHE(2.0, (8, 8)).apply
    reduced = cv2.resize(images[0], size, interpolation=cv2.INTER_AREA)
    laid = cv2.warpPerspective(second, moved, size)
    return (equal(reduced), equal(laid)), np.asarray(inside > 0), frame


def _centre(ties: Ties, frame: FloatArray) -> FloatArray:
    """Return from where parallax spreads, in the frame: where the ties' parallaxes meet."""
    places = ties.pixels1 @ frame[:2, :2]
    back = cv2.perspectiveTransform(ties.pixels2[None], np.linalg.inv(ties.homography))[0]
    moved = back @ frame[:2, :2] - places
    length = np.linalg.norm(moved, axis=1)
    places, moved = places[length > STEP], moved[length > STEP] / length[length > STEP, None]
    across = np.column_stack([-moved[:, 1], moved[:, 0]])
    centre, weight = np.zeros(2), np.ones(len(places))
    for _ in range(20):
        level = (across * places).sum(axis=1)
        centre = np.linalg.lstsq(across * weight[:, None], level * weight, rcond=None)[0]
        weight = 1.0 / (1.0 + ((across @ centre - level) / 10.0) ** 2)
    return centre.astype(np.float32)


def _change(pictures: Images, away: FloatArray, fair: BoolArray) -> tuple[float, float]:
    """Return how much of the first picture another surface replaces where parallax steps down.

    The logarithm of its mean over all such places, and the variance of that.
    """
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow.setFinestScale(0)
    first, second = pictures
    rows, columns = np.indices(fair.shape, dtype=np.float32)
    places = np.stack([columns, rows], axis=-1)
    moved = flow.calc(first, second, None)
    outwards = cv2.medianBlur((moved * away).sum(axis=-1), 5)
    inner, outer = (
        cv2.remap(outwards, places + reach * away, None, cv2.INTER_LINEAR)
        for reach in (-REACH, REACH)
    )
    steps = np.clip(inner - outer - STEP, 0, 10) * fair
    found = cv2.remap(second, places + moved, None, cv2.INTER_LINEAR)
    detail = _detail(first)
    usual = cv2.GaussianBlur(np.abs(detail), (0, 0), 8) + 4
    replaced = steps * np.minimum(np.abs(detail - _detail(found)), 40) / usual
    part, whole = (_blocks(values) for values in (replaced, steps))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = part.sum() / whole.sum()
        variance = ((part - share * whole) ** 2).sum() / part.sum() ** 2
        return float(np.log(share)), float(variance)


def _detail(picture: ByteArray) -> FloatArray:
    """Return a picture without its coarse shades."""
    values = picture.astype(np.float32)
    return values - cv2.GaussianBlur(values, (0, 0), 6)


def _blocks(values: FloatArray) -> FloatArray:
    """Return the sums of blocks of a picture."""
    rows, columns = (np.arange(BLOCKS) * size // BLOCKS for size in values.shape)
    return np.add.reduceat(np.add.reduceat(values.astype(np.float64), rows, 0), columns, 1)
