"""GeoTIFF read and written window by window, whole or not at all; the half-pixel shift lives here.

GDAL counts from pixel corners, these packages from pixel centres. Nor does GDAL say when the disk
is full: every raster is checked whole before it takes the old one's place.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.output import is_virtual
from photocore.provenance import note, provenance
from photocore.raster_places import (
    copy_optimised,
    gdal_name,
    is_cloud_optimised,
    raster_place,
    why_unreadable,
)
from photocore.remarks import remark
from photocore.textfile import check_file, check_name

#: Side of a tile of the file; GDAL's and most viewers' sweet spot. [px]
BLOCK = 512
#: GDAL keeps no more than this of rasters in memory; its own default is 5 % of the machine.
#: Rasterio takes bytes, where GDAL takes small numbers for megabytes. [bytes]
CACHE = 96 << 20


class Window(NamedTuple):
    """Part of a raster; it may reach beyond the edges. [px]"""

    column: int
    row: int
    width: int
    height: int

    def widened(self, margin: int) -> Window:
        """Return the window with so many pixels more on every side."""
        column, row, width, height = self
        return Window(column - margin, row - margin, width + 2 * margin, height + 2 * margin)


class RasterFile(ExitStack):
    """An open raster; windows may reach beyond its edges. Closed by ``with`` or `close`.

    Parameters
    ----------
    path : path
        Any format GDAL reads.
    nodata : float, optional
        Value of empty pixels, besides the one the file declares.

    Attributes
    ----------
    path : Path
    width, height, bands : int
    dtype : numpy dtype
    names : tuple of str
        Band descriptions; empty text where there is none.
    tags : dict
        Metadata.
    masked : bool
        Whether the file has a validity mask.
    nodata : float or None
        The value given, else the one declared.
    crs : object or None
        Coordinate reference system.
    transform : Affine
        From pixel corners, GDAL's convention.
    has_position : bool
        Whether the file says where it lies.
    xy_from_pixel : ndarray, shape (2, 3)
        Affine map from (column, row, 1), integers at pixel centres, to (X, Y).

    Raises
    ------
    InputError
        If it is missing or no raster.
    """

    def __init__(self, path: Path | str, *, nodata: float | None = None) -> None:
        import rasterio
        from rasterio.enums import MaskFlags
        from rasterio.errors import RasterioError, RasterioIOError

        super().__init__()
        self.path = Path(path)
        if is_virtual(self.path):
            check_name(self.path)
        else:
            check_file(self.path, "raster file", folder="; name the raster file in it.")
        self.enter_context(rasterio.Env(GDAL_CACHEMAX=CACHE))
        try:
            file = self._file = self.enter_context(_opened(self.path))
        except (RasterioError, RasterioIOError) as error:  # one of the other from 1.4 on
            self.close()
            raise InputError(f"{self.path}: {why_unreadable(self.path, error)}") from None
        note(self.path)
        self.width, self.height, self.bands = int(file.width), int(file.height), int(file.count)
        self.dtype = np.dtype(file.dtypes[0])
        self.names = tuple(name or "" for name in file.descriptions)
        self.tags: dict[str, str] = dict(file.tags())
        self.masked = MaskFlags.per_dataset in file.mask_flag_enums[0]
        self._empty = [float(value) for value in (nodata, file.nodata) if value is not None]
        self.nodata = self._empty[0] if self._empty else None
        self.crs, self.transform = file.crs, file.transform
        self.has_position = not self.transform.is_identity
        self.xy_from_pixel = centre_matrix(self.transform)

    def read(
        self,
        column: int,
        row: int,
        width: int,
        height: int,
        *,
        bands: Sequence[int] | None = None,
        fill: float = 0.0,
        mask: bool = False,
    ) -> NDArray[Any]:
        """Return a window, shape (height, width, bands); what lies outside is ``fill``.

        Parameters
        ----------
        bands : sequence of int, optional
            Numbers from 1; all by default.
        mask : bool
            Return the validity mask instead (255 valid, 0 not), shape (height, width).
        """
        window = Window(column, row, width, height)
        if mask:
            return self._padded(window, self._file.dataset_mask, np.zeros((), np.uint8))
        numbers = list(bands or range(1, self.bands + 1))
        outside = np.full((len(numbers), 1, 1), fill, self.dtype)
        part = self._padded(window, partial(self._file.read, numbers), outside)
        return part.transpose(1, 2, 0)

    def read_floats(
        self, column: int, row: int, width: int, height: int, *, dtype: Any = np.float32
    ) -> NDArray[Any]:
        """Return band 1 as floats, NaN where there is no data, shape (height, width)."""

        def known(window: Any) -> NDArray[Any]:
            block = self._file.read(1, window=window)
            with np.errstate(invalid="ignore", over="ignore"):  # what float32 cannot hold
                values = block.astype(dtype)
                for empty in self._empty:
                    values[block == empty] = np.nan
            if self.masked:
                values[self._file.dataset_mask(window=window) == 0] = np.nan
            return values

        return self._padded(Window(column, row, width, height), known, np.full((), np.nan, dtype))

    def _padded(
        self, window: Window, fetch: Callable[..., NDArray[Any]], outside: NDArray[Any]
    ) -> NDArray[Any]:
        """Return fetch(window=...), shape (..., height, width); ``outside`` beyond the edges."""
        from rasterio.windows import Window as RasterWindow

        column, row, width, height = window
        c0, c1 = max(column, 0), min(column + width, self.width)
        r0, r1 = max(row, 0), min(row + height, self.height)
        whole = np.broadcast_to(outside, (*outside.shape[:-2], height, width))
        if c1 <= c0 or r1 <= r0:
            return whole.copy()
        try:
            part = fetch(window=RasterWindow(c0, r0, c1 - c0, r1 - r0))
        except OSError as error:
            raise InputError(
                remark("raster.unreadable", of=self.path, c0=c0, r0=r0, error=error)
            ) from error
        if part.shape == whole.shape:
            return part
        padded = whole.copy()
        padded[..., r0 - row : r1 - row, c0 - column : c1 - column] = part
        return padded

    def read_reduced(
        self, width: int, height: int, *, bands: Sequence[int]
    ) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the whole raster shrunk, shape (height, width, bands), and where it is valid."""
        from rasterio.enums import Resampling

        shape = (len(bands), height, width)
        try:
            image = self._file.read(list(bands), out_shape=shape, resampling=Resampling.average)
            mask = self._file.dataset_mask(out_shape=(height, width))
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({error}).") from error
        return image.transpose(1, 2, 0), mask > 0


def _opened(path: Path, mode: str = "r", **options: Any) -> Any:
    """Return an open raster, without the warning that it has no position."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        return rasterio.open(gdal_name(path), mode, **options)


class RasterWriter:
    """A GeoTIFF being written window by window; made by `create_geotiff`."""

    def __init__(self, file: Any) -> None:
        self._file = file

    @property
    def pixels(self) -> int:
        """How many pixels the whole raster has."""
        return int(self._file.width * self._file.height)

    def write(
        self, array: NDArray[Any], *, column: int = 0, row: int = 0, mask: Any = None
    ) -> None:
        """Write a window of shape (h, w) or (h, w, bands), and its validity mask (h, w)."""
        from rasterio.windows import Window as RasterWindow

        block = array[:, :, None] if array.ndim == 2 else array
        window = RasterWindow(column, row, block.shape[1], block.shape[0])
        self._file.write(block.transpose(2, 0, 1), window=window)
        if mask is not None:
            self._file.write_mask(np.asarray(mask, dtype=bool), window=window)

    def tag(self, **tags: str) -> None:
        """Add metadata that is known only when all is written."""
        self._file.update_tags(**tags)


@contextmanager
def create_geotiff(
    path: Path | str,
    *,
    width: int,
    height: int,
    bands: int,
    dtype: DTypeLike,
    transform: Any = None,
    crs: Any = None,
    nodata: float | None = None,
    names: Sequence[str] = (),
    tags: Mapping[str, str] | None = None,
    colour: bool = False,
    overviews: bool = False,
    overwrite: bool = False,
) -> Iterator[RasterWriter]:
    """Yield a writer of a tiled, losslessly compressed GeoTIFF; whole or not at all.

    Parameters
    ----------
    transform : Affine, optional
        From pixel corners, see `corner_transform`; None: the raster lies nowhere.
    names : sequence of str
        Band descriptions.
    tags : mapping of str to str
        Metadata; those named ``TIFFTAG_...`` become tags of the TIFF itself.
    colour : bool
        The first three bands are red, green, blue.
    overviews : bool
        Reduced copies inside the file for fast display.

    Raises
    ------
    InputError
        If the place is not writable, the file exists, or the disk is full.
    """
    import rasterio

    kind = np.dtype(dtype)
    options = {
        "driver": "GTiff", "width": width, "height": height, "count": bands, "dtype": kind.name,
        "crs": crs, "transform": transform, "nodata": nodata,
        "tiled": True, "blockxsize": BLOCK, "blockysize": BLOCK,
        "interleave": "pixel" if colour else "band", "bigtiff": "IF_SAFER",
        # libdeflate's fastest level: twice the speed of level 4 for 4 % more bytes on photographs.
        "compress": "deflate", "zlevel": 1, "predictor": 3 if kind.kind == "f" else 2,
    } | ({"photometric": "RGB"} if colour else {})  # fmt: skip
    # Masks lie inside the file, and nothing beside it.
    gdal = rasterio.Env(GDAL_CACHEMAX=CACHE, GDAL_TIFF_INTERNAL_MASK=True, GDAL_PAM_ENABLED=False)
    cog = is_cloud_optimised()
    with raster_place(Path(path), overwrite=overwrite) as temporary, gdal:
        # A cloud-optimised file is a copy: what comes first in it is known last.
        plain = temporary.with_name(f"{temporary.name}.plain.tif") if cog else temporary
        try:
            with written_whole(temporary, width=width, height=height, bands=bands):
                with _opened(plain, "w", **options) as file:
                    file.update_tags(**_provenance_tags(), **(tags or {}))
                    for number, name in enumerate(names, start=1):
                        file.set_band_description(number, name)
                    yield RasterWriter(file)
                categories = not colour and kind.kind == "u"
                if cog:
                    # What a full disk swallowed would be copied as empty blocks.
                    check_whole(plain, width=width, height=height, bands=bands)
                    copy_optimised(plain, temporary, options, block=BLOCK, categories=categories)
                elif overviews:
                    _add_overviews(temporary, max(width, height), categories=categories)
        finally:
            if cog:
                plain.unlink(missing_ok=True)
            for extra in (".ovr", ".msk", ".aux.xml"):
                temporary.with_name(temporary.name + extra).unlink(missing_ok=True)


def _provenance_tags() -> dict[str, str]:
    """Return program, date, command and inputs as metadata of a raster."""
    made = provenance()
    tags = {"TIFFTAG_SOFTWARE": made.program, "BIFOCAL_DATE": made.date}
    if made.command:
        tags["BIFOCAL_COMMAND"] = made.command
    if made.inputs:
        tags["BIFOCAL_SOURCES"] = json.dumps(made.to_dict()["inputs"], ensure_ascii=False)
    return tags


def _add_overviews(path: Path, side: int, *, categories: bool) -> None:
    """Add halved copies down to one tile."""
    import rasterio
    from rasterio.enums import Resampling

    factors: list[int] = []
    while side / 2 ** len(factors) > BLOCK:
        factors.append(2 ** (len(factors) + 1))
    if not factors:
        return
    method = Resampling.nearest if categories else Resampling.average
    with (
        rasterio.Env(COMPRESS_OVERVIEW="DEFLATE", PREDICTOR_OVERVIEW="2", ZLEVEL_OVERVIEW="1"),
        rasterio.open(path, "r+") as file,
    ):
        file.build_overviews(factors, method)


def centre_matrix(transform: Any) -> FloatArray:
    """Return the map from (column, row, 1), integers at pixel centres, to (X, Y), shape (2, 3).

    Examples
    --------
    >>> from rasterio import Affine
    >>> print(centre_matrix(Affine(2, 0, 10, 0, -2, 50)))
    [[ 2.  0. 11.]
     [ 0. -2. 49.]]
    """
    return _moved(np.reshape(tuple(transform)[:6], (2, 3)), 0.5)


def corner_transform(xy_from_pixel: FloatArray) -> Any:
    """Return GDAL's transform of a map from pixel centres, the inverse of `centre_matrix`."""
    from rasterio import Affine

    return Affine(*_moved(xy_from_pixel[:2], -0.5).ravel().tolist())


def _moved(matrix: FloatArray, step: float) -> FloatArray:
    """Return a map, shape (2, 3), that counts from places so many pixels right and down."""
    return matrix @ np.array([[1.0, 0.0, step], [0.0, 1.0, step], [0.0, 0.0, 1.0]])


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
    from rasterio._err import CPLE_BaseError  # of building overviews
    from rasterio.errors import RasterioIOError

    try:
        yield
    except (RasterioIOError, CPLE_BaseError) as error:
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
    from rasterio.errors import RasterioError, RasterioIOError

    size = path.stat().st_size
    try:
        with _opened(path) as file:
            shape = (file.width, file.height, file.count)
            if shape != (width, height, bands):
                raise OSError(
                    f"the file is incomplete: {shape[0]} x {shape[1]} px in {shape[2]} bands "
                    f"instead of {width} x {height} in {bands}"
                )
            _check_blocks(file, size)
            levels = len(file.overviews(1))
        for level in range(levels):
            with _opened(path, overview_level=level) as file:
                _check_blocks(file, size)
    except (RasterioError, RasterioIOError) as error:
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
