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
from photocore.remarks import remark

_ONE_AT_A_TIME = threading.RLock()
#: What is said of pixels that are not those of the photo; not stray bytes between headers.
_DAMAGE = re.compile(
    r"(JPEG data: (?!\d+ extraneous bytes before marker 0x(?!d\d))|Premature end"
    r"|TIFF_Error .*(?:scanline|strip|tile)).*"
)
#: What ends the data of a scan: no stuffed byte, no restart.
_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
#: So many zeros in a row are a hole in the data. [bytes]
_LOST = 16
#: A step in brightness of so many levels [0..255] where decoding resumed after so many groups of
#: blocks, with so many to both sides, of which this share steps by as much as the others, to this.
_STEP, _RESUMED, _FEWEST, _MOST, _ALIKE = 5.0, 5, 4, 0.5, 0.4
_STRAY = re.compile(r"(\d+) extraneous bytes before marker 0xd9")


def decoded(path: Path | str, data: ByteArray, flags: int) -> NDArray[Any]:
    """Return the pixels of a photo's bytes as OpenCV decodes them, stored orientation, BGR.

    Raises
    ------
    InputError
        If they cannot be decoded, or a part of them is damaged.
    """
    hole, cell = "", (0, 0)
    if _is_jpeg(data):
        packed = data.tobytes()
        # A film or zeros may follow the picture; its own end is where the markers lead.
        if packed.rfind(b"\xff\xd9") < len(data) // 2 and not _has_end(packed):
            # OpenCV fills the rest with grey, silently.
            raise InputError(f"{path}: the photo is cut off (no end of image); copy it again.")
        hole, cell = _hole(packed)
    with decoders_words() as words:
        try:
            image = cv2.imdecode(data, flags)
        except cv2.error as error:
            raise InputError(f"{path}: the image cannot be decoded ({error.err}).") from error
    if image is None:
        raise InputError(f"{path}: the image cannot be decoded; open it and save it again.")
    if not hole and cell[0] and not flags & cv2.IMREAD_REDUCED_GRAYSCALE_8:
        hole = _shifted(image, cell)
    damage = next((found[0] for word in words if (found := _DAMAGE.search(word))), hole)
    if damage and not _is_padded(data, damage):
        raise InputError(remark("photo.damaged", of=path, damage=damage))
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


def _has_end(data: bytes) -> bool:
    """Whether the segments and scans of a JPEG lead to its end of image."""
    at = 2
    while data[at : at + 1] == b"\xff":
        if data[at + 1 : at + 2] == b"\xd9":
            return True
        scan = data[at + 1 : at + 2] == b"\xda"
        at += 2 + int.from_bytes(data[at + 2 : at + 4])
        if scan:
            marker = _MARKER.search(data, at)
            at = marker.start() if marker else len(data)
    return False


def _shifted(image: NDArray[Any], cell: tuple[int, int]) -> str:
    """Return from where on a picture is brighter or darker than it was, as other bytes make it.

    Parameters
    ----------
    image : ndarray
    cell : tuple of int
        Width and height of what is decoded at once. [px]

    Notes
    -----
    Each block holds its difference in brightness from the one before. Where that is lost in row R
    and column C, all that follows differs by as much: there is a step above R right of C, and below
    R left of it, from one pixel to the next. No photo has both at the borders of blocks.
    """
    wide, high = cell
    rows, columns = image.shape[0] // high, image.shape[1] // wide
    if rows < 3:
        return ""
    whole = image[: rows * high, : columns * wide].reshape(rows * high, columns * wide, -1)
    edges = whole[high::high].astype(np.float32) - whole[high - 1 : -1 : high]
    edges = edges.reshape(rows - 1, columns, wide, -1).mean(axis=2)
    steps = np.median(edges[:-1] + edges[1:], axis=1)
    for row, colour in np.argwhere(np.abs(steps) > _STEP):
        above, below = edges[row : row + 2, :, colour] / steps[row, colour]
        column = int(np.clip(above - below, -1, 1).cumsum().argmin()) + 1
        right = column + _RESUMED
        if column < _FEWEST or columns - right < _FEWEST:
            continue
        parts = (above[right:], 1), (below[:column], 1), (above[:column], 0), (below[right:], 0)
        if min((np.abs(part - due) < _ALIKE).mean() for part, due in parts) > _MOST:
            return f"data changed at {(row + 1) / rows:.0%} of its height"
    return ""


def _hole(data: bytes) -> tuple[str, tuple[int, int]]:
    """Return where bytes of a plain JPEG were lost; decoders take zeros for data, silently.

    With width and height of what is decoded at once, 0 for other JPEGs.

    Zeros are a block's coefficients of one value, -1, in a row: no photo has so many, unless the
    zeros of the table of luminance end a block, which is then flat.
    """
    at, zeros, parts, cell = 2, 0, 0, (0, 0)
    while data[at : at + 1] == b"\xff":
        kind, size = data[at + 1], int.from_bytes(data[at + 2 : at + 4])
        if kind in (0xC0, 0xC1):
            parts, sampling = data[at + 9], data[at + 11]
            cell = (8 * (sampling >> 4), 8 * (sampling & 15)) if parts > 1 else (8, 8)
        # Progressive, or colours one by one: flat parts are zeros.
        if kind in (0xC2, 0xC6, 0xCA, 0xCE) or (kind == 0xDA and data[at + 4] != parts):
            return "", (0, 0)
        tables = data[at + 4 : at + 2 + size] if kind == 0xC4 else b""
        while len(tables) > 17:
            zeros = tables[17] if tables[0] == 0x10 else zeros
            tables = tables[17 + sum(tables[1:17]) :]
        at += 2 + size
        if kind == 0xDA:
            break
    end = data.find(b"\xff\xd9", at)
    lost = data.find(bytes(_LOST), at, end) if zeros else -1
    hole = f"bytes lost at {(lost - at) / (end - at):.0%} of its data" if lost >= 0 else ""
    return hole, cell


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
