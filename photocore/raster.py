"""Rasters that are whole: what GDAL does not say when the disk is full."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def written_whole(path: Path, *, width: int, height: int, bands: int) -> Iterator[None]:
    """Check the GeoTIFF that the body writes; use it inside `photocore.output.atomic_path`.

    GDAL writes its last tiles when the file is closed, and then loses errors without a word: only
    the file itself tells whether it is whole.

    Parameters
    ----------
    path : Path
        The temporary file, closed by the end of the body.
    width, height, bands : int
        What it is to hold. [px, px, -]

    Raises
    ------
    OSError
        If GDAL reports a failed write, or the file is not whole as `check_whole` says.
    """
    from rasterio.errors import RasterioIOError

    try:
        yield
    except RasterioIOError as error:
        raise OSError("writing failed; is the disk full?") from error
    check_whole(path, width=width, height=height, bands=bands)


def check_whole(path: Path, *, width: int, height: int, bands: int) -> None:
    """Raise OSError unless every block of a GeoTIFF, reduced copies included, is in the file.

    Sizes and places of all blocks are compared with the length of the file; the block that lies
    last in it is unpacked.

    Parameters
    ----------
    path : Path
        A closed GeoTIFF.
    width, height, bands : int
        What it must hold. [px, px, -]
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    size = path.stat().st_size
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with rasterio.open(path) as file:
                found = (file.width, file.height, file.count)
                if found != (width, height, bands):
                    raise OSError(
                        f"the file is incomplete: {found[0]} x {found[1]} px in {found[2]} bands "
                        f"instead of {width} x {height} in {bands}"
                    )
                _check_blocks(file, size)
                levels = len(file.overviews(1))
            for level in range(levels):
                with rasterio.open(path, overview_level=level) as file:
                    _check_blocks(file, size)
    except RasterioError as error:
        raise OSError("the file is incomplete; is the disk full?") from error


def _check_blocks(file: Any, size: int) -> None:
    """Check one resolution of an open GeoTIFF of so many bytes."""
    last, place = -1, (1, 0, 0)
    # Where the bands lie pixel by pixel in the same blocks, the first stands for all.
    shared = str(file.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE", "")).lower() == "pixel"
    for band in range(1, 1 + (1 if shared else file.count)):
        high, wide = file.block_shapes[band - 1]
        for row in range(-(-file.height // high)):
            for column in range(-(-file.width // wide)):
                block = f"{column}_{row}"
                offset = file.get_tag_item(f"BLOCK_OFFSET_{block}", "TIFF", bidx=band)
                length = file.get_tag_item(f"BLOCK_SIZE_{block}", "TIFF", bidx=band)
                end = int(offset or 0) + int(length or 0)
                if not offset or not length or end > size:
                    raise OSError("the file is incomplete; is the disk full?")
                if end > last:
                    last, place = end, (band, row, column)
    band, row, column = place
    window = file.block_window(band, row, column)
    file.read(band, window=window)
    file.read_masks(band, window=window)
