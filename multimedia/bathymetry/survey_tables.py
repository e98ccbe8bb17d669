"""Small tables a bathymetric survey brings: cameras, who saw what, rays, trajectory, tie points."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, time
from pathlib import Path

import numpy as np

from multimedia.projects import read_project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import did_you_mean, meant
from photocore.tables import Column, Table, read_table
from photocore.tables.axes import EAST, HEIGHT, NAMES, NORTH, PHOTOS
from photocore.tables.numbers import METRES

_XYZ = (
    Column("X", ("x", "x0", "xc", *EAST), required=True, unit="m"),
    Column("Y", ("y", "y0", "yc", *NORTH), required=True, unit="m"),
    Column("Z", ("z", "z0", "zc", *HEIGHT), required=True, unit="m"),
)
_TIME = Column("time", ("date", "datetime", "timestamp", "t", "ora", "zeit"), kind="text")
#: The date of EXIF data, which no other program writes with colons.
_EXIF_DATE = re.compile(r"^(\d{4}):(\d\d):(\d\d)")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraPositions:
    """Projection centres by name.

    Attributes
    ----------
    ids : tuple of str
    centres : ndarray, shape (m, 3)
        [m]
    times : tuple of str
        When each photo was taken, as the table says it; empty texts where it does not.
    """

    ids: tuple[str, ...]
    centres: FloatArray
    times: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RayTable:
    """Measured rays, grouped by point.

    Attributes
    ----------
    ids : tuple of str
        One per point.
    origins, directions : ndarray, shape (n, k, 3)
        NaN for rays a point does not have.
    """

    ids: tuple[str, ...]
    origins: FloatArray
    directions: FloatArray


def read_camera_positions(path: Path | str) -> CameraPositions:
    """Read a table ``id, X, Y, Z`` and, if there, ``time`` of projection centres, or a project.

    Raises
    ------
    InputError
        If a column or a coordinate is missing, or a name stands twice.
    """
    if Path(path).suffix.lower() == ".toml":
        cameras = read_project(path).cameras
        return CameraPositions(
            ids=tuple(camera.name for camera in cameras),
            centres=np.array([camera.centre for camera in cameras]),
        )
    name = Column(
        "id", ("camera", "image", "photo", "photo id", "file", *PHOTOS, *NAMES), kind="text"
    )
    table = read_table(path, (name, *_XYZ, _TIME))
    if not len(table):
        raise InputError(f"{path}: holds no camera.")
    centres = _numbers(table, ("X", "Y", "Z"))
    errors: list[CellError] = []
    rows = table.once("id", centres, errors)
    if errors:
        raise WorkbookError(errors)
    ids = tuple(table.texts("id")[row] or str(row + 1) for row in rows)
    times = tuple(table.texts("time")[row] for row in rows)
    return CameraPositions(ids=ids, centres=centres[rows], times=times)


def read_visibility(path: Path | str, cameras: CameraPositions) -> dict[str, set[str]]:
    """Read a table ``point, camera``: one row per point and camera that saw it."""
    point = Column("point", ("id", "pointid"), kind="text", required=True)
    camera = Column("camera", ("image", "photo"), kind="text", required=True)
    table = read_table(path, (point, camera))
    cameras_of: dict[str, set[str]] = {}
    photos = meant(table.texts("camera"), cameras.ids)
    for name, photo in zip(table.texts("point"), photos, strict=True):
        cameras_of.setdefault(name, set()).add(photo)
    return cameras_of


def read_levels(path: Path | str, cameras: CameraPositions) -> FloatArray:
    """Read the height of the water when each photo was taken, shape (m,). [m]

    The table is ``camera, level``, or ``time, level``: a tide gauge, between whose rows heights
    run straight, for cameras with times. Times are seconds, times of a day or dates with times.

    Raises
    ------
    InputError
        If a photo has no level, or was taken when the gauge had not begun or had ended.
    """
    camera = Column("camera", ("image", "photo", "id"), kind="text")
    level = Column("level", ("water_level", "height", "z", "tide", "h"), required=True, unit="m")
    table = read_table(path, (camera, _TIME, level))
    heights = _numbers(table, ("level",))[:, 0]
    if "camera" in table.present:
        levels = dict(zip(meant(table.texts("camera"), cameras.ids), heights.tolist(), strict=True))
        missing = [name for name in cameras.ids if name not in levels]
        if missing:
            like = did_you_mean(missing[0], levels)
            raise InputError(
                f"{path}: has no level for photo {missing[0]}{like} ({len(missing)} in all)."
            )
        return np.array([levels[name] for name in cameras.ids])
    if "time" not in table.present:
        raise InputError(f"{path}: water levels of photos need a column time or camera.")
    if not any(cameras.times):
        raise InputError(remark("bathymetry.no_time_column", of=path))
    gauge = np.array([_seconds(text, f"{path}, time") for text in table.texts("time")])
    if len(gauge) < 2 or not (np.diff(gauge) > 0).all():
        raise InputError(f"{path}: needs at least two rows whose times increase.")
    times = np.array([_seconds(text, "time of a camera") for text in cameras.times])
    outside = np.flatnonzero((times < gauge[0]) | (times > gauge[-1]))
    if outside.size:
        first = outside[0]
        raise InputError(
            f"{path}: photo {cameras.ids[first]} was taken at {cameras.times[first]}, when the "
            f"gauge has no levels ({len(outside)} photos in all). Are both in one time zone?"
        )
    return np.interp(times, gauge, heights)


def _seconds(text: str, where: str) -> float:
    """Return a time in seconds: a number, a time of the day, or a date with a time.

    Examples
    --------
    >>> _seconds("00:01:30", ""), _seconds("2024:06:01 12:00:00", "") % 86400
    (90.0, 43200.0)
    """
    plain = _EXIF_DATE.sub(r"\1-\2-\3", text.strip())
    with suppress(ValueError):
        return float(plain.replace(",", "."))
    with suppress(ValueError):
        clock = time.fromisoformat(plain)
        return clock.hour * 3600 + clock.minute * 60 + clock.second + clock.microsecond / 1e6
    with suppress(ValueError):
        when = datetime.fromisoformat(plain)
        return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()
    raise InputError(f"{where}: {text!r} is no time; seconds, 14:05:30 or 2026-06-01T14:05:30.")


def read_rays(path: Path | str) -> RayTable:
    """Read a table ``id, X0, Y0, Z0, DX, DY, DZ``: one row per ray, several per point.

    Raises
    ------
    InputError
        If a column or a number is missing.
    """
    columns = (
        Column("id", ("point",), kind="text", required=True),
        *(Column(f"{axis}0", required=True, unit="m") for axis in "XYZ"),
        *(Column(f"D{axis}", required=True) for axis in "XYZ"),
    )
    table = read_table(path, columns)
    if not len(table):
        raise InputError(f"{path}: holds no rays.")
    rays = _numbers(table, ("X0", "Y0", "Z0", "DX", "DY", "DZ"))
    number = {name: k for k, name in enumerate(dict.fromkeys(table.texts("id")))}
    point = np.array([number[name] for name in table.texts("id")])
    counts = np.bincount(point)
    order = np.argsort(point, kind="stable")
    slot = np.empty(len(point), dtype=np.int64)
    slot[order] = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
    grid = np.full((len(number), int(counts.max()), 6), np.nan)
    grid[point, slot] = rays
    return RayTable(ids=tuple(number), origins=grid[..., :3], directions=grid[..., 3:])


def read_trajectory(path: Path | str) -> tuple[FloatArray, FloatArray]:
    """Read a table ``time, X, Y, Z`` of sensor positions; times (k,) ascending, positions (k, 3).

    Raises
    ------
    InputError
        If the times do not increase.
    """
    columns = (Column("time", ("gps_time", "t"), required=True, unit="s"), *_XYZ)
    table = read_table(path, columns)
    rows = _numbers(table, ("time", "X", "Y", "Z"))
    if len(rows) < 2 or not (np.diff(rows[:, 0]) > 0).all():
        raise InputError(f"{path}: needs at least two rows whose times increase.")
    return rows[:, 0], rows[:, 1:]


def _numbers(table: Table, keys: tuple[str, ...], errors: Sequence[CellError] = ()) -> FloatArray:
    """Return columns of numbers, (n, k).

    Raises
    ------
    WorkbookError
        If a cell is blank or infinite, or there are errors already; all of them are named.
    """
    complaints = list(errors)
    lengths = {key for key in keys if table.units.get(key, "s") != "s"}
    values = np.column_stack(
        [
            table.in_unit(key, METRES, complaints) if key in lengths else table.numbers(key)
            for key in keys
        ]
    )
    blank = [
        table.error(int(row), keys[column], "is blank; expected a number.")
        for row, column in np.argwhere(~np.isfinite(values))
    ]
    if complaints or blank:
        raise WorkbookError([*complaints, *blank])
    return values
