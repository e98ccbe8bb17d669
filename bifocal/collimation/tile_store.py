"""Tiles as the page asks for them: made once, kept on the disk beside the survey."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import cv2

from bifocal.collimation.pyramids import TILE, level_size, max_level
from photocore.arrays import ByteArray

#: JPEG quality of the full size, where edges are picked, and of the sizes above it.
FINE, COARSE = 95, 88


class TileSource(Protocol):
    """A picture that gives its tiles."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the full size. [px]"""

    def tile(self, level: int, column: int, row: int) -> ByteArray:
        """Return a tile, RGB or grey."""


@dataclass(slots=True)
class TileStore:
    """Pictures by name, and their tiles on the disk.

    Parameters
    ----------
    folder : Path
        Where tiles are kept; may be deleted at any time.
    """

    folder: Path
    _sources: dict[str, tuple[TileSource, str]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def register(self, name: str, source: TileSource, *facts: object) -> None:
        """Give a picture its name; ``facts`` are what its pixels depend on."""
        version = hashlib.sha256(repr(facts).encode()).hexdigest()[:16]
        with self._lock:
            before = self._sources.get(name)
            if before is not None and before[1] == version:
                return
            self._sources[name] = (source, version)
        kept = self.folder / name
        if kept.is_dir():
            for old in kept.iterdir():
                if old.name != version and re.fullmatch("[0-9a-f]{16}", old.name):  # ours
                    shutil.rmtree(old, ignore_errors=True)

    def forget(self, name: str) -> None:
        """Take a picture away."""
        self._sources.pop(name, None)

    def info(self, name: str) -> dict[str, object] | None:
        """Return what a viewer needs to know of a picture; None where there is none."""
        entry = self._sources.get(name)
        if entry is None:
            return None
        source, version = entry
        return {
            "width": source.size[0],
            "height": source.size[1],
            "tile": TILE,
            "max_level": max_level(source.size),
            "version": version,
        }

    def tile(self, name: str, level: int, column: int, row: int) -> tuple[bytes, str] | None:
        """Return a tile as JPEG and its version; None where there is none."""
        entry = self._sources.get(name)
        if entry is None or not 0 <= level <= max_level(entry[0].size):
            return None
        source, version = entry
        width, height = level_size(source.size, level)
        if not (0 <= column * TILE < width and 0 <= row * TILE < height):
            return None
        path = self.folder / name / version / str(level) / f"{column}_{row}.jpg"
        with contextlib.suppress(OSError):
            return path.read_bytes(), version
        data = _jpeg(source.tile(level, column, row), fine=level == max_level(source.size))
        _keep(path, data)
        return data, version


def _jpeg(image: ByteArray, *, fine: bool) -> bytes:
    pixels = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    options = [cv2.IMWRITE_JPEG_QUALITY, FINE if fine else COARSE]
    if fine:  # colour at full size: edges are picked on it
        options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    return cv2.imencode(".jpg", pixels, options)[1].tobytes()


def _keep(path: Path, data: bytes) -> None:
    """Keep a tile on the disk, whole or not at all; a full disk only costs time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            Path(name).replace(path)
        except OSError:
            Path(name).unlink(missing_ok=True)
    except OSError:
        return
