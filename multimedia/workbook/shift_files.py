"""Tables of points for the radial shift, read tolerantly."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from multimedia.refraction import Layers
from multimedia.remarks import remark
from multimedia.workbook.shift_points import ShiftPoints, ShiftSetup
from photocore.errors import CellError, InputError, WorkbookError, located
from photocore.tables import Column, Table, open_tables, read_named_values, read_table
from photocore.tables.csvread import CsvFile
from photocore.workbook import SheetFile, cell_name

#: Name of the first value on the sheet of camera and media in a workbook of the user's own.
MEDIA = "multimedia_media"
#: Most layers a workbook is searched for.
MOST_LAYERS = 9

#: Where a length that has no column of its own comes from.
COORDINATE = {"R": "X", "ZP": "Z"}

COLUMNS = (
    Column("id", ("Point", "Name", "No", "Nr", "Punkt", "Punktnummer", "Punto"), "text"),
    Column("X", ("East", "E", "Rechtswert", "Est")),
    Column("Y", ("North", "N", "Hochwert", "Nord")),
    Column("Z", ("Height", "H", "Elevation", "Höhe", "Quota")),
    Column("R", ("Radius", "radial distance", "Raggio", "distanza radiale", "Radialdistanz")),
    Column("ZP", ("Depth", "Z_P", "water depth", "Tiefe", "Wassertiefe", "Profondità")),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShiftInput:
    """What a file holds.

    Attributes
    ----------
    table : Table
        The table, with the way back to its cells.
    setup : ShiftSetup or None
        Camera and media, where the file is a workbook that names them.
    places : mapping
        Sheet and cell of each of their values that the workbook has, by the cell's name.
    """

    table: Table
    setup: ShiftSetup | None
    places: Mapping[str, tuple[str, str]] = field(default_factory=dict)


def read_shift_input(
    path: Path | str,
    *,
    decimal: str | None = None,
    sheet: str | None = None,
    given: Mapping[str, float] | None = None,
) -> ShiftInput:
    """Read a table of points, and the set-up if the workbook has one.

    Parameters
    ----------
    path : path
        An .xlsx, .xlsm, .ods or .csv file.
    decimal : {"point", "comma"}, optional
        Decimal separator of numbers typed as text.
    sheet : str, optional
        The only sheet to look at.
    given : mapping, optional
        Values of the set-up that options replace, by the names of their cells; what these cells
        hold does not matter.

    Raises
    ------
    InputError
        If the file cannot be read or holds no such table.
    WorkbookError
        Naming every bad cell.
    """
    book = open_tables(path)
    _refuse_survey(book)
    typed = isinstance(book, SheetFile)
    table = read_table(
        book,
        COLUMNS,
        name="Multimedia",
        sheet=sheet,
        decimal=decimal,  # type: ignore[arg-type]
        as_typed=typed,
    )
    if not {"R", "ZP"} <= table.present and not {"X", "Y", "Z"} <= table.present:
        raise InputError(remark("shift.no_columns", of=table.file))
    units = {table.units[key] for key in ("X", "Y", "Z", "R", "ZP") if key in table.units}
    if len(units) > 1:
        raise InputError(
            remark("shift.units_mixed", of=table.file, units=" and ".join(sorted(units)))
        )
    if Path(path).suffix.lower() in (".csv", ".tsv", ".txt"):
        return ShiftInput(table=table, setup=None)
    names = [Column(f"n_{i}") for i in range(1, MOST_LAYERS + 1)]
    names += [Column(f"t_{i}") for i in range(1, MOST_LAYERS - 1)]
    names += [Column("z_0"), Column("X_0"), Column("Y_0")]
    errors: list[CellError] = []
    given = given or {}
    table.remarks += _settle_names(book, {column.key for column in names} - given.keys())
    values = read_named_values(book, names, sheet="Multimedia", errors=errors, several=True)
    if errors := [error for error in errors if error.column not in given]:
        raise WorkbookError(errors)
    numbers = {column.key: values.number(column.key) for column in names}
    # A cell that cannot be read differs from what takes its place.
    numbers |= {
        key: np.nextafter(value, np.inf)
        for key, value in given.items()
        if key in values.places and np.isnan(numbers.get(key, np.nan))
    }
    indices = [n for i in range(1, MOST_LAYERS + 1) if not np.isnan(n := numbers[f"n_{i}"])]
    if len(indices) < 2 or np.isnan(numbers["z_0"]):
        return ShiftInput(table=table, setup=None, places=values.places)
    with located(f"{values.file} › Multimedia"):
        layers = Layers(
            indices=tuple(indices),
            thicknesses=tuple(numbers[f"t_{i}"] for i in range(1, len(indices) - 1)),
        )
        setup = ShiftSetup(
            layers=layers,
            z0=numbers["z_0"],
            nadir=(float(np.nan_to_num(numbers["X_0"])), float(np.nan_to_num(numbers["Y_0"]))),
        )
    return ShiftInput(table=table, setup=setup, places=values.places)


def _settle_names(book: SheetFile | CsvFile, names: Collection[str]) -> list[str]:
    """Leave of a workbook's names those of camera and media; return which the user's own are.

    In a workbook of the user's own they are the cells of the sheet that we put there, by their
    labels; without that sheet, names of the user's if two of what makes a set-up have one.
    """
    if not isinstance(book, SheetFile) or any(area.name == "tblMM" for area in book.tables):
        return []
    title, first, column = book.names.get(MEDIA, ("", 0, 0))
    if title in book.titles:
        rows = book.grid(title).rows
        labels = {
            str(cells.get(column - 1, "")): row for row, cells in rows.items() if row >= first
        }
        book.names.clear()
        book.names.update({key.casefold(): (title, row, column) for key, row in labels.items()})
        return []
    places = {key: book.names[key.casefold()] for key in names if key.casefold() in book.names}
    values = {
        key: book.grid(sheet).rows.get(row, {}).get(column)
        for key, (sheet, row, column) in sorted(places.items())
        if sheet in book.titles
    }
    numbers = {key: value for key, value in values.items() if isinstance(value, float)}
    book.names.clear()
    if len(numbers.keys() & {"n_1", "n_2", "z_0"}) < 2:
        return []
    book.names.update({key.casefold(): places[key] for key in numbers})
    readings = (f"{k} = {v:.15g} ({places[k][0]}!{cell_name(*places[k][1:])})"
            for k, v in numbers.items())  # fmt: skip
    return [remark("table.beside_names", values=", ".join(readings))]


def _refuse_survey(book: SheetFile | CsvFile) -> None:
    """Refuse a survey of a bifocal pair: its headings would be taken for coordinates."""
    names = {area.name for area in book.tables} if isinstance(book, SheetFile) else set()
    if "tblPoints" in names and "tblMM" not in names:
        raise InputError(remark("shift.is_bifocal", of=book.label))


def points_of(table: Table, nadir: tuple[float, float]) -> tuple[ShiftPoints, list[int]]:
    """Return the points of a table and their entries in it; R and ZP win over X, Y, Z.

    Raises
    ------
    WorkbookError
        Naming every point that is incomplete or on the wrong side of the water.
    """
    x, y, z, r, zp = (table.numbers(key) for key in ("X", "Y", "Z", "R", "ZP"))
    off_nadir = np.hypot(x - nadir[0], y - nadir[1])
    radius, depth = np.where(np.isnan(r), off_nadir, r), np.where(np.isnan(zp), -z, zp)
    rows: list[int] = np.flatnonzero(~np.isnan([x, y, z, r, zp]).all(axis=0)).tolist()
    errors = [
        table.error(row, key if key in table.present else COORDINATE.get(key, key), problem)
        for row in rows
        for key, problem in (
            *_problems("R", (r[row], off_nadir[row]), "X, Y and the camera", "X and Y, or R"),
            *_problems("ZP", (zp[row], -z[row]), "Z", "Z, or ZP"),
        )
    ]
    if errors:
        raise WorkbookError(errors)
    if not rows:
        raise InputError(f"{table.file}: there is no point; fill in X, Y, Z or R, ZP.")
    ids = table.texts("id")
    points = ShiftPoints(
        ids=tuple(ids[row] or str(number) for number, row in enumerate(rows, start=1)),
        radius=radius[rows],
        depth=depth[rows],
        xy=np.stack([x, y], axis=-1)[rows],
    )
    return points, rows


def _problems(
    key: str, values: tuple[float, float], source: str, ways: str
) -> Iterator[tuple[str, str]]:
    """Yield columns and what is wrong with a length that is given, or follows from coordinates."""
    given, follows = values
    value = follows if np.isnan(given) else given
    if abs(given - follows) > 1e-6 * max(abs(given), abs(follows)):
        yield key, f"found {given:.9g}, but {follows:.9g} follows from {source}; clear one."
    if np.isnan(value):
        yield key, f"is blank; give {ways}."
    elif value < 0 and key == "R":
        yield key, f"found {value:g}; a radius is positive."
    elif value < 0:
        yield (
            COORDINATE[key] if np.isnan(given) else key,
            remark("shift.dry_point", height=-value),
        )
