"""The picture of a set-up: both photos on the wall plane, overlaid, with what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model import Images, Photo
from bifocal.orientation.alignment import Alignment
from bifocal.orientation.area_points import resampled
from photocore.arrays import ByteArray, FloatArray
from photocore.images import write_image

#: Longer side of the picture. [px]
WIDTH = 1600
GREEN, YELLOW, RED, WHITE, BLUE = (
    (60, 190, 60), (240, 200, 30), (230, 40, 40), (255, 255, 255), (60, 120, 255)
)  # fmt: skip

Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class _Overlay:
    """The picture on the wall plane: left and upper edge and the size of its pixels. [m]"""

    picture: NDArray[np.uint8]
    corner: FloatArray
    gsd: float

    def places(self, positions: FloatArray) -> FloatArray:
        """Return picture pixels of plane positions; far outside where there is none."""
        away = np.nan_to_num(positions, nan=-1e6) - self.corner
        return np.round(np.clip(away / [self.gsd, -self.gsd], -9999, 9999))

    def text(self, at: FloatArray, text: str, colour: Colour, size: float, width: int = 2) -> None:
        """Write a text."""
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(self.picture, text, _whole(at), font, size, colour, width, cv2.LINE_AA)


def _whole(at: FloatArray) -> tuple[int, int]:
    """Return a place as OpenCV takes it."""
    return int(at[0]), int(at[1])


def write_alignment_picture(
    path: Path | str, alignment: Alignment, images: Images, *, overwrite: bool = False
) -> None:
    """Write the overlay: far photo red, near photo cyan, so what lies on the wall looks grey.

    Green dots: common points on the wall; yellow: off it. Control points are white crosses with
    their residuals as red lines, enlarged as the legend says; left-out points are ringed red.
    """
    grid, gsd = _grid(alignment, images)
    pair = alignment.pair
    far, near = (
        resampled(image, _pixels_ahead(photo, image, grid))
        for photo, image in zip((pair.image1, pair.image2), images, strict=True)
    )
    picture = np.ascontiguousarray(np.stack([far, near, near], axis=-1))
    overlay = _Overlay(picture, grid[0, 0], gsd)
    ties = overlay.places(pair.image1.plane_from_pixels(alignment.tie1))
    for at, wall in zip(ties, alignment.wall, strict=True):
        cv2.circle(picture, _whole(at), 3, GREEN if wall else YELLOW, -1, cv2.LINE_AA)
    _draw_control(overlay, alignment)
    spots = (("N1", pair.image1.nadir), ("N2", pair.image2.nadir), ("e", pair.zoom_centre))
    for name, spot in spots:
        at = overlay.places(np.asarray(spot))
        cv2.drawMarker(picture, _whole(at), BLUE, cv2.MARKER_TILTED_CROSS, 26, 3, cv2.LINE_AA)
        overlay.text(at + np.array([14, 6]), name, BLUE, 0.7)
    _draw_legend(overlay, alignment)
    write_image(path, picture, overwrite=overwrite)


def _grid(alignment: Alignment, images: Images) -> tuple[FloatArray, float]:
    """Return the plane positions of the picture's pixels (h, w, 2), and their size. [m]"""
    far = alignment.pair.image1
    parts = [far.plane_from_pixels(alignment.tie1[alignment.wall]), alignment.control_positions]
    outline = np.concatenate([part[np.isfinite(part).all(axis=1)] for part in parts])
    if len(outline) < 4:
        height, width = images[0].shape
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
        outline = far.plane_from_pixels(corners)
        outline = outline[np.isfinite(outline).all(axis=1)]
    low, high = np.percentile(outline, [1, 99], axis=0)
    # All that was compared is in it: a wall found in a corner shows as one.
    every = far.plane_from_pixels(alignment.tie1)
    every = every[np.isfinite(every).all(axis=1)]
    if len(every):
        some = np.percentile(every, [5, 95], axis=0)
        low, high = np.minimum(low, some[0]), np.maximum(high, some[1])
    margin = 0.15 * float((high - low).max())
    low, high = low - margin, high + margin
    gsd = float((high - low).max()) / WIDTH
    x, y = np.arange(low[0], high[0], gsd), np.arange(high[1], low[1], -gsd)
    return np.stack(np.meshgrid(x, y), axis=-1), gsd


def _pixels_ahead(photo: Photo, image: ByteArray, grid: FloatArray) -> FloatArray:
    """Return the pixels of plane positions; NaN behind the camera, which would be mirrored."""
    pixels = photo.pixels_from_plane(grid)
    pixels[~photo.sees_ahead(grid, image.shape)] = np.nan
    return pixels


def _draw_control(overlay: _Overlay, alignment: Alignment) -> None:
    """Draw crosses with names, residuals as arrows, rings around points left out."""
    picture, zoom = overlay.picture, _residual_zoom(alignment)
    for index, at in enumerate(overlay.places(alignment.control_positions)):
        cv2.drawMarker(picture, _whole(at), WHITE, cv2.MARKER_CROSS, 22, 2, cv2.LINE_AA)
        for residual in alignment.control_residuals[index].reshape(2, 2):
            if np.isfinite(residual).all():
                end = np.clip(at + zoom * residual, -9999, 9999)
                cv2.arrowedLine(picture, _whole(at), _whole(end), RED, 2, cv2.LINE_AA)
        if not alignment.control_used[index]:
            cv2.circle(picture, _whole(at), 22, RED, 3, cv2.LINE_AA)
        overlay.text(at + np.array([12, -10]), alignment.control_ids[index], WHITE, 0.6)


def _residual_zoom(alignment: Alignment) -> float:
    """Return picture pixels per pixel of residual: a round number that shows the usual ones."""
    sizes = np.abs(alignment.control_residuals[alignment.control_used])
    sizes = sizes[np.isfinite(sizes)]
    usual = max(float(np.percentile(sizes, 90)) if len(sizes) else 1.0, 0.05)
    return float(10 ** np.floor(np.log10(40.0 / usual)))


def _draw_legend(overlay: _Overlay, alignment: Alignment) -> None:
    """Draw a strip with the scale bar and what the colours mean."""
    picture = overlay.picture
    height, width = picture.shape[:2]
    cv2.rectangle(picture, (0, height - 44), (width, height), (20, 20, 20), -1)
    metres = float(10 ** np.floor(np.log10(0.2 * width * overlay.gsd)))
    bar = round(metres / overlay.gsd)
    cv2.line(picture, (20, height - 14), (20 + bar, height - 14), WHITE, 4)
    overlay.text(np.array([24, height - 22]), f"{metres:g} m", WHITE, 0.5, 1)
    text = "far red, near cyan; dots: green wall, yellow off it; blue: nadirs, centre of zoom"
    if alignment.control_ids:
        text += f"; red: residuals x {_residual_zoom(alignment):g}"
    size = min(0.55, (width - bar - 80) / (9.5 * len(text)))
    overlay.text(np.array([50 + bar, height - 16]), text, WHITE, size, 1)
