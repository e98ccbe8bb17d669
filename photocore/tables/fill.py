"""Filling a table's columns from its cells, whatever file they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import nearest
from photocore.remarks import remark
from photocore.tables import convert
from photocore.tables.advice import advice
from photocore.tables.heading_words import bare, unknown_unit
from photocore.tables.headings import Match
from photocore.tables.model import Column, Table
from photocore.tables.numbers import FEET, GRAD, Decimal, unit_symbol
from photocore.workbook import CellDate, CellGrid, Value, cell_name, column_letters


def fill(
    table: Table,
    columns: Sequence[Column],
    raw: Mapping[str, Sequence[Value | None]],
    decimal: Decimal | None,
    errors: list[CellError],
    *,
    proven: Mapping[str, set[Decimal]] | None = None,
) -> None:
    """Convert the cells of every column asked for and put them into the table.

    Parameters
    ----------
    table : Table
        Takes the values, units, remarks.
    columns : sequence of Column
        The columns to convert; those without cells become blank.
    raw : mapping
        Key to cells.
    decimal : {"point", "comma"}, optional
        As the user says.
    errors : list
        Takes the complaints, in the order of the sheet.
    proven : mapping, optional
        Decimal separators proven by columns that are converted already.
    """
    numeric = [c.key for c in columns if c.kind in ("number", "integer") and c.key in raw]
    evidence = {key: convert.decimal_evidence(raw[key]) for key in numeric} | dict(proven or {})
    gathered: list[tuple[int, int, CellError]] = []
    for column in columns:
        values = raw.get(column.key, [None] * len(table))

        def complain(index: int, message: str, key: str = column.key) -> None:
            place = (table.rows[index], table.columns[key])
            gathered.append((*place, table.error(index, key, message)))

        if column.kind == "text":
            table.values[column.key] = convert.texts(values, complain)
            # Only sheets hold dates; a text table may be long.
            dated = sum(isinstance(value, CellDate) for value in values) if table.sheet else 0
            if dated:
                table.remarks.append(remark("table.dates", column=column.key, count=dated))
        elif column.kind == "flag":
            table.values[column.key] = convert.flags(values, complain)
        else:
            others = set[Decimal]().union(*(v for k, v in evidence.items() if k != column.key))
            numbers, unit, remarks = convert.numbers(
                column,
                values,
                unit=table.units.get(column.key, ""),
                decimal=decimal,
                elsewhere=others,
                complain=complain,
            )
            table.values[column.key] = numbers
            table.remarks += remarks
            if table.sheet:
                table.text_cells += [
                    f"{table.sheet}!{table.cell(row, column.key)}"
                    for row, value in enumerate(values)
                    if isinstance(value, str) and np.isfinite(numbers[row])
                ]
            if unit:
                if column.key not in table.units:
                    table.typed_units.add(column.key)
                table.units[column.key] = unit
    errors += [error for _, _, error in sorted(gathered, key=lambda item: item[:2])]


def refuse_doubles(label: str, title: str, match: Match) -> None:
    """Refuse a heading that stands above several columns, when any of them could be meant.

    Raises
    ------
    InputError
        Naming the cells.
    """
    for key, numbers in match.doubles.items():
        cells = " and ".join(cell_name(match.header, number) for number in numbers)
        where = f"{label} › {title}" if title else label
        about = {"heading": match.headings[key], "key": key}
        how = advice("letter", key=key, letter=column_letters(numbers[0]))
        raise InputError(f"{remark('table.same_heading', of=where, cells=cells, **about)} {how}")


def refuse_unknown_units(label: str, title: str, match: Match, columns: Sequence[Column]) -> None:
    """Refuse headings of numbers that say a unit nobody here knows.

    Raises
    ------
    WorkbookError
        Naming the cells and the units there are.
    """
    errors = []
    for column in columns:
        heading = match.headings.get(column.key, "")
        unit = match.units.get(column.key, "") or unknown_unit(heading)
        if column.key in match.units and (
            unit not in FEET or column.unit == "m" or column.any_length
        ):
            continue
        if unit and column.kind in ("number", "integer"):
            message = remark("table.strange_unit", heading=heading, unit=unit)
            if unit.casefold() in GRAD:
                message = remark("table.which_grad", found=heading)
            cell = cell_name(match.header, match.columns[column.key])
            error = CellError(message, file=label, sheet=title, cell=cell, column=column.key)
            errors.append(error)
    if errors:
        raise WorkbookError(errors)


def take_unit_row(grid: CellGrid, match: Match) -> None:
    """Skip a row of units below the headings, and remember them."""
    cells = grid.rows.get(match.first, {})
    units = {key: cells[number] for key, number in match.columns.items() if number in cells}
    symbols = {key: unit_symbol(v) for key, v in units.items() if isinstance(v, str)}
    if match.header and symbols and len(symbols) == len(units) and all(symbols.values()):
        match.first += 1
        for key, symbol in symbols.items():
            match.units.setdefault(key, symbol)


def describe(grid: CellGrid, match: Match | None) -> str:
    """Return a few words on the headings found nearest, for a message."""
    row = match.header if match else next(iter(sorted(grid.rows)), 0)
    cells = grid.rows.get(row, {})
    shown = [f'"{v}" ({cell_name(row, c)})' for c, v in sorted(cells.items()) if isinstance(v, str)]
    return ", ".join(shown[:12]) + (", ..." if len(shown) > 12 else "")


def strange_headings(grid: CellGrid, match: Match | None) -> dict[int, str]:
    """Return the headings above none of the columns that were found, by column."""
    row = match.header if match else next(iter(sorted(grid.rows)), 0)
    used = set(match.columns.values()) if match else set()
    cells = sorted(grid.rows.get(row, {}).items())
    return {number: t for number, t in cells if number not in used and isinstance(t, str)}


def near_headings(grid: CellGrid, match: Match | None, columns: Sequence[Column]) -> str:
    """Return what to do about a heading that is missing, and which are like it."""
    words = [word for c in columns if match is None or c.key not in match.columns
             for word in (c.key, *c.aliases) if len(word) > 2]  # fmt: skip
    texts = strange_headings(grid, match).values()
    near = [(text, nearest(bare(text), words)) for text in texts if len(text) > 2]
    missing = match.missing(columns) if match else []
    how = advice("rename", first=next(iter(missing), columns[0].key))
    return how + "".join(
        f" {remark('table.near_heading', heading=t, near=n)}" for t, n in near[:3] if n
    )
