"""Which of two photos was taken from nearer, as the photos themselves show it.

Along one axis and with unknown lenses no measure tells: what stands out in one order lies back in
the other. What is hidden tells. The near camera sees no more of a relief than the far one: what it
sees less of is covered there, while what grows is seen in both.
"""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model import Images, apply_homography
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.tuning import ORDER
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import homogeneous


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
    pictures, common, centre = _on_the_plane(images, ties)
    rows, columns = np.indices(common.shape, dtype=np.float32)
    away = np.stack([columns, rows], axis=-1) - centre
    radius = np.linalg.norm(away, axis=-1)
    away = (away / np.maximum(radius, 1e-6)[..., None]).astype(np.float32)
    fair = common & (radius > 0.12 * np.hypot(*common.shape))
    first, variance1 = _change(pictures, away, fair)
    second, variance2 = _change(pictures[::-1], away, fair)
    return float(np.nan_to_num((first - second) / np.sqrt(variance1 + variance2)))


def _on_the_plane(images: Images, ties: Ties) -> tuple[Images, BoolArray, FloatArray]:
    """Return the first photo, the second laid over it by the plane, where both are, the centre."""
    height, width = images[0].shape
    part = min(1.0, ORDER.side / max(height, width))
    size = round(width * part), round(height * part)
    moved = np.diag([part, part, 1.0]) @ np.linalg.inv(ties.homography)
    coarser = 1 / np.sqrt(abs(np.linalg.det(moved[:2, :2] / moved[2, 2])))
    second = cv2.blur(images[1], (max(1, round(coarser)),) * 2)
    shown = cv2.warpPerspective(np.ones_like(second), moved, size)
    inside = cv2.erode(shown, np.ones((61, 61)), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    equal = cv2.createCLAHE(2.0, (8, 8)).apply
    reduced = cv2.resize(images[0], size, interpolation=cv2.INTER_AREA)
    laid = cv2.warpPerspective(second, moved, size)
    # Parallax runs along lines that meet in the centre of zoom.
    places = homogeneous(part * ties.pixels1 / ORDER.side)
    lines = np.cross(places, homogeneous(apply_homography(moved, ties.pixels2) / ORDER.side))
    centre = np.linalg.svd(lines, full_matrices=False)[2][2]
    return (
        (equal(reduced), equal(laid)),
        np.asarray(inside > 0),
        ORDER.side * centre[:2] / centre[2],
    )


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
        for reach in (-ORDER.reach, ORDER.reach)
    )
    steps = np.clip(inner - outer - ORDER.step, 0, 10) * fair
    moved_back = cv2.remap(second, places + moved, None, cv2.INTER_LINEAR)
    detail, smooth = (
        picture - cv2.GaussianBlur(picture, (0, 0), 6)
        for picture in (first.astype(np.float32), moved_back.astype(np.float32))
    )
    usual = cv2.GaussianBlur(np.abs(detail), (0, 0), 8) + 4
    replaced = steps * np.minimum(np.abs(detail - smooth), 40) / usual
    part, whole = (
        cv2.resize(v, (ORDER.blocks, ORDER.blocks), interpolation=cv2.INTER_AREA)
        for v in (replaced, steps)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        share = part.sum() / whole.sum()
        variance = ((part - share * whole) ** 2).sum() / part.sum() ** 2
        return float(np.log(share)), float(variance)
