"""A DEM or point cloud of the bottom and a file of soundings in, offsets by depth out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from multimedia.bathymetry.regrid import bilinear
from multimedia.bathymetry.soundings import DepthOffsets, depth_offsets
from multimedia.projects import Dem, read_object_points, read_water_surface
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.cloud import open_cloud
from photocore.errors import GeometryError, located
from photocore.output import check_all_writable, check_ending, check_not_input
from photocore.tables import write_csv

#: Points of a cloud through which the plane at a sounding runs.
NEIGHBOURS = 8
#: A sounding farther from the cloud than this many of its mean distances lies beside it.
FARTHEST = 3.0
#: The mean of the neighbours is farther from it than this share of the farthest: at the rim.
ASIDE = 0.6
#: Soundings that are off by so many metres in the middle, and by so many times more than in another
#: reading, mean that one.
LARGE, FACTOR = 1.0, 10.0
#: Side of the windows in which a DEM is read. [cells]
WINDOW = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundingCheck:
    """Soundings against a surface.

    Attributes
    ----------
    offsets : DepthOffsets
    count, outside : int
        Soundings of the file, and those that lie beside the surface.
    remarks : tuple of str
    """

    offsets: DepthOffsets
    count: int
    outside: int
    remarks: tuple[str, ...]


def check_soundings(
    surface: Path,
    soundings: Path,
    *,
    water_level: str,
    edges: Sequence[float] | None = None,
    sigma: float = 0.0,
    target: Path | None = None,
    overwrite: bool = False,
) -> SoundingCheck:
    """Hold a corrected DEM or point cloud against soundings or check points.

    Parameters
    ----------
    surface : path
        .tif with heights in band 1 and, if there, a band ``sigma``; or a point cloud with, if
        there, ``sigma_Z``.
    soundings : path
        Table or cloud X, Y, Z and, if there, sigma_Z, any number. [m]
    water_level : str
        Of which depths count: see `read_water_surface`.
    edges : sequence of float, optional
        Bounds of the classes of depth. [m]
    sigma : float
        Of a sounding that has none of its own. [m]
    target : path, optional
        Table .csv of every sounding, its offset and sigma.

    Raises
    ------
    InputError, GeometryError
        If files cannot be read, or no sounding lies on the surface.
    """
    check_ending(target, "offsets of soundings are written as .csv.", ".csv")
    check_all_writable(target, overwrite=overwrite)
    check_not_input(target, surface, soundings)
    names, xyz, sigmas, remarks = _points(soundings)
    sigmas = np.where(np.isfinite(sigmas), sigmas, sigma)
    if surface.suffix.lower() in (".tif", ".tiff"):
        height, its = _of_dem(surface, xyz[:, :2], remarks)
    else:
        height, its = _of_cloud(surface, xyz[:, :2], remarks)
    offset = xyz[:, 2] - height
    outside = int(np.isnan(offset).sum())
    if outside == len(offset):
        raise GeometryError(
            f"{soundings}: none of {len(offset)} soundings lies on {surface}; are both in one "
            "reference system?"
        )
    total = np.hypot(np.nan_to_num(its), sigmas)
    total[total == 0] = np.nan
    water = read_water_surface(water_level)
    level = water.height_at(xyz[:, :2])
    depth = level - xyz[:, 2]
    remarks += _other_datum(xyz[:, 2], height, level)
    with located(soundings):
        offsets = depth_offsets(offset, depth, sigmas=total, edges=edges)
    if target is not None:
        columns = {
            "id": names, **dict(zip("XYZ", xyz.T, strict=True)), "depth": depth,
            "surface": height, "offset": offset, "sigma": total,
        }  # fmt: skip
        write_csv(target, columns, overwrite=overwrite)
    return SoundingCheck(
        offsets=offsets, count=len(offset), outside=outside, remarks=tuple(remarks)
    )


def _other_datum(sounded: FloatArray, height: FloatArray, level: FloatArray) -> list[str]:
    """Say whether soundings fit far better as depths, or counted from the water."""
    readings = {
        "soundings.depths": level - sounded,
        "soundings.negative_depths": level + sounded,
        "soundings.mirrored": 2.0 * level - sounded,
        "soundings.feet": 0.3048 * sounded,
    }
    misfit = float(np.nanmedian(np.abs(sounded - height)))
    others = {key: float(np.nanmedian(np.abs(z - height))) for key, z in readings.items()}
    key = min(others, key=lambda each: others[each])
    if misfit < LARGE or others[key] > misfit / FACTOR:
        return []
    return [remark(key, misfit=misfit, other=others[key])]


def _points(path: Path) -> tuple[list[str], FloatArray, FloatArray, list[str]]:
    """Return names, positions, sigmas of heights (NaN: unknown) and remarks of a file."""
    if path.suffix.lower() in (".xlsx", ".xlsm", ".ods"):
        points, remarks = read_object_points(path, unit="m")
        return list(points.ids), points.xyz, points.sigma[:, 2], remarks
    xyz, numbers, texts, remarks = _whole(path, ("id",))
    return texts or [str(k + 1) for k in range(len(xyz))], xyz, numbers, remarks


def _whole(
    path: Path, texts: Sequence[str] = ()
) -> tuple[FloatArray, FloatArray, list[str], list[str]]:
    """Return the known points of a cloud, sigmas of heights (NaN: unknown), names and remarks."""
    cloud = open_cloud(path)
    xyz, sigma, names = [], [], list[str]()
    for piece in cloud.pieces(numbers=("sigma_Z",), texts=texts):
        finite = np.asarray(np.isfinite(piece.xyz).all(axis=1))
        xyz.append(piece.xyz[finite])
        sigma.append(piece.numbers.get("sigma_Z", np.full(len(finite), np.nan))[finite])
        for column in piece.texts.values():
            names += [name for name, good in zip(column, finite.tolist(), strict=True) if good]
    return np.concatenate(xyz), np.concatenate(sigma), names, list(cloud.remarks)


def _of_dem(path: Path, xy: FloatArray, remarks: list[str]) -> tuple[FloatArray, FloatArray]:
    """Return heights and sigmas of a DEM at positions, bilinear; NaN beside it."""
    values = np.full((2, len(xy)), np.nan)
    with Dem(path) as dem:
        if not dem.has_position:
            raise GeometryError(f"{path}: has no position (no geotransform); georeference it.")
        remarks += dem.remarks
        sigma_band = dem.names.index("sigma") + 1 if "sigma" in dem.names else None
        matrix = dem.xy_from_pixel
        pixel = (xy - matrix[:, 2]) @ np.linalg.inv(matrix[:, :2]).T
        first = np.floor(pixel)
        size = (dem.width, dem.height)
        inside = ((pixel >= -0.5) & (pixel <= np.array(size) - 0.5)).all(axis=1)
        for window in dem.windows(WINDOW):
            start = np.array([window.column, window.row])
            end = start + np.array([window.width, window.height])
            clipped = np.clip(first, 0, np.array(size) - 1)
            mine = np.flatnonzero(inside & ((clipped >= start) & (clipped < end)).all(axis=1))
            if not mine.size:
                continue
            wide = window.widened(1)
            at = np.clip(pixel[mine], 0, np.array(size) - 1) - [wide.column, wide.row]
            layers = [dem.heights(wide)]
            if sigma_band is not None:
                layers.append(dem.read(*wide, bands=[sigma_band], fill=np.nan)[..., 0])
            values[: len(layers), mine] = bilinear(np.stack(layers), at)
    return values[0], values[1]


def _of_cloud(path: Path, xy: FloatArray, remarks: list[str]) -> tuple[FloatArray, FloatArray]:
    """Return heights and sigmas of a cloud at positions, by planes through neighbours."""
    xyz, sigma, _, told = _whole(path)
    remarks += told
    if len(xyz) < NEIGHBOURS:
        raise GeometryError(f"{path}: holds {len(xyz)} points; {NEIGHBOURS} are the fewest.")
    tree = cKDTree(xyz[:, :2])
    away, near = tree.query(xy, k=NEIGHBOURS)
    spacing = float(np.median(tree.query(xyz[:: max(len(xyz) // 1000, 1), :2], k=2)[0][:, 1]))
    local = xyz[near, :2] - xy[:, None]
    design = np.concatenate([np.ones((*near.shape, 1)), local], axis=2)
    plane = (np.linalg.pinv(design) @ xyz[near, 2, None])[..., 0]
    # The plane holds among its points, not beside them.
    aside = np.linalg.norm(local.mean(axis=1), axis=1) > ASIDE * away[:, -1]
    beside = (away[:, 0] > FARTHEST * spacing) | aside
    height = np.where(beside, np.nan, plane[:, 0])
    return height, np.sqrt((sigma[near] ** 2).mean(axis=1))
