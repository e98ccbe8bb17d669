"""A lens as read of a file, in OpenCV's conventions and our pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from photocore.arrays import FloatArray
from photocore.camera.pinhole import camera_matrix
from photocore.errors import InputError


class LensData(NamedTuple):
    """What a calibration file holds, in OpenCV's conventions and our pixels."""

    camera_matrix: FloatArray
    coefficients: FloatArray
    model: str
    image_size: tuple[float, float]
    source: str


def lens_data(
    focal: Sequence[float],
    centre: Sequence[float],
    terms: Sequence[float],
    size: Sequence[float],
    source: str,
    *,
    fisheye: bool = False,
) -> LensData:
    """Return a lens of fx, fy, cx, cy [px] and OpenCV's distortion terms.

    Raises
    ------
    InputError
        If a focal length or a side of the photo is not above zero.
    """
    if not (min(focal) > 0 and min(size) > 0):
        raise InputError(
            f"{source}: focal lengths and size of the photo must be above zero [px], found "
            f"{', '.join(f'{v:g}' for v in (*focal, *size))}."
        )
    matrix = camera_matrix(focal[0], focal[1] / focal[0], *centre)
    model = "fisheye" if fisheye else "opencv"
    return LensData(matrix, np.array(terms, dtype=float), model, (size[0], size[1]), source)
