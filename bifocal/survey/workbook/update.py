"""Put results into a survey workbook that exists: its own formula cells, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from bifocal.survey.workbook.book import build
from bifocal.survey.workbook.charts import HEAD, LEFT
from bifocal.survey.workbook.columns import TEXT_KEYS
from bifocal.survey.workbook.content import SurveyContent
from bifocal.survey.workbook.reader import SurveyInput
from bifocal.survey.workbook.setup_cells import TYPED_FORMULAS
from bifocal.survey.workbook.sheets import BookBuilder
from photocore.workbook.cells import CellValue
from photocore.workbook.editor import WorkbookEditor
from photocore.workbook.grid import TableArea, split_cell
from photocore.workbook.newbook import RowBlock


def can_update(source: Path, target: Path, survey: SurveyInput, content: SurveyContent) -> str:
    """Return why a survey's file cannot be carried over with results put in; empty if it can."""
    if not survey.is_ours:
        return "it is not a survey workbook of this program"
    if source.suffix.lower() not in (".xlsx", ".xlsm") or (
        target.suffix.lower() != source.suffix.lower()
    ):
        return f"{source.suffix} and {target.suffix} are different kinds of file"
    editor = WorkbookEditor(source)
    area = editor.table("tblPoints")
    if area is None:
        return "its table tblPoints is gone"
    if content.is_pair != ("col1" in survey.table.present):
        return "its formulas are made for another kind of measurement"
    if survey.table.rows and survey.table.rows[-1] > area.area[2]:
        return f"{survey.table.rows[-1] - area.area[2]} points stand below its prepared rows"
    results = editor.table("tblResults")
    if results is not None and _length(results) < _length(area):
        return "its sheet Results is shorter than Points"
    return ""


def update_book(
    source: Path,
    target: Path,
    survey: SurveyInput,
    content: SurveyContent,
    *,
    overwrite: bool = False,
) -> Path | None:
    """Copy a survey workbook with fresh results in its formula cells; all else byte for byte.

    Parameters
    ----------
    source : Path
        The workbook.
    target : Path
        Where to; the same path changes it in place and keeps the old file.
    survey : SurveyInput
        What was read from it.
    content : SurveyContent
        What came out, evaluated as the workbook's own formulas do.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    Path or None
        The backup of a workbook changed in place.
    """
    editor, built = WorkbookEditor(source), build(content)
    _named_cells(editor, built, content)
    area = editor.table("tblPoints")
    assert area is not None
    first = area.area[0] + 1
    rows = [row - first for row in survey.table.rows]
    _table(editor, built, "tblPoints", rows)
    _table(editor, built, "tblResults", rows)
    for name, sheet_rows in (("tblCheck", survey.known_rows), ("tblGeo", survey.control_rows)):
        own = editor.table(name)
        if own is not None:
            _table(editor, built, name, [row - own.area[0] - 1 for row in sheet_rows])
    for name, key in (("tblPlan", "relief_cm"), ("tblFrame", "share"), ("tblVerdict", "tolerance")):
        _fixed_table(editor, built, name, key)
    _charts(editor, built, rows)
    _log(editor, content)
    return editor.save(target, overwrite=overwrite)


def _length(area: TableArea) -> int:
    return area.area[2] - area.area[0]


def _named_cells(editor: WorkbookEditor, built: BookBuilder, content: SurveyContent) -> None:
    """Store the results of single formulas, found by their names; type what was found."""
    typed = {"g_auto", "s3_k", *(f"s3_{i}{j}" for i in "123" for j in "123")}
    for name, defined in built.book.defined_names.items():
        sheet, _, cell = defined.attr_text.partition("!")
        sheet, cell = sheet.strip("'"), cell.replace("$", "")
        place = _place(editor, name)
        if place is None:
            continue
        value = built.results[sheet].get(cell)
        if name in typed and content.georeference is not None:
            shown = built.book[sheet][cell].value
            _type(editor, place, shown if value is None else value)
        elif built.book[sheet][cell].data_type == "f" or name in TYPED_FORMULAS:
            editor.set_result(*place, _result(value))
        if built.book[sheet][cell].data_type != "f" and name not in typed:
            _make_number(editor, place, value)


def _place(editor: WorkbookEditor, name: str) -> tuple[str, int, int] | None:
    """Return sheet, row and column of a named cell."""
    place = next((v for k, v in editor.book.names.items() if k.casefold() == name.casefold()), "")
    sheet, _, cell = place.rpartition("!")
    sheet = sheet.strip("'").replace("''", "'")
    if sheet not in editor.titles or ":" in cell or not cell:
        return None
    return (sheet, *split_cell(cell))


def _type(editor: WorkbookEditor, place: tuple[str, int, int], value: CellValue) -> None:
    """Type a value unless it stands there already."""
    sheet, row, column = place
    if editor.grid(sheet).rows.get(row, {}).get(column) != value:
        editor.set_value(sheet, row, column, value)


def _make_number(editor: WorkbookEditor, place: tuple[str, int, int], value: CellValue) -> None:
    """Turn a number that was typed as text into a number: formulas do not see it otherwise."""
    sheet, row, column = place
    stands = editor.grid(sheet).rows.get(row, {}).get(column)
    if isinstance(stands, str) and isinstance(value, int | float) and value == value:
        editor.set_value(sheet, row, column, value)


def _result(value: CellValue) -> CellValue:
    return "" if value is None else value


def _table(editor: WorkbookEditor, built: BookBuilder, name: str, rows: Sequence[int]) -> None:
    """Store the results of a table; ``rows`` counts from its first row, the others are blank."""
    area, content = editor.table(name), built.tables[name]
    if area is None:
        return
    headings = area.headings()
    first = area.area[0] + 1
    for column in content.columns:
        if column.key not in headings:
            continue
        given = content.cells.get(column.key, ())
        number = headings[column.key]
        if column.kind == "input":
            if column.key not in TEXT_KEYS:
                for row, value in zip(rows, given, strict=False):
                    _make_number(editor, (area.sheet, first + row, number), value)
            continue
        values: list[CellValue] = [_result(column.spare)] * _length(area)
        for row, value in zip(rows, given, strict=False):
            if 0 <= row < len(values):
                values[row] = _result(value)
        if column.kind == "formula":
            editor.set_results(area.sheet, first, {number: values})
            continue
        for row, value in enumerate(values, start=first):
            _type(editor, (area.sheet, row, number), None if value == "" else value)


def _fixed_table(editor: WorkbookEditor, built: BookBuilder, name: str, key: str) -> None:
    """Store the results of a table whose rows are given, where the user left them so."""
    area, content = editor.table(name), built.tables[name]
    if area is None:
        return
    headings = area.headings()
    given = content.cells[key]
    grid = editor.grid(area.sheet).rows
    if key not in headings or _length(area) != len(given):
        return
    first = area.area[0] + 1
    stand = [grid.get(first + i, {}).get(headings[key]) for i in range(len(given))]
    same = (
        isinstance(there, float) and math.isclose(there, float(value or 0), rel_tol=1e-12)
        for there, value in zip(stand, given, strict=True)
    )
    if all(same):
        _table(editor, built, name, range(len(given)))


def _charts(editor: WorkbookEditor, built: BookBuilder, rows: Sequence[int]) -> None:
    """Store the numbers of the charts, blanks as #N/A."""
    if "Charts" not in editor.titles:
        return
    block: RowBlock = built.blocks["Charts"]
    cells = editor.grid("Charts").rows
    keys = [cells.get(HEAD, {}).get(LEFT + 1 + i) for i in range(4)]
    if keys != ["X", "Y", "s_c", "sigma_r"]:
        return
    last = max((row for row, values in cells.items() if LEFT + 1 in values), default=HEAD)
    for i in range(4):
        values: list[CellValue] = [float("nan")] * max(last - HEAD, 0)
        for row, value in zip(rows, block.columns[LEFT + i], strict=False):
            if 0 <= row < len(values):
                values[row] = value
        editor.set_results("Charts", HEAD + 1, {LEFT + 1 + i: values})


def _log(editor: WorkbookEditor, content: SurveyContent) -> None:
    """Add a row to the sheet `Log`, in its first empty row."""
    area = editor.table("tblLog")
    if area is None or not content.log:
        return
    headings = area.headings()
    entry: Mapping[str, str] = dict(
        zip(("time", "program", "what", "file", "sha256"), content.log[-1], strict=True)
    )
    cells = editor.grid(area.sheet).rows
    _, left, bottom, right = area.area
    if not any(column in cells.get(bottom, {}) for column in range(left, right + 1)):
        for key, value in entry.items():
            if key in headings:
                editor.set_value(area.sheet, bottom, headings[key], value)
        return
    editor.append_rows("tblLog", [{key: entry[key] for key in entry if key in headings}])
