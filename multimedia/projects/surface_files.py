"""Surfaces of water from files: rasters, triangle meshes, fitted levels; and what waves add."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.media import MeshSurface, Plane, RasterSurface, WaterSurface, WaveSurface
from multimedia.projects.dem import Dem
from multimedia.remarks import remark
from photocore.arrays import is_finite_number
from photocore.cloud.obj import read_obj_mesh
from photocore.cloud.ply import read_ply_mesh
from photocore.errors import LARGEST, InputError, located
from photocore.jsonfile import read_object
from photocore.raster import Window
from photocore.textfile import check_file

FORMAT = "multimedia-waterlevel/1"
#: A water surface of more cells is coarser than it looks: averaging it down loses nothing.
MOST_CELLS = 25_000_000
#: Endings of rasters, of meshes, and of fitted levels.
RASTERS, MESHES, FITTED = (".tif", ".tiff", ".asc"), (".ply", ".obj"), (".json",)


def read_water_surface(given: str, *, waves: Sequence[str] = (), crs: Any = None) -> WaterSurface:
    """Return the surface that a number or a file describes.

    Parameters
    ----------
    given : str
        A height [m]; or a raster (.tif, .asc), a triangle mesh (.ply, .obj), or the result of
        ``multimedia waterlevel --out`` (.json).
    waves : sequence of str
        Waves upon a height, each "amplitude,length[,direction[,phase]]" [m, m, deg, deg]; see
        `waves_of`.
    crs : object, optional
        Reference system of the data; a raster in another one is refused.

    Raises
    ------
    InputError
        If it is neither, or waves are asked for upon what has its own form.
    """
    try:
        height = float(given.replace(",", "."))
    except ValueError:
        height = None
    if height is not None:
        if not abs(height) <= LARGEST:
            raise InputError(f"water level: {given} is no height; give metres.")
        return _wavy(height, waves) if waves else Plane.level(height)
    if waves:
        raise InputError(remark("surface.wave_on_surface", given=given))
    path = Path(given)
    kind = path.suffix.lower()
    if kind not in (*RASTERS, *MESHES, *FITTED):
        raise InputError(remark("surface.no_level", given=given))
    if kind in FITTED:
        return _read_fitted(path)
    return read_mesh(path) if kind in MESHES else read_raster(path, crs=crs)


def read_mesh(path: Path) -> MeshSurface:
    """Return the triangle mesh of a .ply or .obj file.

    Raises
    ------
    InputError
        If the file is no such mesh, or has an overhang.
    """
    check_file(path, "water surface", folder=", expected a water surface.")
    if path.suffix.lower() not in MESHES:
        raise InputError(f"{path}: a mesh is a {' or '.join(MESHES)} file.")
    read = read_obj_mesh if path.suffix.lower() == ".obj" else read_ply_mesh
    vertices, triangles = read(path)
    with located(path):
        return MeshSurface(vertices=vertices, triangles=triangles, source=str(path.resolve()))


def read_raster(path: Path, *, crs: Any = None) -> RasterSurface:
    """Return the heights of a raster (GeoTIFF or ESRI ASCII grid) as a smooth surface.

    Raises
    ------
    InputError
        If it is no raster, too large, in another reference system than ``crs``, or has no position.
    """
    if path.suffix.lower() not in RASTERS:
        raise InputError(f"{path}: a raster of heights is a {', '.join(RASTERS)} file.")
    with Dem(path) as raster:
        if crs is not None and raster.crs is not None and raster.crs != crs:
            raise InputError(remark("surface.two_systems", of=path))
        if not raster.has_position:
            raise InputError(remark("surface.nowhere", of=path))
        if raster.width * raster.height > MOST_CELLS:
            raise InputError(
                f"{path}: {raster.width} x {raster.height} cells; average the water surface down "
                f"to at most {MOST_CELLS / 1e6:g} million (waves are metres long, not millimetres)."
            )
        heights = raster.heights(Window(0, 0, raster.width, raster.height))
        with located(path):
            return RasterSurface(
                raster=heights, xy_from_cell=raster.xy_from_pixel, source=str(path.resolve())
            )


def waves_of(level: float, rows: Sequence[Sequence[float]], where: str) -> WaveSurface:
    """Return a level with waves.

    Parameters
    ----------
    level : float
        Mean height.
    rows : sequence of (amplitude, length, direction, phase)
        Half the height from trough to crest, length from crest to crest, direction of travel
        clockwise from +Y [deg], phase at X = Y = 0, where 0 is a crest [deg]; the last two may be
        left out.
    where : str
        For messages.

    Raises
    ------
    InputError
        If a row is no such wave.
    """
    full = []
    for row in rows:
        values = [float(v) for v in row]
        if not 2 <= len(values) <= 4 or not all(abs(v) <= LARGEST for v in values):
            raise InputError(remark("surface.wave", of=where, row=", ".join(map(str, row))))
        if not (values[0] > 0 and values[1] > 0):
            raise InputError(f"{where}: amplitude and length of a wave must be above zero.")
        full.append([*values, 0.0, 0.0][:4])
    if not full:
        raise InputError(f"{where}: there are no waves; give at least amplitude and length.")
    amplitude, length, direction, phase = np.array(full).T
    turn = np.radians(direction)
    vector = (2 * np.pi / length)[:, None] * np.column_stack([np.sin(turn), np.cos(turn)])
    return WaveSurface(
        level=level, amplitude=amplitude, wave_vector=vector, phase=np.radians(phase)
    )


def wave_rows(surface: WaveSurface) -> list[list[float]]:
    """Return the rows of `waves_of`."""
    length = 2 * np.pi / np.hypot(*surface.wave_vector.T)
    turn = np.arctan2(*surface.wave_vector.T)
    angles = np.degrees([turn, surface.phase])
    rows: list[list[float]] = np.column_stack([surface.amplitude, length, *angles]).tolist()
    return rows


def _wavy(level: float, waves: Sequence[str]) -> WaveSurface:
    """Return a level with waves as options give them."""
    rows = []
    for text in waves:
        try:
            rows.append([float(word) for word in text.split(",")])
        except ValueError:
            raise InputError(remark("surface.wave_text", text=text)) from None
    return waves_of(level, rows, "--wave")


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
        raise InputError(remark("surface.level_file", of=path)) from None
