"""The picture of a set-up: both photos on the wall plane, overlaid, with what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.files.images import write_image
from bifocal.model.pair import Photo
from bifocal.orientation.alignment import Alignment
from photocore.arrays import ByteArray, FloatArray

#: Longer side of the picture. [px]
WIDTH = 1600
GREEN, YELLOW, RED, WHITE, BLUE = (
    (60, 190, 60), (240, 200, 30), (230, 40, 40), (255, 255, 255), (60, 120, 255)
)  # fmt: skip


def write_alignment_picture(
    path: Path | str,
    alignment: Alignment,
    images: tuple[ByteArray, ByteArray],
    *,
    overwrite: bool = False,
) -> None:
    """Write the overlay: far photo red, near photo cyan, so what lies on the wall looks grey.

    Green dots: common points on the wall; yellow: off it. Control points are white crosses with
    their residuals as red lines, enlarged as the legend says; left-out points are ringed red.
    """
    bounds, gsd = _frame(alignment, images)
    pair = alignment.pair
    layers = [
        _rectified(photo, image, bounds, gsd)
        for photo, image in zip((pair.image1, pair.image2), images, strict=True)
    ]
    picture = np.ascontiguousarray(np.stack([layers[0], layers[1], layers[1]], axis=-1))
    _draw_ties(picture, alignment, bounds, gsd)
    _draw_control(picture, alignment, bounds, gsd)
    _draw_nadirs(picture, alignment, bounds, gsd)
    _draw_legend(picture, alignment, gsd)
    write_image(path, picture, overwrite=overwrite)


def _frame(
    alignment: Alignment, images: tuple[ByteArray, ByteArray]
) -> tuple[tuple[float, float, float, float], float]:
    """Return left, bottom, right, top of the picture and its pixel on the wall. [m]"""
    parts = [
        alignment.pair.image1.plane_from_pixels(alignment.tie1[alignment.wall]),
        np.asarray(alignment.setup.get("control_positions", np.zeros((0, 2)))).reshape(-1, 2),
    ]
    seen = np.concatenate([part[np.isfinite(part).all(axis=1)] for part in parts])
    if len(seen) < 4:
        height, width = images[0].shape
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
        seen = alignment.pair.image1.plane_from_pixels(corners)
        seen = seen[np.isfinite(seen).all(axis=1)]
    low, high = np.percentile(seen, [1, 99], axis=0)
    margin = 0.15 * float((high - low).max())
    low, high = low - margin, high + margin
    gsd = float((high - low).max()) / WIDTH
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1])), gsd


def _rectified(
    photo: Photo, image: ByteArray, bounds: tuple[float, float, float, float], gsd: float
) -> NDArray[np.uint8]:
    """Return a photo on the wall plane."""
    left, bottom, right, top = bounds
    x = np.arange(left, right, gsd)
    y = np.arange(top, bottom, -gsd)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    pixels = photo.pixels_from_plane(grid)
    # The plane's points behind the camera would be seen mirrored.
    ahead = np.linalg.inv(photo.plane_from_pixel)
    depth = grid @ ahead[2, :2] + ahead[2, 2]
    middle = photo.plane_from_pixels(np.array([[image.shape[1] / 2.0, image.shape[0] / 2.0]]))[0]
    sign = np.sign(middle @ ahead[2, :2] + ahead[2, 2])
    pixels[depth * sign <= 0] = np.nan
    reduction = max(1, round(_pixel_steps(pixels)))
    if reduction > 1:
        image = cv2.blur(image, (reduction, reduction)).astype(np.uint8)
    maps = np.nan_to_num(pixels, nan=-10.0).astype(np.float32)
    plane: Any = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=0)
    return np.asarray(plane, dtype=np.uint8)


def _pixel_steps(pixels: FloatArray) -> float:
    """Return how many photo pixels one picture pixel spans, at the median."""
    steps = np.linalg.norm(np.diff(pixels, axis=1), axis=-1)
    finite = steps[np.isfinite(steps)]
    return float(np.median(finite)) if len(finite) else 1.0


def _at(
    positions: FloatArray, bounds: tuple[float, float, float, float], gsd: float
) -> NDArray[np.int64]:
    """Return picture pixels of plane positions."""
    column = (positions[:, 0] - bounds[0]) / gsd
    row = (bounds[3] - positions[:, 1]) / gsd
    return np.round(np.clip(np.column_stack([column, row]), -9999, 9999)).astype(np.int64)


def _draw_ties(picture: NDArray[np.uint8], alignment: Alignment, bounds: Any, gsd: float) -> None:
    positions = alignment.pair.image1.plane_from_pixels(alignment.tie1)
    fine = np.isfinite(positions[:, 0])
    places = _at(np.nan_to_num(positions, nan=-1e6), bounds, gsd)
    for place, wall, good in zip(places, alignment.wall, fine, strict=True):
        if good:
            cv2.circle(
                picture, (int(place[0]), int(place[1])), 3, GREEN if wall else YELLOW, -1,
                cv2.LINE_AA,
            )  # fmt: skip


def _draw_control(
    picture: NDArray[np.uint8], alignment: Alignment, bounds: Any, gsd: float
) -> None:
    positions = np.asarray(alignment.setup.get("control_positions", np.zeros((0, 2))))
    if not len(positions):
        return
    zoom = _residual_zoom(alignment)
    places = _at(np.nan_to_num(positions, nan=-1e6), bounds, gsd)
    for index, place in enumerate(places):
        at = (int(place[0]), int(place[1]))
        cv2.drawMarker(picture, at, WHITE, cv2.MARKER_CROSS, 22, 2, cv2.LINE_AA)
        for part in (slice(0, 2), slice(2, 4)):
            residual = alignment.control_residuals[index, part]
            if np.isfinite(residual).all():
                end = np.clip(place + zoom * residual, -9999, 9999).astype(int)
                cv2.arrowedLine(picture, at, (int(end[0]), int(end[1])), RED, 2, cv2.LINE_AA)
        if not alignment.control_used[index]:
            cv2.circle(picture, at, 22, RED, 3, cv2.LINE_AA)
        cv2.putText(
            picture, alignment.control_ids[index], (at[0] + 12, at[1] - 10),
            cv2.FONT_HERSHEY_SIMPLEX, 0.6, WHITE, 2, cv2.LINE_AA,
        )  # fmt: skip


def _residual_zoom(alignment: Alignment) -> float:
    """Return picture pixels per pixel of residual: a round number that shows the usual ones."""
    sizes = np.abs(alignment.control_residuals[alignment.control_used])
    sizes = sizes[np.isfinite(sizes)]
    usual = max(float(np.percentile(sizes, 90)) if len(sizes) else 1.0, 0.05)
    return float(10 ** np.floor(np.log10(40.0 / usual)))


def _draw_nadirs(picture: NDArray[np.uint8], alignment: Alignment, bounds: Any, gsd: float) -> None:
    pair = alignment.pair
    spots = (("N1", pair.image1.nadir), ("N2", pair.image2.nadir), ("e", pair.zoom_centre))
    for name, spot in spots:
        place = _at(np.asarray(spot)[None], bounds, gsd)[0]
        at = (int(place[0]), int(place[1]))
        cv2.drawMarker(picture, at, BLUE, cv2.MARKER_TILTED_CROSS, 26, 3, cv2.LINE_AA)
        cv2.putText(
            picture, name, (at[0] + 14, at[1] + 6), cv2.FONT_HERSHEY_SIMPLEX, 0.7, BLUE, 2,
            cv2.LINE_AA,
        )  # fmt: skip


def _draw_legend(picture: NDArray[np.uint8], alignment: Alignment, gsd: float) -> None:
    """Draw a strip with the scale bar and what the colours mean."""
    height, width = picture.shape[:2]
    cv2.rectangle(picture, (0, height - 44), (width, height), (20, 20, 20), -1)
    metres = float(10 ** np.floor(np.log10(0.2 * width * gsd)))
    bar = round(metres / gsd)
    cv2.line(picture, (20, height - 14), (20 + bar, height - 14), WHITE, 4)
    cv2.putText(
        picture, f"{metres:g} m", (24, height - 22), cv2.FONT_HERSHEY_SIMPLEX, 0.5, WHITE, 1,
        cv2.LINE_AA,
    )  # fmt: skip
    text = "far red, near cyan; dots: green wall, yellow off it; blue: nadirs, centre of zoom"
    if alignment.control_ids:
        text += f"; red: residuals x {_residual_zoom(alignment):g}"
    scale = min(0.55, (width - bar - 80) / (9.5 * len(text)))
    cv2.putText(
        picture, text, (50 + bar, height - 16), cv2.FONT_HERSHEY_SIMPLEX, scale, WHITE, 1,
        cv2.LINE_AA,
    )  # fmt: skip
