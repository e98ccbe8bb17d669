"""Photos of a project: grey values of the pixels as stored, which is what image points count."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from photocore.arrays import ByteArray
from photocore.errors import InputError
from photocore.textfile import readable


def read_photo(path: Path) -> ByteArray:
    """Return a photo as grey values, shape (rows, columns).

    Raises
    ------
    InputError
        If it is missing or no image.
    """
    from PIL import Image, UnidentifiedImageError

    with readable(path, "photo", missing="image"):
        try:
            with Image.open(path) as image:
                return np.asarray(image.convert("L"), dtype=np.uint8)
        except (UnidentifiedImageError, SyntaxError, ValueError) as error:
            raise InputError(f"{path}: is no image that can be read ({error}).") from None
        except OSError as error:
            if error.errno is not None:
                raise
            raise InputError(f"{path}: is no image that can be read ({error}).") from None
