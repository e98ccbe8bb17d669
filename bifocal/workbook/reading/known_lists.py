"""Lists beside a survey: control and check points of the field, and picks in a row a photo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bifocal.model import FARTHEST_WALL
from bifocal.orientation import A_PHOTO, lacks_axis, of_rows, strange_third, without_unseen
from bifocal.remarks import remark
from bifocal.survey import KnownPoints, PointObservations, SurveyInput, pixel_keys
from bifocal.workbook.reading.reader import TO_M, understood
from bifocal.workbook.reading.setup_reader import LARGEST
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.tables import Column, Table, parse_column_map, read_table
from photocore.tables.axes import EAST, HEIGHT, NAMES, NORTH
from photocore.tables.numbers import Decimal

#: Axes of the lists that fill `Georeference` and `Check`: headings that mean them besides ours.
_AXES: dict[str, dict[str, tuple[str, ...]]] = {
    "Georeference": {"E": EAST, "N": NORTH, "H": HEIGHT},
    "Check": {"X_ref": ("X",), "Y_ref": ("Y",), "Z_ref": ("Z", "r", "relief")},
}
#: Names of the tables of both sheets.
_TABLES = {"Georeference": "tblGeo", "Check": "tblCheck"}
#: RealityCapture's control points are headed ``#image,name,x,y``.
_PIXELS = {"col": ("x",), "row": ("y",)}
_LONG = tuple(
    replace(column, required=True, aliases=(*column.aliases, *_PIXELS.get(column.key, ())))
    for column in (Column("id", NAMES, "text"), *A_PHOTO)
)


def with_list(
    survey: SurveyInput, path: Path | str, decimal: Decimal | None, order: str | None = None
) -> SurveyInput:
    """Return a survey whose control and check points are those of a list, too.

    Names that are there already take the coordinates of the list; points that were not measured
    are left out.

    Parameters
    ----------
    survey : SurveyInput
    path : path
        Table or list of an instrument with id and E, N, H (control points), or X, Y, Z or r on the
        wall (check points); X, Y, Z that lie further off than a wall reaches are E, N, H.
    decimal : {"point", "comma"}, optional
        Decimal separator of numbers typed as text.
    order : str, optional
        Which column is which, ``PNEZD`` for example, as `photocore.tables.parse_column_map` has it.

    Raises
    ------
    InputError, WorkbookError
        If the list cannot be read, or no point of it was measured.
    """
    errors: list[CellError] = []
    columns = [understood("id", more=NAMES, required=True)]
    for headed in _AXES.values():
        columns += [understood(key, more=more, unit="m") for key, more in headed.items()]
    names = parse_column_map(order, [column.key for column in columns]) if order else None
    table = read_table(path, columns, decimal=decimal, column_map=names, errors=errors)
    keys = [key for headed in _AXES.values() for key in headed]
    errors += table.too_large(keys, LARGEST)
    world, wall, placed = _placed(table, {k: table.in_unit(k, TO_M, errors) for k in keys}, path)
    remarks = [*table.remarks, *placed]
    count_before = len(remarks)
    for sheet, xyz in (("Georeference", world), ("Check", wall)):
        places = [k for k in table.first_rows("id", xyz, errors) if table.texts("id")[k]]
        listed = KnownPoints(ids=tuple(table.texts("id")[i] for i in places), xyz=xyz[places])
        listed = listed.called_as(survey.points.ids)
        measured = np.isin(listed.ids, survey.points.ids) & np.isfinite(listed.xyz).any(axis=1)
        if measured.any():
            survey = _filled(survey, sheet, listed, np.flatnonzero(measured).tolist())
            count = {"count": int(measured.sum()), "all": len(listed), "sheet": sheet}
            remarks.append(remark("survey.list_taken", of=Path(path).name, **count))
    if errors:
        raise WorkbookError(errors)
    if len(remarks) == count_before:
        raise InputError(remark("survey.list_of_others", of=path))
    return replace(survey, remarks=(*survey.remarks, *remarks))


def _placed(
    table: Table, columns: Mapping[str, FloatArray], path: Path | str
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Return E, N, H and X, Y, Z on the wall of a list, shape (n, 3), and what is said of them.

    Z beside E and N is the height; X and Y beside H, or further off than a wall reaches, are plan.

    Raises
    ------
    InputError
        If a height has no plan beside it.
    """
    world, wall = (np.stack([columns[key] for key in axes], axis=-1) for axes in _AXES.values())
    have, notes = table.present, strange_third(table, "E", ("Z_ref", "H"), "--control-order")
    plan, flat = have & {"E", "N"}, {"X_ref", "Y_ref"} <= have
    if (plan or "H" in have) and len(plan) < 2 and not flat:
        lacking = ", ".join(axis for axis in "EN" if axis not in plan)
        raise InputError(lacks_axis(table, path, lacking, "--control-order"))
    if plan:
        if "H" not in have:
            world[:, 2], wall[:, 2] = wall[:, 2], np.nan
    elif "H" in have or np.nanmax(np.abs(wall), initial=0.0) > FARTHEST_WALL:
        is_geodetic = flat and table.columns["Y_ref"] < table.columns["X_ref"]
        if is_geodetic or "H" in have:
            notes.append(remark(f"control.{'geodetic' if is_geodetic else 'x_is_east'}"))
        world[:, :2] = wall[:, [1, 0] if is_geodetic else [0, 1]]
        world[:, 2] = np.where(np.isnan(world[:, 2]), wall[:, 2], world[:, 2])
        wall = np.full_like(wall, np.nan)
    return world, wall, notes


def _filled(
    survey: SurveyInput, sheet: str, listed: KnownPoints, places: Sequence[int]
) -> SurveyInput:
    """Return a survey with points of a list in one of its sheets."""
    field = "control" if sheet == "Georeference" else "known"
    listing, rows = getattr(survey, field), getattr(survey, f"{field}_rows")
    # Relief given beside the points stands on no sheet and comes last.
    count = len(rows) if survey.is_ours else len(listing)
    ids, xyz, use = list(listing.ids[:count]), list(listing.xyz[:count]), list(listing.used[:count])
    for place in places:
        if listed.ids[place] in ids:
            xyz[ids.index(listed.ids[place])] = listed.xyz[place]
            continue
        ids.append(listed.ids[place])
        xyz.append(listed.xyz[place])
        use.append(True)
    rest = [k for k in range(count, len(listing)) if listing.ids[k] not in ids]
    names = (*ids, *(listing.ids[k] for k in rest))
    merged = KnownPoints(
        ids=names,
        xyz=np.array([*xyz, *listing.xyz[rest]]),
        use=np.array([*use, *listing.used[rest]]),
    )
    areas = () if survey.book is None else survey.book.tables
    free = max([a.first - 1 for a in areas if a.name == _TABLES[sheet]] + list(rows), default=0) + 1
    added = range(free, free + len(ids) - count) if survey.is_ours else ()
    if field == "control":
        return replace(survey, control=merged, control_rows=(*rows, *added))
    return replace(survey, known=merged, known_rows=(*rows, *added))


def read_long(
    path: Path | str, photos: Sequence[Sequence[str]], decimal: Decimal | None
) -> SurveyInput | None:
    """Return the points of a table with a row a photo; None where a file is no such table.

    Parameters
    ----------
    path : path
        Table of id, photo, col, row. [px]
    photos : sequence of sequence of str
        What each photo is called: name, file, number.

    Raises
    ------
    WorkbookError
        Naming every row whose photo is none of these, or that repeats another.
    """
    errors: list[CellError] = []
    try:
        table = read_table(path, _LONG, decimal=decimal, errors=errors)
    except InputError:
        return None
    if errors:
        raise WorkbookError(errors)
    points = of_rows(table, ("col", "row"), photos, np.empty((len(table), 0)), all_known=True)
    ids = [table.texts("id")[row] for row in points.rows]
    picks, unseen = without_unseen(points.picks, ids)
    pixels = {
        key: pixel[:, axis]
        for number, pixel in enumerate(picks, start=1)
        for axis, key in enumerate(pixel_keys(number))
    }
    survey = SurveyInput.of_points(PointObservations.from_columns({"id": ids, **pixels}))
    return replace(survey, remarks=(*survey.remarks, *table.remarks, *unseen))
