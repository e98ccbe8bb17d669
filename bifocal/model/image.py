"""The pixels of a photo: what every picture that is measured or projected must be."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from photocore.arrays import BoolArray, ByteArray, Float32Array
from photocore.errors import InputError
from photocore.large_photos import ROWS, LargePhoto, Pixels

#: Contrast is looked for in a photo blurred by so much, within a window of so many pixels. [px]
QUIET_BLUR, CONTRAST_WINDOW = 1.0, (15, 15)

#: 8 or 16 bits, shape (h, w, 3) or (h, w).
ImageArray = NDArray[Any]


def as_photo(
    image: NDArray[Any],
    name: str = "image",
    *,
    smallest: int = 2,
    fault: str = "is not a photo; check the file.",
) -> ImageArray:
    """Return an array that is a photo: 8 or 16 bits, grey or RGB; alpha is dropped.

    Parameters
    ----------
    image : ndarray of uint8 or uint16, shape (h, w) or (h, w, 1, 3 or 4)
    name : str
        What to call it.
    smallest : int
        Pixels a side that are needed. [px]
    fault : str
        What is wrong with a smaller one.

    Raises
    ------
    InputError
        If it is none.
    """
    array = np.asarray(image)
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (1, 3, 4)):
        raise InputError(f"{name}: expected shape (h, w) or (h, w, 3), found {array.shape}.")
    if array.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"{name}: expected 8 or 16 bits per channel (uint8, uint16), found {array.dtype}."
        )
    if min(array.shape[:2]) < smallest:
        raise InputError(f"{name}: {array.shape[1]} x {array.shape[0]} px {fault}")
    if array.ndim == 3:
        array = array[:, :, 0] if array.shape[2] == 1 else array[:, :, :3]
    return np.ascontiguousarray(array)


def as_grey(image: Pixels, name: str) -> ByteArray:
    """Return a photo as 8-bit grey values, shape (height, width); a large one is read by windows.

    Raises
    ------
    InputError
        If it is not an image of 8 or 16 bits, or smaller than 16 pixels a side.
    """
    if isinstance(image, LargePhoto):
        grey = np.empty(image.shape[:2], np.uint8)
        for top in range(0, len(grey), ROWS):
            grey[top : top + ROWS] = _grey(image[top : top + ROWS, :])
        return grey
    small = "is too small; at least 16 px a side are needed."
    return _grey(as_photo(image, name, smallest=16, fault=small))


def _grey(array: ImageArray) -> ByteArray:
    """Return the mean of the channels in 8 bits."""
    if array.dtype == np.uint16:
        # Cut, not rounded: grey values of 8 bits come back exact whether 256 or 257 widened them.
        array = (array >> 8).astype(np.uint8)
    # The plain mean of the channels has less noise than the luminance, which is mostly green.
    return array if array.ndim == 2 else cv2.transform(array, np.full((1, 3), 1 / 3))


def local_contrast(image: ByteArray | Float32Array) -> Float32Array:
    """Return the standard deviation within 15 px of a photo blurred by a pixel. [grey levels]"""
    quiet = cv2.GaussianBlur(image.astype(np.float32), (0, 0), QUIET_BLUR)
    mean = cv2.blur(quiet, CONTRAST_WINDOW)
    square = cv2.blur(quiet * quiet, CONTRAST_WINDOW) - mean * mean
    return np.asarray(np.sqrt(np.maximum(square, 0)))


def noise(image: ByteArray | Float32Array, visible: BoolArray | None = None) -> float:
    """Return the noise of a photo (Immerkaer 1996, with the median for the mean). [grey levels]"""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
    second = cv2.filter2D(image, cv2.CV_32F, mask)
    second = second if visible is None else second[visible]
    # Six is the mask's norm; 1.4826 makes the median of |N(0, 1)| one. Rounding is noise, too.
    return max(1.4826 / 6 * float(np.median(np.abs(second))), 0.29)
