"""GeoTIFF in the plane frame, read and written window by window; the half-pixel shift lives here.

GeoTIFF speaks of pixel corners and this package of pixel centres. Rasters lie in a local
engineering system in metres, so GIS programs put them neither on the equator nor in the sea.
"""

from __future__ import annotations

import contextlib
import shutil
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality, ReliefMap
from photocore.errors import InputError
from photocore.output import atomic_path, check_writable
from photocore.raster import written_whole

#: Side of a tile of the file; GDAL's and most viewers' sweet spot. [px]
BLOCK = 512
#: GDAL keeps no more than this of a raster in memory; its own default is 5 % of the machine. [MB]
CACHE_MB = 96
#: Name of the local system every raster is in.
LOCAL_CRS = (
    'LOCAL_CS["{name}",UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["X",EAST],AXIS["Y",NORTH]]'
)
#: Descriptions of the bands of a relief map.
RELIEF_BANDS = (
    "relief [m]",
    "sigma [m]",
    "quality (1 measured, 2 interpolated, 3 hidden, 0 unknown)",
)
#: Metres per unit of the DPI tag.
METRES_PER_INCH = 0.0254


class RasterReader:
    """An open raster; `read` returns windows, also such that reach beyond its edges.

    Attributes
    ----------
    path : Path
    grid : Grid
    bands : int
    dtype : numpy dtype
    names : tuple of str
        Band descriptions; empty text where there is none.
    tags : dict
        Metadata.
    """

    def __init__(self, path: Path | str) -> None:
        import rasterio
        from rasterio.enums import MaskFlags
        from rasterio.errors import NotGeoreferencedWarning, RasterioError

        self.path = Path(path)
        if self.path.is_dir():
            raise InputError(f"{self.path}: is a folder; name the raster file in it.")
        if not self.path.is_file():
            raise InputError(f"{self.path}: no such raster file.")
        self._stack = contextlib.ExitStack()
        self._stack.enter_context(_gdal())
        try:
            with warnings.catch_warnings():
                # `_grid_of` refuses a raster without position, in words the user understands.
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                self._file = self._stack.enter_context(rasterio.open(self.path))
        except RasterioError:
            self._stack.close()
            raise InputError(f"{self.path}: is not a raster file GDAL can read.") from None
        self.bands: int = self._file.count
        self.dtype = np.dtype(self._file.dtypes[0])
        self.names = tuple(name or "" for name in self._file.descriptions)
        self.tags: dict[str, str] = dict(self._file.tags())
        self.masked = MaskFlags.per_dataset in self._file.mask_flag_enums[0]
        try:
            self.grid = _grid_of(self._file, self.path)
        except InputError:
            self.close()
            raise

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
        from rasterio.windows import Window

        c0, r0 = max(column, 0), max(row, 0)
        c1, r1 = min(column + width, self.grid.width), min(row + height, self.grid.height)
        inside = c1 > c0 and r1 > r0
        window = Window(c0, r0, max(c1 - c0, 0), max(r1 - r0, 0))
        try:
            if mask:
                part = self._file.dataset_mask(window=window) if inside else None
                out = np.zeros((height, width), np.uint8)
            else:
                numbers = list(bands) if bands is not None else list(range(1, self.bands + 1))
                part = (
                    self._file.read(numbers, window=window).transpose(1, 2, 0) if inside else None
                )
                if part is not None and part.shape[:2] == (height, width):
                    return part
                out = np.full((height, width, len(numbers)), fill, self.dtype)
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot be read at column {c0}, row {r0}; the file is damaged "
                f"({error})."
            ) from error
        if part is not None:
            out[r0 - row : r1 - row, c0 - column : c1 - column] = part
        return out

    def read_floats(self, column: int, row: int, width: int, height: int) -> NDArray[np.float32]:
        """Return band 1 as float32 with NaN where there is no data, shape (height, width)."""
        block = self.read(column, row, width, height, bands=[1], fill=np.nan)[:, :, 0]
        values = np.asarray(block, dtype=np.float32)
        nodata = self._file.nodata
        if nodata is not None and not np.isnan(nodata):
            values = np.where(values == np.float32(nodata), np.float32(np.nan), values)
        if self.masked:
            valid = self.read(column, row, width, height, mask=True)
            values = np.where(valid > 0, values, np.float32(np.nan))
        return values

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

    def close(self) -> None:
        """Close the file."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class RasterWriter:
    """A GeoTIFF being written tile by tile; made by `create_raster`."""

    def __init__(self, file: Any, grid: Grid) -> None:
        self._file, self.grid = file, grid

    def write(
        self, array: NDArray[Any], *, column: int = 0, row: int = 0, mask: Any = None
    ) -> None:
        """Write a window of shape (h, w) or (h, w, bands), and its validity mask (h, w)."""
        from rasterio.windows import Window

        block = array[:, :, None] if array.ndim == 2 else array
        window = Window(column, row, block.shape[1], block.shape[0])
        self._file.write(block.transpose(2, 0, 1), window=window)
        if mask is not None:
            self._file.write_mask(np.asarray(mask, dtype=bool), window=window)


@contextlib.contextmanager
def create_raster(
    path: Path | str,
    grid: Grid,
    *,
    bands: int,
    dtype: Any,
    overwrite: bool = False,
    names: Sequence[str] = (),
    colour: bool = False,
    nodata: float | None = None,
    dpi: float | None = None,
    crs_name: str = "Facade plane",
    tags: dict[str, str] | None = None,
    overviews: bool = False,
    world_file: bool = False,
) -> Iterator[RasterWriter]:
    """Yield a writer of a tiled, losslessly compressed GeoTIFF; whole or not at all.

    Parameters
    ----------
    names : sequence of str
        Band descriptions.
    colour : bool
        The first three bands are red, green, blue.
    dpi : float, optional
        Resolution tag for print and CAD.
    overviews : bool
        Reduced copies inside the file for fast display.
    world_file : bool
        Also write the ``.tfw`` beside it.

    Raises
    ------
    InputError
        If the place is not writable, the file exists, or the disk is full.
    """
    import rasterio
    from rasterio.crs import CRS

    path = check_writable(path, overwrite=overwrite)
    world = path.with_suffix(".tfw")
    if world_file:
        check_writable(world, overwrite=overwrite)
    _check_space(path, grid, bands * np.dtype(dtype).itemsize)
    options = {
        "driver": "GTiff",
        "width": grid.width,
        "height": grid.height,
        "count": bands,
        "dtype": np.dtype(dtype).name,
        "crs": CRS.from_wkt(LOCAL_CRS.format(name=crs_name.replace('"', "'"))),
        "transform": _corner_transform(grid),
        "nodata": nodata,
        "tiled": True,
        "blockxsize": BLOCK,
        "blockysize": BLOCK,
        "interleave": "pixel" if colour else "band",
        "compress": "deflate",
        "predictor": 3 if np.dtype(dtype).kind == "f" else 2,
        # libdeflate's fastest level: twice the speed of level 4 for 4 % more bytes on photographs.
        "zlevel": 1,
        "bigtiff": "IF_SAFER",
    }
    if colour:
        options["photometric"] = "RGB"
    with atomic_path(path, overwrite=overwrite) as temporary, _gdal():
        try:
            with written_whole(temporary, width=grid.width, height=grid.height, bands=bands):
                with rasterio.open(temporary, "w", **options) as file:
                    if dpi is not None:
                        file.update_tags(
                            TIFFTAG_XRESOLUTION=f"{dpi:.10g}",
                            TIFFTAG_YRESOLUTION=f"{dpi:.10g}",
                            TIFFTAG_RESOLUTIONUNIT="2",
                        )
                    file.update_tags(TIFFTAG_SOFTWARE="bifocal", **(tags or {}))
                    for number, name in enumerate(names, start=1):
                        file.set_band_description(number, name)
                    yield RasterWriter(file, grid)
                if overviews:
                    _add_overviews(
                        temporary, grid, categories=not colour and np.dtype(dtype).kind == "u"
                    )
        finally:
            for extra in (".ovr", ".msk", ".aux.xml"):
                temporary.with_name(temporary.name + extra).unlink(missing_ok=True)
    if world_file:
        write_world_file(world, grid, overwrite=overwrite)


def write_world_file(path: Path | str, grid: Grid, *, overwrite: bool = False) -> None:
    """Write A, D, B, E, C, F: pixel size and the centre of the top-left pixel. [m]"""
    values = (grid.gsd, 0.0, 0.0, -grid.gsd, grid.x0, grid.y0)
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text("".join(f"{value:.12f}\n" for value in values), encoding="ascii")


def dpi_at_scale(gsd: float, scale: float) -> float:
    """Return the dots per inch at which a raster prints at 1:scale.

    Examples
    --------
    >>> round(dpi_at_scale(0.005, 50), 9)
    254.0
    """
    return METRES_PER_INCH * scale / gsd


def gsd_at_scale(dpi: float, scale: float) -> float:
    """Return the pixel size that gives ``dpi`` on paper at 1:scale. [m]

    Examples
    --------
    >>> round(gsd_at_scale(254, 50), 9)
    0.005
    """
    return METRES_PER_INCH * scale / dpi


def write_relief(
    path: Path | str,
    relief: ReliefMap,
    *,
    overwrite: bool = False,
    overviews: bool = False,
    tags: dict[str, str] | None = None,
) -> None:
    """Write a relief map: relief, sigma, quality; NaN where unknown."""
    grid = relief.grid
    with create_raster(
        path,
        grid,
        bands=3,
        dtype=np.float32,
        overwrite=overwrite,
        names=RELIEF_BANDS,
        nodata=float("nan"),
        overviews=overviews,
        tags=tags,
    ) as writer:
        for column, row, part in grid.tiles(4 * BLOCK):
            cut = np.s_[row : row + part.height, column : column + part.width]
            layers = (relief.r[cut], relief.sigma[cut], relief.quality[cut])
            block = np.stack([np.asarray(layer, np.float32) for layer in layers], axis=-1)
            writer.write(block, column=column, row=row)


def read_relief(path: Path | str) -> ReliefMap:
    """Return a whole relief map; sigma and quality are filled in where the file lacks them.

    A file of one band is taken as exact: sigma 0, quality measured.
    """
    with RasterReader(path) as reader:
        check_relief(reader)
        size = (0, 0, reader.grid.width, reader.grid.height)
        r = reader.read_floats(*size)
        sigma, quality = (
            np.zeros_like(r),
            np.where(np.isnan(r), Quality.UNKNOWN, Quality.MEASURED).astype(np.uint8),
        )
        sigma[np.isnan(r)] = np.nan
        if reader.bands >= 2:
            sigma = np.asarray(reader.read(*size, bands=[2])[:, :, 0], np.float32)
        if reader.bands >= 3:
            band = np.asarray(reader.read(*size, bands=[3])[:, :, 0], np.float64)
            quality = np.nan_to_num(band).astype(np.uint8)
        return ReliefMap(
            r=r, sigma=sigma, quality=quality, plane_from_pixel=reader.grid.plane_from_pixel
        )


def check_relief(reader: RasterReader) -> None:
    """Refuse a raster that cannot be a relief map.

    Raises
    ------
    InputError
        If its first band is a picture.
    """
    if reader.dtype == np.uint8 or reader.dtype.kind not in "fiu":
        raise InputError(
            f"{reader.path}: band 1 is {reader.dtype}, a picture rather than relief in metres. "
            "Give the file written by `bifocal relief`."
        )


@contextlib.contextmanager
def _gdal() -> Iterator[None]:
    """Bound GDAL's cache; keep masks inside the file."""
    import rasterio

    with rasterio.Env(GDAL_CACHEMAX=CACHE_MB, GDAL_TIFF_INTERNAL_MASK=True, GDAL_PAM_ENABLED=False):
        yield


def _corner_transform(grid: Grid) -> Any:
    """Return the transform from pixel corners, GDAL's convention."""
    from rasterio.transform import Affine

    half = grid.gsd / 2
    return Affine(grid.gsd, 0.0, grid.x0 - half, 0.0, -grid.gsd, grid.y0 + half)


def _grid_of(file: Any, path: Path) -> Grid:
    """Return the grid of an open raster from its corner transform."""
    t = file.transform
    if t.is_identity:
        raise InputError(
            f"{path}: says nothing about where it lies (no GeoTIFF tags, no world file). "
            "Put its .tfw beside it, or make it again with this program."
        )
    centre = np.array([[t.a, t.b, t.c + (t.a + t.b) / 2], [t.d, t.e, t.f + (t.d + t.e) / 2]])
    try:
        return Grid.from_affine(centre, (file.height, file.width))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _add_overviews(path: Path, grid: Grid, *, categories: bool) -> None:
    """Add halved copies down to one tile."""
    import rasterio
    from rasterio.enums import Resampling

    factors: list[int] = []
    while max(grid.width, grid.height) / 2 ** len(factors) > BLOCK:
        factors.append(2 ** (len(factors) + 1))
    if not factors:
        return
    method = Resampling.nearest if categories else Resampling.average
    with (
        rasterio.Env(COMPRESS_OVERVIEW="DEFLATE", PREDICTOR_OVERVIEW="2", ZLEVEL_OVERVIEW="1"),
        rasterio.open(path, "r+") as file,
    ):
        file.build_overviews(factors, method)


def _check_space(path: Path, grid: Grid, bytes_per_pixel: int) -> None:
    """Refuse before the work when the disk cannot even hold a well compressed result."""
    # Photographs deflate to 30-45 %; a tenth is what no real one undercuts.
    needed = grid.width * grid.height * bytes_per_pixel // 10
    free = shutil.disk_usage(path.parent).free
    if needed > free:
        raise InputError(
            f"{path}: {grid.width} x {grid.height} px need more than {needed / 1e9:.1f} GB and "
            f"{free / 1e9:.1f} GB are free. Choose another disk, a coarser --gsd or --bounds."
        )
