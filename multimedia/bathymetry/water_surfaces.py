"""A water surface from what the user gives: a height, a raster, a mesh or a fitted level."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from multimedia.bathymetry.corrected_points import WaterSurface
from multimedia.bathymetry.dem import Dem
from multimedia.media.height_field import RasterSurface
from multimedia.media.mesh_surface import MeshSurface
from multimedia.media.surfaces import Plane
from photocore.arrays import is_finite_number
from photocore.cloud.ply import read_ply_mesh
from photocore.errors import LARGEST, InputError
from photocore.jsonfile import read_object
from photocore.raster import Window
from photocore.textfile import check_file, check_name

FORMAT = "multimedia-waterlevel/1"
#: A water surface of more cells is coarser than it looks: averaging it down loses nothing.
MOST_CELLS = 25_000_000


def read_water_surface(given: str, *, crs: Any = None) -> WaterSurface:
    """Return the surface that a number or a file describes.

    Parameters
    ----------
    given : str
        A height [m]; or a raster (.tif), a triangle mesh (.ply), or the result of
        ``multimedia waterlevel --out`` (.json).
    crs : object, optional
        Reference system of the data; a raster in another one is refused.

    Raises
    ------
    InputError
        If it is neither.
    """
    try:
        height = float(given.replace(",", "."))
    except ValueError:
        height = None
    if height is not None:
        if not abs(height) <= LARGEST:
            raise InputError(f"water level: {given} is no height; give metres.")
        return Plane.level(height)
    path = Path(given)
    kind = path.suffix.lower()
    if kind not in (".tif", ".tiff", ".ply", ".json"):
        raise InputError(
            f"water level: {given!r} is neither a height in metres nor a .tif raster, .ply mesh or "
            ".json of `multimedia waterlevel`. A decimal point, no unit: 1.8075."
        )
    if kind == ".json":
        return _read_fitted(path)
    if kind == ".ply":
        check_name(path)
        if path.is_dir():
            raise InputError(f"{path}: is a folder, expected a water surface.")
        check_file(path, "water surface")
        vertices, triangles = read_ply_mesh(path)
        return MeshSurface(vertices=vertices, triangles=triangles)
    with Dem(path) as raster:
        if crs is not None and raster.crs is not None and raster.crs != crs:
            raise InputError(
                f"{path}: the water surface is in another coordinate reference system than the "
                "data; transform one of them first."
            )
        if raster.width * raster.height > MOST_CELLS:
            raise InputError(
                f"{path}: {raster.width} x {raster.height} cells; average the water surface down "
                f"to at most {MOST_CELLS / 1e6:g} million (waves are metres long, not millimetres)."
            )
        heights = raster.heights(Window(0, 0, raster.width, raster.height))
        return RasterSurface(raster=heights, xy_from_cell=raster.xy_from_pixel)


def _read_fitted(path: Path) -> Plane:
    value = read_object(path, what="water level file")
    try:
        level, (x, y) = value["level"], value["centre"]
        slope_x, slope_y = slope = value["slope"]
        if not all(is_finite_number(v) and abs(v) <= LARGEST for v in (level, x, y, *slope)):
            raise TypeError
        return Plane(
            point=(float(x), float(y), float(level)),  # type: ignore[arg-type]
            normal=(-float(slope_x), -float(slope_y), 1.0),  # type: ignore[arg-type]
        )
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"{path}: expected level, slope and centre, as `multimedia waterlevel` writes them."
        ) from None
