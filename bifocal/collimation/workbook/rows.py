"""The survey workbook's points as rows, read and changed in place."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.collimation.live_results import observations
from bifocal.collimation.records import Known, PickedPoint, Picks, Pixel, SurveyState
from bifocal.collimation.workbook.outlines import KEYS, TABLE, Outlines, add_outlines, outline_cells
from bifocal.collimation.workbook.setup import typed_setup
from bifocal.model import FlagLimits, Pair
from bifocal.remarks import remark
from bifocal.survey import MOST, SurveyInput, SurveyMedia, media_names
from bifocal.workbook import (
    MATRICES,
    NADIRS,
    SurveyContent,
    is_survey,
    read_survey,
    result_content,
    setup_cells,
    solve,
    typed_content,
    update_book,
    write_survey,
)
from photocore.errors import InputError, PhotogrammetryError
from photocore.output import atomic_path, check_not_open, kept_copy, relative_name, scratch_beside
from photocore.workbook import CellValue, TableArea, WorkbookEditor, name_cell, place_of

#: Rows added at once where the prepared ones are used up.
MORE_ROWS = 50
#: What is typed of a point, and of a check point.
_POINT = ("id", "use", "code", "note")
#: Where its picks stand, (column, row) of both photos: for a pair file, and for an ideal set-up.
_RAW, _IDEAL = ("col1", "row1", "col2", "row2"), ("x1", "y1", "x2", "y2")
_REFERENCE = ("id", "use", "X_ref", "Y_ref", "Z_ref")
#: Cells of the sheet Setup that hold the orientation.
_TYPED = {
    "pair_file", "d_1", "d_2", "c_1", "c_2", "pitch", *media_names(MOST, leaning=True),
    *(name for group in (*MATRICES, *NADIRS) for name in group),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class PointRow:
    """A point as the workbook holds it."""

    picks: Picks
    code: str = ""
    note: str = ""
    use: bool = True
    reference: Known | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadBook:
    """What a workbook holds.

    Attributes
    ----------
    rows : dict of str to PointRow
    sigma_px : float or None
        Precision of a pick. [px]
    limits : FlagLimits
    language : str
    survey : SurveyInput
    """

    rows: dict[str, PointRow]
    sigma_px: float | None
    limits: FlagLimits
    language: str
    survey: SurveyInput


def row_of(point: PickedPoint) -> PointRow:
    """Return a point as a row; what is picked in one photo only takes no part yet."""
    return PointRow(
        point.picks, point.code, point.note, point.use and point.is_complete, point.reference
    )


def put_rows(state: SurveyState, rows: Mapping[str, PointRow], gone: Sequence[str]) -> None:
    """Let the points of a survey be what the workbook's rows say; those that are gone go."""
    for name, row in rows.items():
        before = state.points.get(name)
        state.points[name] = PickedPoint(
            name=name, order=state.next_order() if before is None else before.order,
            picks=row.picks, code=row.code, note=row.note,
            # What is picked in one photo only was left out for that alone.
            use=row.use or None in row.picks, reference=row.reference,
        )  # fmt: skip
    for name in gone:
        state.points.pop(name, None)


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file; empty where there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def read_rows(path: Path) -> ReadBook:
    """Return the points of a workbook.

    Raises
    ------
    InputError
        Naming every bad cell; or if it is made for another kind of measurement.
    """
    survey = read_survey(path)
    points = survey.points
    in_pixels = "px" in (survey.unit or survey.setup.unit)
    if points.is_cartesian.any() and not (in_pixels and is_survey(path)):
        raise InputError(remark("page.ideal_workbook", of=path.name))
    pixels1 = np.where(points.is_cartesian[:, None], points.xy1, points.pixels1)
    pixels2 = np.where(points.is_cartesian[:, None], points.xy2, points.pixels2)
    # Relief measured beside the points is the user's own column; the page keeps the sheet Check.
    listed = len(survey.known_rows)
    known = {
        name: _known(xyz)
        for name, xyz in zip(survey.known.ids[:listed], survey.known.xyz, strict=False)
    }
    rows = {}
    for index, name in enumerate(points.ids):
        # Points given by radial distances alone are the user's own: nothing of them was picked.
        picks = (_pixel(pixels1[index]), _pixel(pixels2[index]))
        if not name or (points.is_polar[index] and picks == (None, None)):
            continue
        rows[name] = PointRow(
            picks,
            points.code[index],
            points.note[index],
            bool(points.use[index]),
            known.get(name),
        )
    return ReadBook(
        rows=rows, sigma_px=survey.setup.measuring.sigma_px, limits=survey.setup.measuring.limits,
        language=survey.language, survey=survey,
    )  # fmt: skip


def _pixel(values: Any) -> Pixel | None:
    column, row = float(values[0]), float(values[1])
    return None if np.isnan(column) or np.isnan(row) else (column, row)


def _known(xyz: Any) -> Known | None:
    x, y, r = (None if np.isnan(value) else float(value) for value in xyz)
    return None if (x, y, r) == (None, None, None) else (x, y, r)


def write_new(
    path: Path, points: Sequence[PickedPoint], pair: Pair, pair_path: Path, language: str,
    outlines: Outlines,
) -> None:  # fmt: skip
    """Write a workbook where there is none."""
    write_survey(
        path, observations(points), pair=pair, pair_path=pair_path, language=language,
        what="points picked with bifocal pick",
    )  # fmt: skip
    if outlines or any(point.reference for point in points):
        change_rows(
            path, read_rows(path), points, pair, pair_path, keep=False, outlines=outlines,
            language=language,
        )  # fmt: skip


def change_rows(
    path: Path,
    read: ReadBook,
    points: Sequence[PickedPoint],
    pair: Pair,
    pair_path: Path,
    *,
    keep: bool,
    outlines: Outlines | None = None,
    language: str = "en",
) -> None:
    """Change the points of a workbook in place, and all that follows from them.

    Parameters
    ----------
    path : Path
    read : ReadBook
        What it holds.
    points : sequence of PickedPoint
        What it shall hold.
    pair, pair_path : Pair, Path
        The geometry its formulas use.
    keep : bool
        Whether to keep a copy of the file as it is, under a name that is free.
    outlines : mapping, optional
        What was drawn to be measured; its table is added where it is lacking.
    language : str
        Of that table.

    Raises
    ------
    InputError
        If the workbook is open elsewhere, or cannot take the points.
    """
    check_not_open(path)
    before = digest_of(path)
    with scratch_beside(path) as typed, atomic_path(path, overwrite=True) as ready:
        editor = WorkbookEditor(path)
        own = pair_path.resolve() == path.resolve()
        _edit(editor, read, points, pair, None if own else relative_name(pair_path, path.parent))
        _outlines(editor, outlines or {}, language)
        editor.save(typed, overwrite=True)
        if not _solved(typed, ready):
            shutil.copyfile(typed, ready)
        check_not_open(path)
        if digest_of(path) != before:
            raise InputError(remark("page.book_changed", name=path.name))
        if keep:
            kept_copy(path)


def _solved(typed: Path, target: Path) -> bool:
    """Write a workbook with the results of all its formulas; tell whether it could be done."""
    try:
        solution = solve(typed)
    except PhotogrammetryError:  # nothing to solve yet: the formulas stay live
        return False
    own = typed_content(solution, replace(result_content(solution, typed, None), log=()))
    try:
        update_book(typed, target, solution.survey, own, options={}, overwrite=True)
    except InputError:  # a workbook changed beyond recognition still takes the picks
        return False
    return True


def _edit(
    editor: WorkbookEditor,
    read: ReadBook,
    points: Sequence[PickedPoint],
    pair: Pair,
    pair_file: str | None,
) -> None:
    """Type points and orientation; ``pair_file`` None: the workbook's set-up is the pair."""
    area = editor.table("tblPoints")
    places = _IDEAL if pair_file is None and read.survey.setup.matrices is None else _RAW
    if area is None or places[0] not in area.headings():
        raise InputError(remark("page.no_pixel_workbook", of=editor.path.name))
    has_lens = "ucol1" in area.headings()
    if has_lens != any(pair.photo(number).lens is not None for number in (1, 2)):
        raise InputError(
            f"{editor.path.name}: its formulas are made for photos "
            f"{'with' if has_lens else 'without'} lens distortion, the orientation is "
            "not; give another workbook with --workbook."
        )
    media = read.survey.setup.media
    if (pair.refracted and not media) or (pair.leans and media and not media.normals):
        raise InputError(remark("page.workbook_in_air", of=editor.path.name))
    if pair_file is not None:
        _set_up(editor, read, pair, pair_file)
    elif places is _IDEAL:
        _type_names(editor, typed_setup(read.survey.setup, pair))
    wanted = {point.name: _point_cells(point, places) for point in points}
    lines = zip(read.survey.table.texts("id"), read.survey.table.rows, strict=True)
    stands = {name: row for name, row in lines if name in read.rows or name in wanted}
    _table(editor, area, (*_POINT, *places), wanted, stands, follower="tblResults")
    check = editor.table("tblCheck")
    if check is not None:
        ids = read.survey.known.ids[: len(read.survey.known_rows)]
        listed = dict(zip(ids, read.survey.known_rows, strict=True))
        references = {
            point.name: _reference_cells(point) for point in points if point.reference is not None
        }
        # Check points that no picked point is called after are the user's own.
        own = {name: row for name, row in listed.items() if name in wanted or name in read.rows}
        _table(editor, check, _REFERENCE, references, own)


def _point_cells(point: PickedPoint, places: Sequence[str]) -> dict[str, CellValue]:
    row = row_of(point)
    values = [value for pick in row.picks for value in pick or (None, None)]
    cells: dict[str, CellValue] = dict(zip(places, values, strict=True))
    return {
        "id": name_cell(point.name),
        **cells,
        "use": int(row.use),
        "code": row.code or None,
        "note": row.note or None,
    }


def _reference_cells(point: PickedPoint) -> dict[str, CellValue]:
    assert point.reference is not None
    known = dict(zip(("X_ref", "Y_ref", "Z_ref"), point.reference, strict=True))
    return {"id": name_cell(point.name), "use": 1, **known}


def _table(
    editor: WorkbookEditor,
    area: TableArea,
    typed: Sequence[str],
    wanted: Mapping[str, Mapping[str, CellValue]],
    stands: Mapping[str, int],
    *,
    follower: str = "",
) -> None:
    """Put rows into a table: changed ones where they stand, new ones into its blank rows.

    Of rows not wanted any more all that is ``typed`` is blanked: also where none is left.
    """
    headings = area.headings()
    cells = editor.grid(area.sheet).rows
    keys = [key for key in typed if key in headings]
    first, last = area.area[0] + 1, area.area[2]
    places = {name: row for name, row in stands.items() if name in wanted}
    taken, freed = set(places.values()), set(stands.values()) - set(places.values())
    blank = [
        row
        for row in range(first, last + 1)
        if row not in taken
        and (row in freed or cells.get(row, {}).get(headings["id"]) in (None, ""))
    ]
    new = [name for name in wanted if name not in places]
    places |= dict(zip(new, blank, strict=False))
    for name, row in places.items():
        for key in keys:
            _set(editor, area.sheet, row, headings[key], wanted[name][key], cells)
    for row in freed - set(places.values()):
        for key in keys:
            _set(editor, area.sheet, row, headings[key], None, cells)
    added = [wanted[name] for name in new if name not in places]
    if added:
        count = len(added) + MORE_ROWS
        columns = {key: [values[key] for values in added] for key in keys}
        editor.append_columns(area.name, columns, count=count)
        if follower and editor.table(follower) is not None:
            editor.append_columns(follower, {}, count=count)


def _outlines(editor: WorkbookEditor, outlines: Outlines, language: str) -> None:
    """Type what was drawn to be measured into its own table."""
    area = editor.table(TABLE)
    if area is None:
        if outlines:
            add_outlines(editor, outlines, language)
        return
    cells, column = editor.grid(area.sheet).rows, area.headings()["id"]
    lines = range(area.area[0] + 1, area.area[2] + 1)
    stands = {str(name): row for row in lines if (name := cells.get(row, {}).get(column))}
    _table(editor, area, list(KEYS), outline_cells(outlines), stands)


def _set(
    editor: WorkbookEditor, sheet: str, row: int, column: int, value: CellValue,
    cells: Mapping[int, Mapping[int, object]],
) -> None:  # fmt: skip
    """Type a value where another one stands."""
    stands = cells.get(row, {}).get(column)
    if (stands in (None, "") and value in (None, "")) or (
        stands == value and isinstance(stands, str) == isinstance(value, str)
    ):
        return
    editor.set_value(sheet, row, column, value)


def _set_up(editor: WorkbookEditor, read: ReadBook, pair: Pair, pair_file: str) -> None:
    """Type the orientation into the sheet Setup, where it is another one."""
    typed = read.survey.setup.media
    media = SurveyMedia.of_photos((pair.image1, pair.image2), typed) if typed else None
    content = SurveyContent(pair=pair, pair_file=pair_file, sigma_px=read.sigma_px, media=media)
    _type_names(editor, {n: value for n, value in setup_cells(content).items() if n in _TYPED})


def _type_names(editor: WorkbookEditor, cells: Mapping[str, CellValue]) -> None:
    """Type values into named cells, where others stand."""
    for name, value in cells.items():
        place = place_of(editor, name)
        if place is None:
            continue
        sheet, row, column = place
        stands = editor.grid(sheet).rows.get(row, {}).get(column)
        if stands != value and not (stands in (None, "") and value in (None, "")):
            editor.set_value(sheet, row, column, value)
