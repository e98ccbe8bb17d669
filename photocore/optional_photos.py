"""Photos that other libraries decode: HEIC of phones and camera raw (extra `photos`), AVIF."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photocore.errors import InputError, MissingExtraError

#: Endings of what phones write, and of AVIF, which Pillow decodes by itself.
HEIF_ENDINGS, AVIF_ENDINGS = frozenset({".heic", ".heif", ".hif"}), frozenset({".avif"})
_RAW = (
    ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .fff .iiq .kdc .mef .mos .mrw .nef .nrw .orf .pef "
    ".raf .raw .rw2 .rwl .sr2 .srf .srw .x3f"
)
RAW_ENDINGS = frozenset(_RAW.split())
#: What Pillow raises of a preview that is no picture, or whose EXIF data are damaged.
NO_PREVIEW = (OSError, SyntaxError, ValueError, struct.error)
#: How camera raw is developed: the same way for every photo, no brightness of its own.
DEVELOPED = {"use_camera_wb": True, "no_auto_bright": True, "output_bps": 16}


def open_heif(path: Path) -> None:
    """Let Pillow open HEIC.

    Raises
    ------
    MissingExtraError
        If its library is not installed.
    """
    try:
        import pillow_heif
    except ImportError:
        raise MissingExtraError(
            f"{path}: is HEIC, the format of phones, which can be saved as JPEG. Reading it",
            "photos",
        ) from None
    pillow_heif.register_heif_opener()


def pillow_pixels(path: Path) -> NDArray[np.uint8]:
    """Return the stored pixels of an image that Pillow decodes, RGB or grey."""
    from PIL import Image

    kind = "HEIF" if path.suffix.lower() in HEIF_ENDINGS else "AVIF"
    with Image.open(path, formats=(kind,)) as image:
        grey = image.mode in ("L", "1", "LA")
        return np.array(image.convert("L" if grey else "RGB"))


def raw_info(path: Path) -> tuple[tuple[int, int], Any]:
    """Return width and height of camera raw as developed, and the EXIF data of its preview.

    Raises
    ------
    InputError
        If its library is not installed, or does not know the file.
    """
    from PIL import Image

    with _raw(path) as raw:
        import rawpy

        sizes = raw.sizes
        size = (sizes.width, sizes.height)
        if sizes.flip & 4:
            size = size[::-1]
        exif: Any = {}
        try:
            preview = raw.extract_thumb()
            if isinstance(preview.data, bytes):
                exif = Image.open(io.BytesIO(preview.data), formats=("JPEG",)).getexif()
                exif.pop(274, None)  # it is developed upright
        except (rawpy.LibRawError, *NO_PREVIEW):
            exif = {}
    return size, exif


def raw_pixels(path: Path) -> NDArray[np.uint16]:
    """Return camera raw developed upright, shape (h, w, 3), 16 bit; raise as `raw_info`."""
    with _raw(path) as raw:
        return np.ascontiguousarray(raw.postprocess(**DEVELOPED))


def _raw(path: Path) -> Any:
    """Return an open raw file."""
    advice = (
        "Develop it to a 16-bit TIFF (or JPEG) without any lens correction, crop or straightening, "
        "the same way for both photos"
    )
    try:
        import rawpy
    except ImportError:
        raise MissingExtraError(
            f"{path}: is camera raw. {advice}; or let it be read as it is, which", "photos"
        ) from None
    try:
        return rawpy.imread(str(path))
    except (rawpy.LibRawError, OSError) as error:
        why = error.args[0] if error.args else error
        said = why.decode("ascii", "replace") if isinstance(why, bytes) else why
        raise InputError(f"{path}: this camera raw cannot be read ({said}). {advice}.") from None
