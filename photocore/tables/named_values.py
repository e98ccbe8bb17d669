"""Reading single values of a workbook: by defined name, or beside a label."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from photocore.errors import CellError, InputError, WorkbookError
from photocore.remarks import remark
from photocore.tables import convert
from photocore.tables.csvread import CsvFile
from photocore.tables.heading_words import bare, unit_of, unknown_unit
from photocore.tables.model import Column, NamedValues
from photocore.tables.numbers import Decimal, converted, take_apart
from photocore.tables.read import Source, open_tables
from photocore.workbook import CellGrid, NotCalculated, SheetFile, Value, cell_name

#: Rows of a sheet in which labels of single values are looked for.
_LABELLED = 400
#: What the labels of a sheet must weigh together to be believed where several are asked for.
_BELIEVED = 3


def read_named_values(
    source: Source,
    names: Sequence[Column],
    *,
    sheet: str | None = None,
    decimal: Decimal | None = None,
    errors: list[CellError] | None = None,
    several: bool = False,
    options: Collection[str] = (),
) -> NamedValues:
    """Read single values: by defined name, else the value to the right of a label.

    Parameters
    ----------
    source : path or open file
        A file, or what `open_tables` returned.
    names : sequence of Column
        What is asked for; keys and aliases are labels, keys also defined names.
    sheet : str, optional
        Sheet to prefer when looking for labels, e.g. ``"Setup"``.
    decimal, errors
        As for `read_table`.
    several : bool
        Believe labels on ``sheet``, and elsewhere only where several of them stand together with
        numbers; the remarks then say which cells were read, and which labels were not believed.
    options : collection of str
        Keys that options replace: no remark is on them.

    Raises
    ------
    WorkbookError
        Naming every bad cell, unless ``errors`` is given.
    InputError
        If the file cannot be read, or a required value is absent or blank.
    """
    book = source if isinstance(source, SheetFile | CsvFile) else open_tables(source)
    if isinstance(book, CsvFile):
        book = book.as_sheets()
    complaints = errors if errors is not None else []
    titles = sorted(book.titles, key=lambda title: bare(title) != bare(sheet or ""))
    labels: dict[str, dict[str, str]] = {}
    # Labels are sought on every sheet, at some cost, only if a value has no cell by its name.
    if several and any(_by_defined_name(book, name) is None for name in names):
        labels = {title: _found(book, title, names) for title in titles}
        weights = {title: _weight(book, title, labels[title].values()) for title in titles}
        weights[titles[0]] += _BELIEVED * (len(titles) == 1 or bare(titles[0]) == bare(sheet or ""))
        enough = [title for title in titles if weights[title] >= _BELIEVED]
        titles = sorted(enough, key=weights.__getitem__, reverse=True)
    result = NamedValues(file=book.label, values={}, places={})
    notes = []
    for name in names:
        place, label = _by_defined_name(book, name), ""
        if place is None:
            place, label = _by_label(book, titles, name)
        value: Value | None = None
        if place:
            title, row, column = place
            result.places[name.key] = (title, cell_name(row, column))
            value = book.grid(title).rows.get(row, {}).get(column)

        def complain(_: int, message: str, key: str = name.key) -> None:
            complaints.append(result.error(key, message))

        result.values[name.key] = _single(name, value, label, decimal, complain)
        if label and several and result.has(name.key) and name.key not in options:
            text = str(result.values[name.key]).removesuffix(".0")
            notes.append(f"{name.key} = {text} ({'!'.join(result.places[name.key])})")
        if place and name.kind == "number" and isinstance(value, str) and result.has(name.key):
            result.text_cells.append(f"{place[0]}!{result.cell(name.key)}")
    if notes:
        result.remarks.append(remark("table.beside_labels", values=", ".join(notes)))
    for title in sorted({*labels} - {*titles}):
        left = [f'"{v}"' for k, v in labels[title].items() if k not in {*options, *result.places}]
        if left:
            about = {"values": ", ".join(left), "sheet": title, "wanted": sheet}
            result.remarks.append(remark("table.no_setup_sheet", **about))
    if errors is None and complaints:
        raise WorkbookError(complaints)
    faulty = {error.column for error in complaints}
    missing = [n.key for n in names if n.required and not result.has(n.key) and n.key not in faulty]
    if missing:
        where = f"{book.label} › {sheet}" if sheet else book.label
        raise InputError(f"{where}: no value for {', '.join(missing)}; fill it in.")
    return result


def _single(
    name: Column,
    value: Value | None,
    label: str,
    decimal: Decimal | None,
    complain: convert.Complain,
) -> float | str:
    """Return a value, complaining where its label says another unit than it is asked for in."""
    if name.kind == "text":
        return convert.texts([value], complain)[0]
    if name.kind == "flag":
        return float(convert.flags([value], complain)[0])
    symbol = unit_of(label)
    numbers, _, _ = convert.numbers(
        name, [value], unit=symbol, decimal=decimal, elsewhere=set(), complain=complain
    )
    number = float(np.asarray(numbers)[0])
    unit = symbol or unknown_unit(label)
    if np.isfinite(number) and name.unit and unit not in ("", name.unit):
        # Not converted: options of the command line are written into the same cell.
        metric = converted(number, symbol, name.unit)
        advice = "" if metric is None else f" Write {metric:.15g}, and [{name.unit}]."
        complain(0, f'the label "{label.strip()}" says [{unit}], expected [{name.unit}].{advice}')
        return np.nan
    return number


def _by_defined_name(book: SheetFile, name: Column) -> tuple[str, int, int] | None:
    place = book.names.get(name.key.casefold())
    return place if place and place[0] in book.titles else None


def _by_label(
    book: SheetFile, titles: Sequence[str], name: Column
) -> tuple[tuple[str, int, int] | None, str]:
    """Return the cell of a value whose label stands to its left, and the label."""
    labels = {bare(name.key), *map(bare, name.aliases)}
    for title in titles:
        grid = book.grid(title)
        texts = _labels(grid)
        places = [texts[label] for label in labels if label in texts]
        if places:
            row, column = min(places)
            value = _right_of(grid.rows[row], column, _value_column(grid)[1], name)
            return (title, row, value), str(grid.rows[row][column])
    return None, ""


def _found(book: SheetFile, title: str, names: Sequence[Column]) -> dict[str, str]:
    """Return the labels on a sheet that have a number, by key."""
    labels = {}
    for name in names:
        place, label = _by_label(book, [title], name) if name.kind == "number" else (None, "")
        value = book.grid(title).rows[place[1]].get(place[2]) if place else None
        if _is_number(value) or isinstance(value, NotCalculated):
            labels[name.key] = label
    return labels


def _weight(book: SheetFile, title: str, labels: Iterable[str]) -> int:
    """Return how far the labels of a sheet can be believed to be those asked for.

    D1 and D2 may be doors, columns or bolts, d1 and d2 less likely, and d_1 or "pixel size" hardly;
    nothing counts that goes on with a third.
    """
    texts, weight = _labels(book.grid(title)), 0
    for label in labels:
        plain = bare(label)
        if "_" in label or (len(plain) > 8 and not plain[-1].isdigit()):
            weight += 3
        elif f"{plain[:-1]}3" not in texts:
            weight += 1 if re.fullmatch(r"[A-Z]\d", label.strip()) else 2
    return weight


def _labels(grid: CellGrid) -> dict[str, tuple[int, int]]:
    """Return the place of each text near the top of a sheet, the first one of its kind."""
    if grid.labels is None:
        headings = _value_column(grid)[0]
        grid.labels = {}
        for row in sorted(grid.rows)[:_LABELLED]:
            for column, text in sorted(grid.rows[row].items()):
                named = [_is_number(grid.rows[row].get(column + step)) for step in (1, 2, 3)]
                # A text before three numbers is the name of a point.
                if isinstance(text, str) and row != headings and not all(named):
                    grid.labels.setdefault(bare(text), (row, column))
    return grid.labels


def _is_number(value: Value | None) -> bool:
    return isinstance(value, float) or (isinstance(value, str) and take_apart(value) is not None)


def _value_column(grid: CellGrid) -> tuple[int, int]:
    """Return row and column of the heading "value", zeros where there is none."""
    for row in sorted(grid.rows)[:20]:
        for column, text in grid.rows[row].items():
            if isinstance(text, str) and bare(text) in ("value", "valore", "wert"):
                return row, column
    return 0, 0


def _right_of(cells: Mapping[int, Value], column: int, values: int, name: Column) -> int:
    """Return the column of a value: the one headed so, else the first that fits the kind."""
    if values > column:
        return values
    right = [c for c in sorted(cells) if c > column]
    if name.kind != "text":
        fitting = [c for c in right if not isinstance(cells[c], str)]
        fitting += [c for c in right if take_apart(str(cells[c])) is not None]
        return next(iter(fitting), right[-1] if len(right) == 1 else column + 1)
    return next(iter(right), column + 1)
