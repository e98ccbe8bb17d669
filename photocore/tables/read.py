"""Reading tables and single values from the files people bring."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from photocore.errors import CellError, InputError, WorkbookError
from photocore.provenance import note_remark
from photocore.remarks import remark
from photocore.tables.advice import advice
from photocore.tables.csvread import (
    CsvFile,
    find_in_text,
    open_csv,
    plain_rows,
    too_wide,
    unguarded,
)
from photocore.tables.drawing_points import drawing_unit, model_space, named_points
from photocore.tables.fill import (
    describe,
    fill,
    near_headings,
    refuse_doubles,
    refuse_unknown_units,
    strange_headings,
    take_unit_row,
)
from photocore.tables.heading_words import bare
from photocore.tables.headings import Match, find_columns
from photocore.tables.lists import drawing_as_table
from photocore.tables.model import Column, Table
from photocore.tables.numbers import FEET, Decimal, take_apart
from photocore.tables.rows import DataRows, block_above, data_rows
from photocore.textfile import check_file, check_name
from photocore.workbook import CellGrid, SheetFile, TableArea, Value, cell_name, check_header

Source = Path | str | SheetFile | CsvFile

#: Endings of text tables, and of the lists that instruments and programs write.
_TEXTS = (".csv", ".tsv", ".txt", ".gsi", ".points", ".xml", ".geojson", ".json", ".asc", ".xyz")
#: What programs write where nothing was measured.
_BLANK = -9999
#: Rows with content that are read beyond the limit: titles, notes, headings above the table.
_MARGIN = 1000


def open_tables(path: Path | str, *, max_rows: int = 100_000) -> SheetFile | CsvFile:
    """Open a file once, to read several tables and values from it.

    Parameters
    ----------
    path : path
        An .xlsx, .xlsm, .ods, .csv, .tsv or .txt file; or a list of points as instruments and
        programs write them (`photocore.tables.lists`), .dxf too.
    max_rows : int
        Rows of a sheet after which reading stops; text files have no limit.

    Raises
    ------
    InputError
        If the file is missing, empty, damaged, protected, unsafe or of another kind.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending in _TEXTS:
        return open_csv(path)
    if ending == ".dxf":
        model = model_space(path)
        text, unit = drawing_as_table(named_points(model, path), str(path)), drawing_unit(model)
        notes: list[str] = [remark("table.drawing_unit", unit=unit)] if unit else []
        return CsvFile(path.name, text, notes)
    check_name(path)
    if not path.is_dir():
        check_file(path)
    if ending in (".xls", ".xlsb", ".numbers", ".fods"):
        raise InputError(f"{path}: {ending} files cannot be read; save the workbook as .xlsx.")
    if ending in (".ods", ".ots"):
        from photocore.workbook import open_ods

        return open_ods(path, max_rows=max_rows + _MARGIN)
    if ending in (".xlsx", ".xlsm", ".xltx", ".xltm"):
        from photocore.workbook import open_xlsx

        return open_xlsx(path, max_rows=max_rows + _MARGIN)
    check_header(path)
    raise InputError(remark("table.unknown_ending", of=path, ending=ending))


def read_table(
    source: Source,
    columns: Sequence[Column],
    *,
    name: str | None = None,
    sheet: str | None = None,
    decimal: Decimal | None = None,
    column_map: Mapping[str, str] | None = None,
    max_rows: int = 100_000,
    visible_only: bool = False,
    whole: bool = False,
    as_typed: bool = False,
    errors: list[CellError] | None = None,
) -> Table:
    """Read a table, found by name, then by its headings, wherever it stands.

    Parameters
    ----------
    source : path or open file
        A file, or what `open_tables` returned.
    columns : sequence of Column
        What is asked for. Case, blanks, punctuation, order and units in brackets do not matter.
    name : str, optional
        Name of the table (``"Points"`` finds the table ``tblPoints``, then the sheet ``Points``).
    sheet : str, optional
        The only sheet to look at.
    decimal : {"point", "comma"}, optional
        Decimal separator of numbers typed as text; detected per column when None.
    column_map : mapping, optional
        Key to heading or column letter (see `parse_column_map`). A table whose columns are all
        given by letter needs no headings.
    max_rows : int
        Most rows of a workbook's table; text files have no limit.
    visible_only : bool
        Leave hidden and filtered rows out instead of using them with a remark.
    whole : bool
        Take a row apart from the table, with less than half the numbers of the one before, for a
        note.
    as_typed : bool
        Keep feet and -9999 as they stand in the cells, for formulas beside them that use these.
    errors : list, optional
        Gathers the bad cells instead of raising, to report those of several tables together.

    Raises
    ------
    WorkbookError
        Naming every bad cell, unless ``errors`` is given.
    InputError
        If the file cannot be read, or no table has the required headings.
    """
    if decimal not in (None, "point", "comma"):
        raise InputError(f'decimal: expected "point" or "comma", found {decimal!r}.')
    complaints = errors if errors is not None else []
    book = (
        source
        if isinstance(source, SheetFile | CsvFile)
        else open_tables(source, max_rows=max_rows)
    )
    if isinstance(book, CsvFile):
        place = _CellPlace(*find_in_text(book, columns, column_map))
    else:
        place = _find(book, columns, name=name, sheet=sheet, column_map=column_map)
    mapping = column_map or {}
    for key in (column.key for column in columns if column.key in mapping):
        if key not in place.match.columns:
            about = {"asked": mapping[key], "headings": describe(place.grid, place.match)}
            raise InputError(remark("table.no_such_heading", of=book.label, key=key, **about))
    refuse_doubles(book.label, place.grid.title, place.match)
    refuse_unknown_units(book.label, place.grid.title, place.match, columns)
    take_unit_row(place.grid, place.match)
    if isinstance(book, CsvFile):
        table = _read_text(book, place, columns, decimal, complaints, whole=whole)
    else:
        rows = data_rows(place.grid, place.match, columns, visible_only=visible_only, whole=whole)
        if place.grid.truncated or len(rows.rows) > max_rows:
            raise InputError(
                remark("table.too_long", of=f"{book.label} › {place.grid.title}", count=max_rows)
            )
        table = _new_table(book, place, rows)
        _refuse_merged(table, place.grid, complaints)
        fill(table, columns, _cells(place, rows), decimal, complaints)
    complaints += [
        table.unit_error(key, table.units[key], "px")
        for key in (column.key for column in columns if column.unit == "px")
        if table.units.get(key, "px") != "px"
    ]
    if not as_typed:
        _settle(table, columns)
    guessed = place.match.guessed
    if guessed in table.remarks and ("" in table.texts("id") or table.repeated("id")):
        table.values["id"], table.present = [""] * len(table), table.present - {"id"}
        del table.columns["id"], table.headings["id"]
        table.remarks.remove(guessed)
    for text in table.remarks:
        note_remark(f"{book.label}: {text}")
    if errors is None and complaints:
        raise WorkbookError(complaints)
    return table


def _settle(table: Table, columns: Sequence[Column]) -> None:
    """Make metres of feet, and blanks of the number that stands for a blank."""
    for column in columns:
        key, unit = column.key, table.units.get(column.key, "")
        if column.kind != "number":
            continue
        numbers = table.numbers(key)
        blank = numbers == _BLANK
        if blank.any():
            table.values[key] = numbers = np.where(blank, np.nan, numbers)
            about = {"column": table.headings.get(key) or key, "count": int(blank.sum())}
            table.remarks.append(remark("table.blank_number", number=_BLANK, **about))
        if unit in FEET and (column.unit == "m" or column.any_length):
            table.values[key], table.units[key] = numbers * FEET[unit], "m"
            table.feet[key] = unit
    units = sorted(set(table.feet.values()))
    if units:
        about = {"keys": ", ".join(table.headings.get(key) or key for key in table.feet)}
        table.remarks.append(
            remark(f"table.feet_{'us' if units == ['ftUS'] else 'plain'}", **about)
        )
    if len(units) > 1:
        raise InputError(remark("table.two_feet", of=table.file))


@dataclass(slots=True)
class _CellPlace:
    """A table in a file: its sheet, its columns, and what separates the fields of a text."""

    grid: CellGrid
    match: Match
    delimiter: str = ""


def _find(
    book: SheetFile,
    columns: Sequence[Column],
    *,
    name: str | None,
    sheet: str | None,
    column_map: Mapping[str, str] | None,
) -> _CellPlace:
    """Return the place of a table: by the table's name, by the sheet's, then by headings alone."""
    titles = book.titles
    if sheet is not None:
        titles = [title for title in titles if bare(title) == bare(sheet)]
        if not titles:
            raise InputError(
                remark("table.no_sheet", of=book.label, sheet=sheet, titles=_quoted(book.titles))
            )
    sheet_name = bare(name or "")
    near: _CellPlace | None = None
    areas = [
        a
        for a in book.tables
        if a.sheet in titles and bare(a.name) in (sheet_name, f"tbl{sheet_name}")
    ]
    named = chain(
        (_in_area(book, area, columns, column_map) for area in areas),
        (
            _in_sheet(book, title, columns, column_map)
            for title in titles
            if bare(title) == sheet_name
        ),
    )
    for place in named if sheet_name else ():
        if place and not place.match.missing(columns):
            return place
        near = near or place
    places = [p for title in titles if (p := _in_sheet(book, title, columns, column_map))]
    whole = [place for place in places if not place.match.missing(columns)]
    if whole:
        best = max(whole, key=lambda place: place.match.score[:2])
        others = [p for p in whole if p is not best and p.match.score[:2] == best.match.score[:2]]
        if others:
            names = _quoted(p.grid.title for p in others)
            note = remark("table.which_sheet", sheet=best.grid.title, others=names)
            best.match.remarks.append(note)
        return best
    near = near or max(places, key=lambda place: place.match.score, default=None)
    raise _nothing_found(book, titles, columns, near)


def _in_area(
    book: SheetFile,
    area: TableArea,
    columns: Sequence[Column],
    column_map: Mapping[str, str] | None,
) -> _CellPlace | None:
    """Look for the columns in the heading row of a named table."""
    if area.header_rows == 0:
        return None
    grid = book.grid(area.sheet)
    top, left, bottom, right = area.area
    header = top + area.header_rows - 1
    match = find_columns(
        grid, columns, column_map=column_map, rows=(header, header), span=(left, right)
    )
    if match is None:
        return None
    match = replace(match, header=header, first=header + 1, last=bottom - area.totals_rows)
    if not area.totals_rows:
        _reach_below(grid, match, bottom)
    return _CellPlace(grid, match)


def _reach_below(grid: CellGrid, match: Match, bottom: int) -> None:
    """Take in rows typed directly below a named table that did not grow with them."""
    used = set(match.columns.values())
    row = bottom
    while used & set(grid.rows.get(row + 1, ())):
        row += 1
    if row > bottom:
        match.last = row
        match.remarks.append(remark("table.rows_below", sheet=grid.title, count=row - bottom))
    apart = [n for n, cells in grid.rows.items() if n > row and _count(cells, used) > 1]
    if apart:
        match.remarks.append(remark("table.numbers_below", sheet=grid.title, row=min(apart)))


def _count(cells: Mapping[int, Value], columns: Collection[int]) -> int:
    """Return how many of the columns hold a number in a row."""
    return sum(isinstance(cells.get(column), float) for column in columns)


def _in_sheet(
    book: SheetFile, title: str, columns: Sequence[Column], column_map: Mapping[str, str] | None
) -> _CellPlace | None:
    """Look for the columns anywhere in a sheet."""
    grid = book.grid(title)
    match = find_columns(grid, columns, column_map=column_map)
    if match is None:
        return None
    area = next(
        (a for a in book.tables if a.sheet == title and a.area[0] <= match.header <= a.area[2]),
        None,
    )
    if area and area.totals_rows:
        match.last = area.area[2] - area.totals_rows
    return _CellPlace(grid, match)


def _nothing_found(
    book: SheetFile, titles: Sequence[str], columns: Sequence[Column], near: _CellPlace | None
) -> InputError:
    """Return the complaint that no table fits, naming the nearest one."""
    required = [column.key for column in columns if column.required]
    headings = ", ".join(required or [column.key for column in columns])
    if near is None or not near.match.header:
        empty = not any(book.grid(title).rows for title in titles)
        what = "has no filled cell" if empty else f"has no table with the headings {headings}"
        how = "" if empty else f" {advice('rename', first=columns[0].key)}"
        return InputError(f"{book.label}: {what} (looked in {_quoted(titles)}).{how}")
    missing = ", ".join(near.match.missing(columns))
    about = {"missing": missing, "headings": describe(near.grid, near.match)}
    where = f"{book.label} › {near.grid.title}"
    hint, row = near_headings(near.grid, near.match, columns), near.match.header
    return InputError(f"{remark('table.lacks_column', of=where, row=row, **about)} {hint}")


def _read_text(
    file: CsvFile,
    place: _CellPlace,
    columns: Sequence[Column],
    decimal: Decimal | None,
    errors: list[CellError],
    *,
    whole: bool,
) -> Table:
    """Read a text table, on the quick road where all of its rows are plain."""
    match, proven = place.match, {}
    width = max([*match.columns.values(), *place.grid.rows.get(match.header, {})], default=1)
    plain = plain_rows(file, place.delimiter, width, match, columns, decimal)
    if plain is None:
        place = replace(place, grid=file.grid(place.delimiter, most=None))
        rows = data_rows(place.grid, match, columns, visible_only=False, whole=whole)
        table = _new_table(file, place, rows)
        cells = _cells(place, rows)
        if match.header:
            errors += too_wide(file, place.grid, width, rows.rows)
    else:
        count = len(plain.rows)
        rows = DataRows([*plain.rows], [block_above(place.grid, match)] * count)
        table = _new_table(file, place, rows)
        cells, proven = {**plain.texts}, plain.proven
        table.values |= plain.numbers
    for column in columns if "'" in file.text else ():
        if column.kind in ("text", "flag") and column.key in cells:
            cells[column.key] = [unguarded(text) for text in cells[column.key]]  # type: ignore[arg-type]
    rest = [column for column in columns if column.key not in table.values]
    fill(table, rest, cells, decimal, errors, proven=proven)
    return table


def _new_table(book: SheetFile | CsvFile, place: _CellPlace, rows: DataRows) -> Table:
    """Return a table without values."""
    return Table(
        file=book.label,
        sheet=place.grid.title,
        values={},
        present=frozenset(place.match.columns),
        rows=rows.rows,
        columns=dict(place.match.columns),
        units=dict(place.match.units),
        headings=dict(place.match.headings),
        blocks=rows.blocks,
        remarks=[*book.remarks, *place.match.remarks, *rows.remarks],
        strange=_strange_numbers(place),
    )


def _strange_numbers(place: _CellPlace) -> tuple[str, ...]:
    """Return the headings of numbers that nobody asked for."""
    if not place.match.header:
        return ()
    first = place.grid.rows.get(place.match.first, {})
    headings = strange_headings(place.grid, place.match).items()
    return tuple(text for number, text in headings if take_apart(str(first.get(number, ""))))


def _cells(place: _CellPlace, rows: DataRows) -> dict[str, Sequence[Value | None]]:
    """Return the cells of each column."""
    grid = place.grid.rows
    return {
        key: [grid[row].get(number) for row in rows.rows]
        for key, number in place.match.columns.items()
    }


def _refuse_merged(table: Table, grid: CellGrid, errors: list[CellError]) -> None:
    """Complain about merged cells among the data: they hide values."""
    used = {number: key for key, number in table.columns.items()}
    index_of = {row: index for index, row in enumerate(table.rows)}
    for top, left, bottom, right in grid.merged:
        rows = [
            index_of[row] for row in range(top, min(bottom, top + 10**5) + 1) if row in index_of
        ]
        keys = [
            used[number] for number in range(left, min(right, left + 500) + 1) if number in used
        ]
        if rows and keys:
            area = f"{cell_name(top, left)}:{cell_name(bottom, right)}"
            message = f"the cells {area} are merged, so only one of them has a value; unmerge them."
            errors.append(table.error(rows[0], keys[0], message))


def _quoted(titles: object) -> str:
    return ", ".join(f'"{title}"' for title in titles)  # type: ignore[attr-defined]
