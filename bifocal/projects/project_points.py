"""Points of another program's project: its own, a cloud's, and those that were picked in photos."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bifocal.model import Lens
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Pinhole, rays_meeting
from photocore.cloud import open_cloud
from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import called, meant, nearest
from photocore.programs import ForeignProject, ForeignView
from photocore.tables import Column, Table, read_table
from photocore.tables.axes import COLUMNS_OF_PIXELS, NAMES, PHOTOS, ROWS_OF_PIXELS

COLUMNS = (
    Column("id", NAMES, kind="text", required=True),
    Column("photo", PHOTOS, kind="text"),
    Column("col", COLUMNS_OF_PIXELS, unit="px"),
    Column("row", ROWS_OF_PIXELS, unit="px"),
    Column("x", ("X model",)),
    Column("y", ("Y model",)),
    Column("z", ("Z model",)),
)
#: Points among which the wall is looked for; more tell no better.
MOST_POINTS = 20_000


def sparse_points(project: ForeignProject, cloud: Path | None) -> FloatArray:
    """Return points of a project, or of a cloud in its frame, shape (n, 3)."""
    points = project.points
    if cloud is not None:
        pieces = [piece.xyz for piece in open_cloud(cloud).pieces()]
        points = np.concatenate(pieces) if pieces else np.empty((0, 3))
    points = points[np.isfinite(points).all(axis=1)]
    return points[:: 1 + len(points) // MOST_POINTS]


def read_points(path: Path, views: tuple[ForeignView, ...]) -> dict[str, FloatArray]:
    """Return named points in the project's frame: its coordinates, or picked in its photos.

    Parameters
    ----------
    path : path
        Table: id with x, y, z; or id, photo, col, row, a row for each photo that shows the point.
    views : tuple of ForeignView

    Returns
    -------
    dict
        Name to coordinates, shape (3,). [unit of the project]

    Raises
    ------
    InputError
        Naming every bad cell, or the point that cannot be intersected.
    """
    table = read_table(path, COLUMNS)
    pixels = ("col", "row")
    if {"photo", "x", "y"} <= table.present and not {*pixels, "z"} & table.present:
        pixels = ("x", "y")  # as RealityCapture heads them
    if {"x", "y", "z"} <= table.present:
        xyz = np.column_stack([table.numbers(key) for key in ("x", "y", "z")])
        errors: list[CellError] = []
        rows = table.once("id", xyz, errors)
        if errors:
            raise WorkbookError(errors)
        ids = table.texts("id")
        return {ids[row]: xyz[row] for row in rows if np.isfinite(xyz[row]).all()}
    if not {"photo", *pixels} <= table.present:
        raise InputError(remark("projects.point_columns", of=path))
    return _intersected(table, pixels, views)


def _intersected(
    table: Table, keys: tuple[str, str], views: tuple[ForeignView, ...]
) -> dict[str, FloatArray]:
    errors: list[CellError] = []
    pixels = np.column_stack([table.in_unit(key, {"px": 1.0}, errors) for key in keys])
    rays: dict[str, list[tuple[Pinhole, FloatArray]]] = {}
    for row, (name, photo) in enumerate(zip(table.texts("id"), table.texts("photo"), strict=True)):
        shown = [views[k] for k in called(photo, [view.name for view in views])]
        if len(shown) != 1:
            what = "several photos" if shown else "no photo"
            near = nearest(photo, [view.name for view in views])
            hint = f' The nearest name is "{near}".' if near and not shown else ""
            message = f'"{photo}" is {what} of the project; name one as the project does.{hint}'
            errors.append(table.error(row, "photo", message))
        elif not np.isfinite(pixels[row]).all():
            errors.append(table.error(row, "col", "column and row must both be given."))
        else:
            view = shown[0]
            lens = Lens(**view.lens._asdict())
            rays.setdefault(name, []).append((view.camera, lens.undistort(pixels[row])[None]))
    if errors:
        raise WorkbookError(errors)
    points = {}
    for name, seen in rays.items():
        place = rays_meeting([c for c, _ in seen], [p for _, p in seen])[0]
        if len(seen) < 2 or not np.isfinite(place).all():
            raise InputError(
                f"{table.file}: point {name} is picked in {len(seen)} photo; its rays meet "
                "nowhere. Pick it in two photos or more, taken from different places."
            )
        points[name] = place
    return points


def chosen(points: Mapping[str, FloatArray], names: tuple[str, ...], option: str) -> FloatArray:
    """Return the coordinates of named points, shape (n, 3).

    Raises
    ------
    InputError
        If one of them is not known.
    """
    called_so = meant(names, points)
    if lacking := [name for name in called_so if name not in points]:
        near = nearest(lacking[0], points) or "-"
        raise InputError(remark("projects.unknown_point", of=option, name=lacking[0], near=near))
    return np.array([points[name] for name in called_so])
