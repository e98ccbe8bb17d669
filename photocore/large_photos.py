"""Photos too large to hold: the upright pixels of a TIFF, read where they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photocore.cli import Progress, no_progress
from photocore.colours import in_srgb
from photocore.decoding import decoders_words
from photocore.images import (
    TIFF_ENDINGS,
    ImageArray,
    ImageInfo,
    check_size,
    image_info,
    read_image,
    turn_upright,
    unused_bits,
)
from photocore.raster import RasterFile

#: TIFFs of more pixels are read by windows; below, decoding at once is quicker and small enough.
BY_WINDOWS = 100_000_000
#: So many rows at a time where all pixels are wanted. [px]
ROWS = 256
#: Changes pixels of the window with these rows and columns.
Change = Callable[[ImageArray, slice, slice], ImageArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LargePhoto:
    """The upright pixels of a large TIFF: ``photo[rows, columns]`` with two slices reads a window.

    It has an array's shape, ndim and dtype; `numpy.asarray` reads all of it.

    Attributes
    ----------
    path : Path
    shape : tuple of int
        Height and width [px], and 3 of colours.
    dtype : numpy dtype
        8 or 16 bits, unsigned.
    orientation : int
        EXIF orientation 1..8 of the stored pixels.
    stored : callable
        Returns those of a column, row, width and height, shape (height, width, bands).
    unused : int
        Bits of 16 that no pixel uses; they are filled as `read_image` does.
    changes : tuple of callable
        What is done to the pixels of each window, in this order.
    """

    path: Path
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    orientation: int
    stored: Callable[[int, int, int, int], NDArray[Any]]
    unused: int = 0
    changes: tuple[Change, ...] = ()

    @property
    def ndim(self) -> int:
        """Number of dimensions of ``shape``."""
        return len(self.shape)

    def changed(self, change: Change) -> LargePhoto:
        """Return the photo with one more change to its pixels, made when they are read."""
        return replace(self, changes=(*self.changes, change))

    def __getitem__(self, window: tuple[slice, slice]) -> ImageArray:
        """Return the pixels of a window, shape (h, w) or (h, w, 3)."""
        ranges = [
            range(size)[part] for size, part in zip(self.shape[:2], window, strict=True)
        ]  # rows, columns
        rows, columns = (slice(part.start, part.stop) for part in ranges)
        image = turn_upright(self._stored(*ranges), self.orientation)
        for change in self.changes:
            image = change(image, rows, columns)
        return image

    def _stored(self, rows: range, columns: range) -> ImageArray:
        """Return the stored pixels that upright rows and columns show; see `turn_upright`."""
        turn, (height, width) = self.orientation, self.shape[:2]
        if turn in (3, 4, 7, 8):
            rows = range(height - rows.stop, height - rows.start)
        if turn in (2, 3, 6, 7):
            columns = range(width - columns.stop, width - columns.start)
        if turn >= 5:
            rows, columns = columns, rows
        part = self.stored(columns.start, rows.start, len(columns), len(rows))
        image = part[:, :, 0] if self.ndim == 2 else in_srgb(self.path, part)
        return image << np.uint16(self.unused) if self.unused else image

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> ImageArray:
        """Return all pixels.

        Raises
        ------
        InputError
            If they are more than `MAX_PIXELS`.
        """
        check_size(self.path, (self.shape[1], self.shape[0]))
        image = np.empty(self.shape, self.dtype)
        for top in range(0, len(image), ROWS):
            image[top : top + ROWS] = self[top : top + ROWS, :]
        return image if dtype is None else image.astype(dtype, copy=False)


#: A photo as it is rendered: in memory, or read window by window.
Pixels = NDArray[Any] | LargePhoto


@contextmanager
def open_photo(path: Path | str, progress: Progress = no_progress) -> Iterator[Pixels]:
    """Yield a photo's pixels as `read_image` returns them, those of a large TIFF unread.

    Parameters
    ----------
    path : path
        Above 100 megapixels a TIFF, grey or RGB, is read where pixels are asked for.
    progress : callable
        Told how far a large photo of 16 bits is looked through for what it uses of them.

    Yields
    ------
    ndarray or LargePhoto, shape (h, w, 3) or (h, w)

    Raises
    ------
    InputError
        As `read_image`.
    """
    info = image_info(path)
    bands = _plain_bands(info)
    if not bands:
        yield read_image(path)
        return
    with RasterFile(info.path) as file:
        most = 0
        if info.bits == 16:  # how many of them are used, only all pixels tell
            for top in range(0, file.height, ROWS):
                part = file.read(0, top, file.width, min(ROWS, file.height - top), bands=bands)
                most = max(most, int(part.max()))
                progress(min(top + ROWS, file.height), file.height, info.path.name)
        yield LargePhoto(
            path=info.path, shape=(*info.size[::-1], *(3,) * (len(bands) > 1)), dtype=file.dtype,
            orientation=info.orientation, stored=partial(file.read, bands=bands),
            unused=unused_bits(info.path, most),
        )  # fmt: skip


def _plain_bands(info: ImageInfo) -> tuple[int, ...]:
    """Return the bands of a large TIFF whose stored numbers are grey or RGB; else none."""
    if info.path.suffix.lower() not in TIFF_ENDINGS or info.size[0] * info.size[1] <= BY_WINDOWS:
        return ()
    import tifffile

    with decoders_words(), tifffile.TiffFile(info.path) as tiff:
        page: Any = tiff.pages[0]
        grey = page.photometric == tifffile.PHOTOMETRIC.MINISBLACK and page.samplesperpixel == 1
        colour = page.photometric == tifffile.PHOTOMETRIC.RGB and page.samplesperpixel in (3, 4)
        plain = page.bitspersample in (8, 16) and np.dtype(page.dtype).kind == "u"
    if not plain:
        return ()
    return (1,) if grey else (1, 2, 3) if colour else ()
