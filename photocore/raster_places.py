"""Where rasters go, and in which order their parts lie: object storage, cloud-optimised GeoTIFF.

GDAL reads and writes more than local files: ``/vsis3/bucket/a.tif`` (Amazon), ``/vsiaz/`` (Azure),
``/vsigs/`` (Google), ``/vsicurl/https://...`` (reading only), with the credentials it finds in its
own environment variables.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from photocore.errors import InputError
from photocore.output import atomic_path, is_virtual, temporary_folder

_cloud_optimised: ContextVar[bool] = ContextVar("cloud_optimised", default=False)


@contextmanager
def cloud_optimised(wanted: bool = True) -> Iterator[None]:
    """Let the GeoTIFFs written within be cloud-optimised: overviews first, read part by part."""
    token = _cloud_optimised.set(wanted)
    try:
        yield
    finally:
        _cloud_optimised.reset(token)


def is_cloud_optimised() -> bool:
    """Tell whether GeoTIFFs written now are to be cloud-optimised."""
    return _cloud_optimised.get()


def gdal_name(path: Path | str) -> str:
    """Return what GDAL calls a file; a path has lost a slash of the address in it.

    Examples
    --------
    >>> gdal_name(Path("/vsicurl/https://example.org/a.tif"))
    '/vsicurl/https://example.org/a.tif'
    """
    return re.sub(r":/+", "://", Path(path).as_posix(), count=1) if is_virtual(path) else str(path)


@contextmanager
def raster_place(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """Yield where a raster is written first; then it goes to its place, whole or not at all."""
    if not is_virtual(path):
        with atomic_path(path, overwrite=overwrite) as temporary:
            yield temporary
        return
    import rasterio.shutil
    from rasterio._err import CPLE_BaseError
    from rasterio.errors import RasterioError

    check_virtual(path, overwrite=overwrite)
    with temporary_folder() as folder:
        temporary = folder / path.name
        yield temporary
        try:
            rasterio.shutil.copyfiles(str(temporary), gdal_name(path))
        except (RasterioError, CPLE_BaseError, OSError) as error:
            raise InputError(f"{path}: could not be written ({error}). {_CHECK}") from error


#: What to look at where a file of object storage cannot be read or written.
_CHECK = (
    "Check the address and GDAL's credentials for it, e.g. AWS_ACCESS_KEY_ID and "
    "AWS_SECRET_ACCESS_KEY."
)


def why_unreadable(path: Path, error: Exception) -> str:
    """Return why GDAL cannot open a raster: of object storage what the network or its owner say."""
    if not is_virtual(path):
        return "is not a raster file GDAL can read."
    return f"could not be read ({error}). {_CHECK}"


def check_virtual(path: Path, *, overwrite: bool) -> None:
    """Refuse a raster in one of GDAL's file systems that is there already.

    Raises
    ------
    InputError
        Without ``overwrite``.
    """
    import rasterio.shutil
    from rasterio._err import CPLE_BaseError

    try:
        there = rasterio.shutil.exists(gdal_name(path))
    except CPLE_BaseError as error:
        raise InputError(f"{path}: cannot be reached ({error}).") from error
    if there and not overwrite:
        raise InputError(f"{path}: exists already; add --overwrite to replace it.")


def copy_optimised(
    source: Path, target: Path, options: Mapping[str, Any], *, block: int, categories: bool
) -> None:
    """Copy a GeoTIFF as a cloud-optimised one, with reduced copies of it inside."""
    import rasterio.shutil

    method = "NEAREST" if categories else "AVERAGE"
    predictor = {2: "STANDARD", 3: "FLOATING_POINT"}[options["predictor"]]
    rasterio.shutil.copy(
        str(source), str(target), driver="COG", compress="DEFLATE", level=1, predictor=predictor,
        blocksize=block, bigtiff="IF_SAFER", overview_resampling=method,
        interleave=str(options["interleave"]).upper(),
    )  # fmt: skip
