"""Read what is known from outside: check points, control points, relief measured on site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bifocal.survey.reference import KnownPoints
from bifocal.workbook.words import headings
from photocore.errors import CellError
from photocore.tables import Column, Table, read_table
from photocore.tables.csvread import CsvFile
from photocore.tables.headings import bare
from photocore.tables.model import Kind
from photocore.tables.numbers import Decimal
from photocore.workbook.making.live_columns import TEXT_KEYS
from photocore.workbook.reading.grid import SheetFile

#: No coordinate of a photo or a map is larger.
LARGEST = 1e9
TO_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "dm": 0.1}


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownTable:
    """Check or control points as read.

    Attributes
    ----------
    points : KnownPoints
    rows : tuple of int
        Their rows in the sheet.
    remarks, text_cells : tuple of str
        What the user should know; cells whose number was typed as text.
    """

    points: KnownPoints = field(default_factory=KnownPoints)
    rows: tuple[int, ...] = ()
    remarks: tuple[str, ...] = ()
    text_cells: tuple[str, ...] = ()


def read_known(
    book: SheetFile | CsvFile,
    sheet: str,
    keys: tuple[str, str, str],
    errors: list[CellError],
    decimal: Decimal | None,
) -> KnownTable:
    """Return check or control points of the sheet made for them; nothing where it is absent."""
    if not isinstance(book, SheetFile):
        return KnownTable()
    names = {bare(sheet), bare(f"tbl{sheet}"), "tblgeo" if sheet == "Georeference" else ""}
    areas = [area for area in book.tables if bare(area.name) in names]
    titles = [title for title in book.titles if bare(title) in names]
    if not areas and not titles:
        return KnownTable()
    table = read_table(
        book,
        [understood(key, required=key == "id") for key in ("id", *keys, "use")],
        name="Geo" if sheet == "Georeference" and areas else sheet,
        sheet=areas[0].sheet if areas else titles[0],
        decimal=decimal,
        errors=errors,
    )
    faulty = {(error.sheet, error.cell) for error in errors}
    errors += table.repeated("id")
    refuse_absurd(table, keys, errors)
    xyz = np.stack(
        [table.numbers(key) * factor_of(table, key, TO_M, errors) for key in keys], axis=-1
    ).reshape(-1, 3)
    use = table.numbers("use")
    rows = [i for i, name in enumerate(table.texts("id")) if name]
    for i, name in enumerate(table.texts("id")):
        own_complaint = (table.sheet, table.cell(i, "id")) in faulty
        if not name and not own_complaint and not np.isnan(xyz[i]).all():
            errors.append(table.error(i, "id", "coordinates without the name of a point."))
    return KnownTable(
        points=KnownPoints(
            ids=tuple(table.texts("id")[i] for i in rows),
            xyz=xyz[rows],
            use=(np.isnan(use) | (use != 0))[rows],
        ),
        rows=tuple(table.rows[i] for i in rows),
        remarks=tuple(text for text in table.remarks if "rows directly below" not in text),
        text_cells=tuple(table.text_cells),
    )


def understood(
    key: str, *, more: Sequence[str] = (), unit: str = "", required: bool = False
) -> Column:
    """Return a column to read, with every heading that is understood."""
    kind: Kind = "text" if key in TEXT_KEYS else "flag" if key == "use" else "number"
    names = dict.fromkeys((*headings("columns", key), *more))
    return Column(key, tuple(names), kind=kind, unit=unit, required=required)


def refuse_absurd(table: Table, keys: Sequence[str], errors: list[CellError]) -> None:
    """Complain about numbers that no photo and no map can hold: a slip, or a broken formula."""
    for key in keys:
        with np.errstate(invalid="ignore"):
            rows = np.flatnonzero(np.abs(table.numbers(key)) > LARGEST).tolist()
        for row in rows:
            value = table.numbers(key)[row]
            errors.append(
                table.error(row, key, f"found {value:g}, which is too large; correct it.")
            )


def factor_of(
    table: Table, key: str, factors: Mapping[str, float], errors: list[CellError]
) -> float:
    """Return what brings a column to the first of some units, complaining about any other."""
    wanted = next(iter(factors))
    symbol = table.units.get(key) or wanted
    if symbol not in factors:
        errors.append(unit_error(table, key, symbol, wanted))
    return factors.get(symbol, 1.0)


def unit_error(table: Table, key: str, symbol: str, wanted: str) -> CellError:
    """Return the complaint about a heading with another unit than expected."""
    return CellError(
        f'the heading "{table.headings.get(key, key)}" says [{symbol}], expected [{wanted}].',
        file=table.file,
        sheet=table.sheet,
        column=key,
    )
