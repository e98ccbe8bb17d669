"""The pixels of a photo: what every picture that is measured or projected must be."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from photocore.errors import InputError

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
