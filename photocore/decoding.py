"""Pixels of a file's bytes: what a decoder says of damage names the file, and is believed."""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from photocore import interrupts
from photocore.arrays import ByteArray
from photocore.errors import InputError

_ONE_AT_A_TIME = threading.RLock()
#: What is said of pixels that are not those of the photo; not stray bytes between headers.
_DAMAGE = re.compile(
    r"(JPEG data: (?!\d+ extraneous bytes before marker 0x(?!d\d))|Premature end"
    r"|TIFF_Error .*(?:scanline|strip|tile)).*"
)
#: So many zeros in a row are a hole in the data. [bytes]
_LOST = 16
_STRAY = re.compile(r"(\d+) extraneous bytes before marker 0xd9")


def decoded(path: Path | str, data: ByteArray, flags: int) -> NDArray[Any]:
    """Return the pixels of a photo's bytes as OpenCV decodes them, stored orientation, BGR.

    Raises
    ------
    InputError
        If they cannot be decoded, or a part of them is damaged.
    """
    hole = ""
    if _is_jpeg(data):
        if data.tobytes().rfind(b"\xff\xd9") < len(data) // 2:
            # OpenCV fills the rest with grey, silently.
            raise InputError(f"{path}: the photo is cut off (no end of image); copy it again.")
        hole = _hole(data.tobytes())
    with decoders_words() as words:
        try:
            image = cv2.imdecode(data, flags)
        except cv2.error as error:
            raise InputError(f"{path}: the image cannot be decoded ({error.err}).") from error
    if image is None:
        raise InputError(f"{path}: the image cannot be decoded; open it and save it again.")
    damage = next((found[0] for word in words if (found := _DAMAGE.search(word))), hole)
    if damage and not _is_padded(data, damage):
        raise InputError(
            f"{path}: the photo is damaged ({damage}): a part of it is dark, shifted or missing. "
            "Copy it from the camera again. If there is no better copy, look at it in a picture "
            "program and save it anew from there."
        )
    return image


def refuse_damaged_jpeg(path: Path) -> None:
    """Refuse what `decoded` would refuse in a JPEG, in half its time and no memory.

    Raises
    ------
    InputError
    """
    data = np.fromfile(path, dtype=np.uint8)
    if _is_jpeg(data):
        decoded(path, data, cv2.IMREAD_REDUCED_GRAYSCALE_8)


def _is_jpeg(data: ByteArray) -> bool:
    return data[:2].tobytes() == b"\xff\xd8"


def _hole(data: bytes) -> str:
    """Return where bytes of a plain JPEG were lost; decoders take zeros for data, silently.

    Zeros are a block's coefficients of one value, -1, in a row: no photo has so many, unless the
    zeros of the table of luminance end a block, which is then flat.
    """
    at, zeros, parts = 2, 0, 0
    while data[at : at + 1] == b"\xff":
        kind, size = data[at + 1], int.from_bytes(data[at + 2 : at + 4])
        parts = data[at + 9] if kind in (0xC0, 0xC1) else parts
        # Progressive, or colours one by one: flat parts are zeros.
        if kind in (0xC2, 0xC6, 0xCA, 0xCE) or (kind == 0xDA and data[at + 4] != parts):
            return ""
        tables = data[at + 4 : at + 2 + size] if kind == 0xC4 else b""
        while len(tables) > 17:
            zeros = tables[17] if tables[0] == 0x10 else zeros
            tables = tables[17 + sum(tables[1:17]) :]
        at += 2 + size
        if kind == 0xDA:
            break
    end = data.find(b"\xff\xd9", at)
    lost = data.find(bytes(_LOST), at, end) if zeros else -1
    return f"bytes lost at {(lost - at) / (end - at):.0%} of its data" if lost >= 0 else ""


def _is_padded(data: ByteArray, damage: str) -> bool:
    """Tell whether the stray bytes before the end are padding: some cameras fill up."""
    stray = _STRAY.search(damage)
    end = data.tobytes().rfind(b"\xff\xd9") if stray else 0
    return stray is not None and np.ptp(data[max(end - int(stray[1]), 0) : end]) == 0


@contextmanager
def decoders_words() -> Iterator[list[str]]:
    """Keep from the terminal what libraries write there; it is in the list after the body."""
    words: list[str] = []
    with _ONE_AT_A_TIME, interrupts.held(), tempfile.TemporaryFile() as kept:
        try:
            terminal = os.dup(2)
        except OSError:  # a program without one
            yield words
            return
        os.dup2(kept.fileno(), 2)
        try:
            yield words
        finally:
            os.dup2(terminal, 2)
            kept.seek(0)
            lines = kept.readlines()
            with suppress(OSError):  # a progress bar of another thread
                os.write(terminal, b"".join(line for line in lines if b"\x1b" in line))
            os.close(terminal)
            words += [line.decode(errors="replace").strip() for line in lines]
