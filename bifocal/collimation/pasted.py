"""Control points pasted from a spreadsheet: name, X, Y, r, and pixels where they are known."""

from __future__ import annotations

import math

import numpy as np

from bifocal.collimation.records import Known, Picks, Pixel
from bifocal.orientation.control_points import COLUMNS, metres_of
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.tables import read_table
from photocore.tables.csvread import CsvFile
from photocore.tables.lists import as_table

#: No wall carries more.
MOST_ROWS = 5000


def pasted_control(text: str) -> list[tuple[str, Known, Picks]]:
    """Return name, X, Y, r [m] and picks [px] of each row; None where blank.

    Raises
    ------
    InputError
        If no table is recognised, a number is none, or a row has no name.
    """
    text, _ = as_table(text.strip("\r\n"), "what was pasted")
    if not text.strip():
        raise InputError(remark("page.nothing_pasted"))
    table = read_table(CsvFile("what was pasted", _with_headings(text)), COLUMNS)
    if not len(table) or len(table) > MOST_ROWS:
        raise InputError(remark("page.pasted_many", count=len(table), most=MOST_ROWS))
    if np.isfinite(table.numbers("H")).any() and not np.isfinite(table.numbers("r")).any():
        raise InputError(remark("page.pasted_heights"))
    coordinates = np.column_stack([metres_of(table, key, "") for key in ("X", "Y", "r")])
    picks = np.column_stack([table.numbers(key) for key in ("col1", "row1", "col2", "row2")])
    rows = []
    for name, place, pixels in zip(
        table.texts("id"), coordinates.tolist(), picks.tolist(), strict=True
    ):
        if not name:
            raise InputError(remark("page.pasted_nameless"))
        x, y, r = (None if math.isnan(value) else value for value in place)
        rows.append((name[:80], (x, y, r), (_pixel(pixels[:2]), _pixel(pixels[2:]))))
    return rows


def _with_headings(text: str) -> str:
    """Return the text, with headings put above numbers pasted without them."""
    first = text.splitlines()[0]
    delimiter = next((mark for mark in "\t;|," if mark in first), " ")
    fields = [field.strip() for field in first.split(delimiter)]
    if len(fields) < 2 or not any(_is_number(field) for field in fields[1:]):
        return text
    keys = [column.key for column in COLUMNS if column.key != "H"][: len(fields)]
    return f"{delimiter.join(keys)}\n{text}"


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _pixel(values: list[float]) -> Pixel | None:
    return None if any(math.isnan(value) for value in values) else (values[0], values[1])
