"""Photos of a project: grey values of the pixels as stored, which is what image points count."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from photocore.arrays import ByteArray
from photocore.decoding import refuse_damaged_jpeg
from photocore.errors import InputError
from photocore.images import FORMATS
from photocore.textfile import readable


def read_photo(path: Path) -> ByteArray:
    """Return a photo as grey values, shape (rows, columns); more than eight bits are scaled down.

    Raises
    ------
    InputError
        If it is missing, no image, or of more pixels than any camera has.
    """
    from PIL import Image, UnidentifiedImageError

    with readable(path, "photo", missing="image"), warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        refuse_damaged_jpeg(path)
        try:
            with Image.open(path, formats=(*FORMATS, "PPM", "GIF")) as image:
                return _grey(image)
        except Image.DecompressionBombError:
            raise InputError(
                f"{path}: has more pixels than any camera; reduce it to the size of the sensor."
            ) from None
        except (UnidentifiedImageError, SyntaxError, ValueError) as error:
            raise InputError(f"{path}: is no image that can be read ({error}).") from None
        except OSError as error:
            if error.errno is not None:
                raise
            raise InputError(f"{path}: is no image that can be read ({error}).") from None


def _grey(image: Any) -> ByteArray:
    """Return the grey values of an image of Pillow's, which by itself cuts them off at 255."""
    if image.mode not in ("I", "F") and not image.mode.startswith("I;16"):
        return np.asarray(image.convert("L"), dtype=np.uint8)
    values = np.nan_to_num(np.asarray(image, dtype=np.float64))
    # Cameras of 10, 12 and 14 bits leave the upper ones of a 16-bit file empty.
    bits = int(max(values.max(initial=0.0), 255.0)).bit_length()
    return np.clip(values * (255.0 / (2**bits - 1)), 0, 255).astype(np.uint8)
