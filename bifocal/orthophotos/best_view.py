"""Which of many photos shows a place of the wall best, and the picture made of them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.image import ImageArray
from bifocal.orthophotos.ortho_image import OF_SET, Source
from bifocal.orthophotos.rectify import SourcePhoto
from bifocal.orthophotos.tuning import COMPOSE
from photocore.arrays import BoolArray, ByteArray, Float32Array


def chosen(
    views: Sequence[SourcePhoto],
    images: Sequence[ImageArray],
    usable: Sequence[BoolArray],
    grid: Grid,
    feather: float,
) -> tuple[ImageArray, ByteArray]:
    """Return the colours of a window and the photo of each pixel, `OF_SET` above its number.

    Each pixel is of the photo that sees it best. Where the best changes on a surface that both
    see, colours fade over; at the edges of what hides a place they do not.

    Parameters
    ----------
    views : sequence of SourcePhoto
    images : sequence of ndarray
        The window as each shows it.
    usable : sequence of ndarray of bool
        What each sees.
    grid : Grid
        The window.
    feather : float
        Width of the transition. [px]
    """
    cost = np.stack([np.where(see, _cost(view, grid), np.float32(np.inf)) for view, see in
                     zip(views, usable, strict=True)])  # fmt: skip
    best = cost.argmin(axis=0)
    visible = np.isfinite(cost.min(axis=0))
    side = 2 * int(np.ceil(feather / 2)) + 1
    total = np.zeros(grid.shape, np.float32)
    mixed = np.zeros(images[0].shape, np.float32)
    largest = np.zeros(grid.shape, np.float32)
    for number, (image, see) in enumerate(zip(images, usable, strict=True)):
        share = cv2.blur(((best == number) & visible).astype(np.float32), (side, side))
        share = np.where(see, share, np.float32(0))
        mixed += image * share.reshape(share.shape + (1,) * (image.ndim - 2))
        total += share
        largest = np.maximum(largest, share)
    mixed /= np.maximum(total, np.float32(1e-6)).reshape(total.shape + (1,) * (mixed.ndim - 2))
    numbers = np.array([view.number for view in views], np.uint8) + np.uint8(OF_SET)
    source = np.where(largest > 0.99 * total, numbers[best], np.uint8(Source.BOTH))
    source = np.where(visible, source, np.uint8(Source.NONE))
    picture = np.rint(mixed).astype(images[0].dtype)
    picture[~visible] = 0
    return picture, source


def _cost(view: SourcePhoto, grid: Grid) -> Float32Array:
    """Return how badly a photo shows the places of a window.

    The side of its pixel there, and how far an error of relief shifts what it shows: by the slope
    of its rays, s / d.
    """
    x = np.linspace(0, grid.width - 1, COMPOSE.places)
    y = np.linspace(0, grid.height - 1, COMPOSE.places)
    places = np.stack(np.meshgrid(grid.x0 + x * grid.gsd, grid.y0 - y * grid.gsd), axis=-1)
    xy = places.reshape(-1, 2)
    photo = view.photo
    with np.errstate(invalid="ignore", divide="ignore"):
        area = np.abs(np.linalg.det(photo.metres_per_pixel(photo.pixels_from_plane(xy))))
    slope = np.linalg.norm(xy - photo.nadir, axis=1) / photo.distance
    pixel = np.maximum(np.sqrt(np.nan_to_num(area, nan=1.0, posinf=1.0)), grid.gsd)
    cost = (pixel / grid.gsd + COMPOSE.slope * slope).reshape(places.shape[:2])
    size = (grid.width, grid.height)
    return np.asarray(cv2.resize(cost.astype(np.float32), size, interpolation=cv2.INTER_LINEAR))
