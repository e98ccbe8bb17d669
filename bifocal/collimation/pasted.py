"""Control points pasted from a spreadsheet: name, X, Y, r, and pixels where they are known."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from bifocal.collimation.records import Known, Pasted, Picks, Pixel
from bifocal.model import FARTHEST_WALL, WorldFrame
from bifocal.orientation import COLUMNS, NoFrontError, in_plane_frame, metres_of, without_unseen
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.tables import read_table
from photocore.tables.advice import without_options
from photocore.tables.csvread import CsvFile
from photocore.tables.lists import as_table

#: No wall carries more.
MOST_ROWS = 5000


def pasted_control(
    text: str, picks: Mapping[str, Picks], frame: WorldFrame | None
) -> tuple[list[tuple[str, Known, Picks]], Pasted]:
    """Return name, X, Y, r [m] and picks [px] of each row, None where blank, and how it was read.

    E, N, H become X along an upright wall, Y and r, as `bifocal align` makes them of its control.

    Parameters
    ----------
    text : str
    picks : mapping
        What is picked on the page already, by name: it tells which side is the wall's front.
    frame : WorldFrame or None
        Of E, N, H that were pasted before.

    Raises
    ------
    InputError
        If no table is recognised, a number is none, a row has no name, or no picks tell the front.
    """
    text, notes = as_table(text.strip("\r\n"), "what was pasted")
    if not text.strip():
        raise InputError(remark("page.nothing_pasted"))
    headed = _with_headings(text)
    with without_options():
        table = read_table(CsvFile("what was pasted", headed, notes), COLUMNS)
    count = len(table)
    if not count or count > MOST_ROWS:
        raise InputError(remark("page.pasted_many", count=count, most=MOST_ROWS))
    names = [name[:80] for name in table.texts("id")]
    if "" in names:
        raise InputError(remark("page.pasted_nameless"))
    xyz = np.column_stack([metres_of(table, key, "") for key in ("X", "Y", "r")])
    if headed != text and (np.nanmax(np.abs(xyz[:, :2]), axis=0, initial=0) > FARTHEST_WALL).all():
        raise InputError(remark("page.pasted_far"))
    pixels = [
        np.column_stack([table.numbers(f"{axis}{photo}") for axis in ("col", "row")])
        for photo in "12"
    ]
    pixels, unseen = without_unseen(pixels, names)
    both = [
        [
            _pixel(row) or picks.get(name, (None, None))[k]
            for name, row in zip(names, pixels[k].tolist(), strict=True)
        ]
        for k in (0, 1)
    ]
    shown = [np.array([pixel or (np.nan, np.nan) for pixel in one]) for one in both]
    try:
        with without_options():
            xyz, frame, placed = in_plane_frame(table, xyz, metres_of(table, "H", ""), shown, frame)
    except NoFrontError:
        raise InputError(remark("page.pasted_heights")) from None
    rows: list[tuple[str, Known, Picks]] = []
    for name, place, *pair in zip(names, xyz.tolist(), *both, strict=True):
        x, y, r = (None if math.isnan(value) else value for value in place)
        rows.append((name, (x, y, r), (pair[0], pair[1])))
    return rows, Pasted(frame=frame, remarks=(*table.remarks, *unseen, *placed))


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
