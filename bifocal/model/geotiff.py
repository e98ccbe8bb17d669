"""GeoTIFF in the plane frame: rasters of `photocore.raster` whose pixels are a `Grid`.

Rasters lie in a local engineering system in metres, so GIS programs put them neither on the
equator nor in the sea.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import DTypeLike

from bifocal.model.grid import Grid
from bifocal.remarks import remark
from photocore.arrays import Float32Array
from photocore.errors import InputError
from photocore.output import all_or_none, atomic_path, check_all_writable, is_virtual
from photocore.raster import RasterFile, RasterWriter, corner_transform, create_geotiff

#: Name of the local system every raster is in.
LOCAL_CRS = (
    'LOCAL_CS["{name}",UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["X",EAST],AXIS["Y",NORTH]]'
)
#: Descriptions of the bands of a relief map.
RELIEF_BANDS = (
    "relief [m]",
    "sigma [m]",
    "quality (1 measured, 2 interpolated, 3 hidden, 4 drawn, 0 unknown)",
)
#: Metres per unit of the DPI tag.
METRES_PER_INCH = 0.0254


class RasterReader(RasterFile):
    """An open raster of the plane frame.

    Attributes
    ----------
    grid : Grid

    Raises
    ------
    InputError
        As `RasterFile`, and if its place is not known or its pixels are no `Grid`.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__(path)
        try:
            if not self.has_position:
                raise InputError(remark("raster.nowhere"))
            self.grid = Grid.from_affine(self.xy_from_pixel, (self.height, self.width))
        except InputError as error:
            self.close()
            raise InputError(f"{self.path}: {error}") from None

    def nearest(self, grid: Grid, *, bands: Sequence[int]) -> Float32Array:
        """Return bands at a grid's pixels, each from the nearest pixel, shape (h, w, bands).

        0 beyond the raster's edges.
        """
        import cv2

        window, columns, rows = grid.resampling(self.grid, 1)
        patch = np.asarray(self.read(*window, bands=list(bands)), np.float32)
        values = cv2.remap(patch, columns, rows, cv2.INTER_NEAREST)
        return np.asarray(values.reshape(*grid.shape, len(bands)), np.float32)


@contextmanager
def create_raster(
    path: Path | str,
    grid: Grid,
    *,
    bands: int,
    dtype: DTypeLike,
    names: Sequence[str] = (),
    colour: bool = False,
    nodata: float | None = None,
    overviews: bool = False,
    dpi: float | None = None,
    crs_name: str = "Facade plane",
    tags: Mapping[str, str] | None = None,
    world_file: bool = False,
    overwrite: bool = False,
) -> Iterator[RasterWriter]:
    """Yield a writer of a GeoTIFF that fills a grid; whole or not at all.

    Parameters
    ----------
    bands, dtype, names, colour, nodata, overviews
        As for `photocore.raster.create_geotiff`.
    dpi : float, optional
        Resolution tag for print and CAD.
    crs_name : str
        Name of the local system.
    world_file : bool
        Also write the ``.tfw`` beside it.

    Raises
    ------
    InputError
        If the place is not writable, the file exists, or the disk is full.
    """
    from rasterio.crs import CRS

    path = Path(path)
    world = path.with_suffix(".tfw")
    check_all_writable(path, world if world_file else None, overwrite=overwrite)
    if not is_virtual(path):
        _check_space(path, grid, bands * np.dtype(dtype).itemsize)
    entries = dict(tags or {})
    if dpi is not None:
        entries |= {f"TIFFTAG_{axis}RESOLUTION": f"{dpi:.10g}" for axis in "XY"}
        entries["TIFFTAG_RESOLUTIONUNIT"] = "2"
    with all_or_none():
        with create_geotiff(
            path, width=grid.width, height=grid.height, bands=bands, dtype=dtype, names=names,
            colour=colour, nodata=nodata, overviews=overviews, overwrite=overwrite, tags=entries,
            crs=CRS.from_wkt(LOCAL_CRS.format(name=_printable(crs_name))),
            transform=corner_transform(grid.plane_from_pixel),
        ) as writer:  # fmt: skip
            yield writer
        if world_file:
            # A, D, B, E, C, F: pixel size and the centre of the top-left pixel.
            values = (grid.gsd, 0.0, 0.0, -grid.gsd, grid.x0, grid.y0)
            with atomic_path(world, overwrite=overwrite) as temporary:
                text = "".join(f"{value:.12f}\n" for value in values)
                temporary.write_text(text, encoding="ascii")


def _printable(name: str) -> str:
    """Return a name as the text of a coordinate system takes it: no quotes, nothing unseen."""
    return "".join(c if c.isprintable() else " " for c in name).replace('"', "'")


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


def check_relief(reader: RasterReader) -> None:
    """Refuse a raster that cannot be a relief map.

    Raises
    ------
    InputError
        If its first band is a picture.
    """
    if reader.dtype == np.uint8 or reader.dtype.kind not in "fiu":
        raise InputError(remark("raster.picture", of=reader.path, dtype=reader.dtype))


def _check_space(path: Path, grid: Grid, bytes_per_pixel: int) -> None:
    """Refuse before the work when the disk cannot even hold a well compressed result."""
    # Photographs deflate to 30-45 %; a tenth is what no real one undercuts.
    needed = grid.width * grid.height * bytes_per_pixel // 10
    free = shutil.disk_usage(path.parent).free
    if needed > free:
        raise InputError(
            f"{path}: {grid.width:,} x {grid.height:,} px need more than "
            f"{bytes_in_words(needed)} and {bytes_in_words(free)} are free. Choose another disk, "
            "a coarser --gsd or --bounds."
        )


def bytes_in_words(count: float) -> str:
    """Return a number of bytes in words.

    Examples
    --------
    >>> bytes_in_words(18), bytes_in_words(6_300_000), bytes_in_words(2e16)
    ('18 bytes', '6.3 MB', '20,000 TB')
    """
    power = min(int(np.log10(float(max(count, 1)))) // 3, 4)
    number = count / 1000**power
    words = f"{number:.4g}" if number < 1000 else f"{number:,.0f}"
    return f"{words} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"
