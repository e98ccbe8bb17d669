"""Put results, options and language into a survey workbook that exists, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bifocal.remarks import remark
from bifocal.survey import SurveyInput
from bifocal.workbook.changing.kinds import check_kind
from bifocal.workbook.changing.setup_update import (
    add_missing_sheets,
    chart_sheet,
    store_functions,
    write_corrections,
    write_options,
)
from bifocal.workbook.changing.translate import translate
from bifocal.workbook.content import CHART_ROWS, STRUCTURED_ROWS, SurveyContent
from bifocal.workbook.formulas.columns import CHANGED, results_columns
from bifocal.workbook.formulas.setup_cells import TYPED_FORMULAS
from bifocal.workbook.formulas.space_block import BLOCK
from bifocal.workbook.formulas.world_state import SPEAKING, STATE
from bifocal.workbook.making.book import UNPRINTED, build, unprinted_formula
from bifocal.workbook.making.charts import HEAD, LEFT
from bifocal.workbook.words import word
from photocore.errors import InputError
from photocore.workbook import (
    MARK,
    TEXT_KEYS,
    BookBuilder,
    CellValue,
    NewColumn,
    PlainEditor,
    RowBlock,
    Settling,
    TableArea,
    Value,
    WorkbookEditor,
    changed_formulas,
    column_letters,
    column_places,
    escape,
    move_print_area,
    named_columns,
    normal,
    place_of,
    plain_title,
    row_formula,
    short_formula,
    split_area,
    split_cell,
    type_column,
    type_value,
    uncollected,
)

#: Tables whose rows are given, and the columns that tell whether they still are those.
_FIXED = (
    ("tblPlan", "relief_cm"), ("tblFrame", "share"), ("tblBins", "sigmas_to"),
    ("tblVectors", "check_row"),
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class BookUpdate:
    """What became of a survey workbook.

    Attributes
    ----------
    kept : Path or None
        The backup of a workbook changed in place.
    added : tuple of str
        Sheets that were missing and are there again, behind all others.
    remarks : tuple of str
        Formulas of ours that the user changed, and what became of their results.
    """

    kept: Path | None
    added: tuple[str, ...]
    remarks: tuple[str, ...] = ()


#: Columns whose formulas differ where the set-up was corrected.
_CORRECTED = ("s1_used", "s2_used", "theta_used", "q", "grown", "x_c", "y_c", "dx", "dy")


@uncollected()
def update_book(
    source: Path,
    target: Path,
    survey: SurveyInput,
    content: SurveyContent,
    *,
    options: Mapping[str, object],
    overwrite: bool = False,
) -> BookUpdate:
    """Copy a survey workbook with fresh results in its formula cells; all else byte for byte.

    Rows that hold points but no formulas get them, tables grow over points below them, sheets that
    are missing are added, options and language are written where they belong.

    Parameters
    ----------
    source : Path
        The workbook.
    target : Path
        Where to; the same path changes it in place and keeps the old file.
    survey : SurveyInput
        What was read from it.
    content : SurveyContent
        What came out, evaluated as the workbook's own formulas do, in the language wanted.
    options : mapping
        The options that take the place of what the workbook says, by name.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    BookUpdate
        What the user should be told.

    Raises
    ------
    InputError
        If the workbook's formulas are made for another kind of measurement, or it cannot be
        changed.
    """
    names = () if survey.book is None else survey.book.names
    editor = (PlainEditor if MARK in names else WorkbookEditor)(source, survey.book)
    content = replace(
        content, functions=place_of(editor, "functions_state") is not None, changes=_changes(editor)
    )
    built = build(content)
    points = editor.table("tblPoints")
    if points is None:
        raise InputError(f"{source}: has lost its table tblPoints; write to a new workbook.")
    check_kind(source, survey, content)
    if "sigma_E" not in points.headings():
        columns = results_columns(is_pair=content.is_pair, older=True)
        built.tables["tblResults"] = replace(built.tables["tblResults"], columns=columns)
    if other_words := content.language != survey.language:
        translate(editor, built, content, survey.language)
    added = add_missing_sheets(editor, built)
    store_named_cells(editor, built, content)
    store_functions(editor)
    write_options(editor, content, options)
    write_corrections(editor, content)
    rows = [row - points.first for row in survey.table.rows]
    length = max([points.length, *(row + 1 for row in rows)])
    anew = _CORRECTED if content.corrected else ()
    _table(editor, built, "tblPoints", rows, length, anew=anew)
    _table(editor, built, "tblResults", rows, length)
    if "tblWhatIf" in built.tables:
        listed = [row for row in rows if row < CHART_ROWS]
        _table(editor, built, "tblWhatIf", listed)
    _print_points(editor, max(rows, default=0) + 1, content.language)
    for name, sheet_rows in (("tblCheck", survey.known_rows), ("tblGeo", survey.control_rows)):
        area = editor.table(name)
        if area is not None:
            places = [row - area.first for row in sheet_rows]
            if "control" in options:
                _type_list(editor, built, area, sheet_rows)
            _table(editor, built, name, places)
            if name == "tblCheck" and "tblCompare" in built.tables:
                _table(editor, built, "tblCompare", places, area.length)
    for name, key in _FIXED:
        _fixed_table(editor, built, name, key)
    _verdict(editor, built, content, rules="rules" in options, words=other_words)
    _charts(editor, built, rows)
    _log(editor, content)
    changed = changed_results(editor, built)
    del built  # a large sheet wants its memory
    return replace(saved(editor, changed, target, overwrite=overwrite), added=tuple(added))


def _type_list(
    editor: WorkbookEditor, built: BookBuilder, area: TableArea, rows: Sequence[int]
) -> None:
    """Type names and coordinates of a list into a table of check or control points."""
    content, headings = built.tables[area.name], area.headings()
    for column in content.columns:
        if column.kind == "input" and column.key in headings and column.key != "use":
            for row, value in zip(rows, content.cells.get(column.key, ()), strict=False):
                type_value(editor, (area.sheet, row, headings[column.key]), value)


def saved(
    editor: WorkbookEditor, changed: Sequence[str], target: Path, *, overwrite: bool
) -> BookUpdate:
    """Write a changed workbook; where formulas of ours were changed too, with what they give."""
    settling, remarks = Settling(), list[str]()
    kept = editor.save(target, overwrite=overwrite, settle=settling if changed else None)
    if changed:
        cells = ", ".join(changed[:5]) + (", ..." if len(changed) > 5 else "")
        count = len(settling.cells)
        remarks.append(remark("survey.own_formulas", cells=cells, results=count))
    if settling.unknown:
        words = ", ".join(f"{word} ({cell})" for word, cell in settling.unknown.items())
        remarks.append(remark("survey.unknown_functions", names=words))
    return BookUpdate(kept=kept, added=(), remarks=tuple(remarks))


def changed_results(editor: WorkbookEditor, built: BookBuilder) -> list[str]:
    """Return the cells of results that hold another formula than ours."""
    if isinstance(editor, PlainEditor):
        return []  # its formulas are the cells' own, none like another
    # Formulas of ours in their normal form, and the columns and cells where results stand.
    ours, places = set[str](), dict[str, list[tuple[int, int, int]]]()
    for sheet in built.book.worksheets:
        cells = (cell for row in sheet.iter_rows() for cell in row if cell.data_type == "f")
        ours |= {normal(str(cell.value)[1:]) for cell in cells}
    columns_named = _column_names(editor)
    for name, content in built.tables.items():
        area = editor.table(name)
        if area is None:
            continue
        headings = area.headings()
        letters = {key: column_letters(number) for key, number in headings.items()}
        for column in content.columns:
            if column.kind == "formula" and column.key in headings:
                ours.add(normal(row_formula(name, column.formula)[1:]))
                if not _lacks(editor, row_formula(name, column.formula)):
                    short = short_formula(name, column.formula, letters, area.area[0])
                    ours.add(normal(short(area.first)))
                    ours.add(normal(named_columns(short(area.first), columns_named)))
                span = (headings[column.key], area.first, area.area[2])
                places.setdefault(area.sheet, []).append(span)
    for name, defined in built.book.defined_names.items():
        if name.startswith("unprinted_") or name in SPEAKING:
            continue  # follows how many points there were, or the version that wrote it
        sheet, _, cell = defined.attr_text.replace("$", "").partition("!")
        place = place_of(editor, name)
        if place and ":" not in cell and built.book[plain_title(sheet)][cell].data_type == "f":
            places.setdefault(place[0], []).append((place[2], place[1], place[1]))
    return changed_formulas(editor, ours, places)


def _changes(editor: WorkbookEditor) -> dict[str, float] | None:
    """Return what is added to the set-up on the sheet `WhatIf`; None where there is none."""
    places = {name: place_of(editor, f"change_{name}") for name in CHANGED}
    if None in places.values() or editor.table("tblWhatIf") is None:
        return None
    typed = {name: editor.value_at(*place) for name, place in places.items() if place}
    return {name: v if isinstance(v, int | float) else 0.0 for name, v in typed.items()}


def _print_points(editor: WorkbookEditor, count: int, language: str) -> None:
    """Print as many rows of `Points` and `Results` as hold points, unless the user chose others."""
    for name in ("Points", "Results", "WhatIf"):
        area = editor.table(f"tbl{name}")
        place = place_of(editor, f"unprinted_{name}") or place_of(editor, UNPRINTED)
        if place is None or area is None:
            continue
        sheet, row, column = place
        model = editor.models(sheet, row).get(column)
        match = re.search(r">(\d+),", model.formula if model else "")
        head = area.area[0]
        last = min(count, CHART_ROWS) if name == "WhatIf" else count
        if match and move_print_area(editor, area.sheet, head + int(match[1]), head + last):
            formula = unprinted_formula(language, count)
            editor.put(*place, "", formula=formula, style=model.style if model else "")


def store_named_cells(editor: WorkbookEditor, built: BookBuilder, content: SurveyContent) -> None:
    """Store the results of single formulas, found by their names; type what was found."""
    typed = {"g_auto"}
    for name, defined in built.book.defined_names.items():
        sheet, _, cell = defined.attr_text.partition("!")
        sheet, cell = plain_title(sheet), cell.replace("$", "")
        if name == BLOCK:
            _store_block(editor, built.results[sheet], cell)
            continue
        place = place_of(editor, name)
        if place is None:
            continue
        value = built.results[sheet].get(cell)
        if name == "title_world" and not _is_judged(editor, place):  # of an older version
            value = built.value_of(STATE)
        if name in typed and content.georeference is not None:
            shown = built.book[sheet][cell].value
            type_value(editor, place, shown if value is None else value)
        elif built.book[sheet][cell].data_type == "f" or name in TYPED_FORMULAS:
            editor.set_result(*place, value)
        if built.book[sheet][cell].data_type != "f" and name not in typed:
            is_text = isinstance(editor.value_at(*place), str)
            if is_text and _is_number(value):
                editor.set_value(*place, value)


def _is_judged(editor: WorkbookEditor, place: tuple[str, int, int]) -> bool:
    """Whether the sentence on `Results` repeats more than that of the world coordinates."""
    model = editor.models(place[0], place[1]).get(place[2])
    return model is not None and "TRIM(" in model.formula


def _store_block(editor: WorkbookEditor, results: Mapping[str, CellValue], cells: str) -> None:
    """Store the results of the formulas of `BLOCK`, wherever it stands now."""
    sheet, _, area = editor.book.names.get(BLOCK, "").rpartition("!")
    sheet = plain_title(sheet)
    if sheet not in editor.titles or ":" not in area:
        return
    top, left, bottom, right = split_area(cells)
    down, across, *_ = split_area(area.replace("$", ""))
    for cell, value in results.items():
        row, column = split_cell(cell)
        if top <= row <= bottom and left <= column <= right:
            at = (row - top + down, column - left + across)
            editor.set_result(sheet, *at, value)


def _is_number(value: CellValue) -> bool:
    return isinstance(value, int | float) and value == value


def _table(
    editor: WorkbookEditor,
    built: BookBuilder,
    name: str,
    rows: Sequence[int],
    length: int = 0,
    *,
    anew: Sequence[str] = (),
) -> None:
    """Store the results of a table, formulas where they are missing.

    Parameters
    ----------
    rows : sequence of int
        Row of each entry, counted from the table's first; all others are blank.
    length : int
        Rows it must have at least.
    anew : sequence of str
        Columns whose formulas are written whatever stands there.
    """
    area, content = editor.table(name), built.tables[name]
    if area is None:
        return
    headings, first = area.headings(), area.first
    length = max([length, area.length, *(row + 1 for row in rows)])
    editor.extend(name, area.area[0] + length)
    letters = {key: column_letters(number) for key, number in headings.items()}
    styles = editor.styles_of(area.sheet, first)
    is_typed = any(column.kind == "input" for column in content.columns)
    grid = editor.grid(area.sheet).rows if is_typed else {}  # of a large sheet some 70 MB
    nothing: dict[int, Value] = {}
    filled, prepared = [], []
    for column in content.columns:
        if column.key not in headings:
            continue
        cells, number = content.cells.get(column.key, ()), headings[column.key]
        style, is_input = styles.get(number, ""), column.kind == "input"
        if is_input and column.key not in TEXT_KEYS:
            # Points given by radial distances get the coordinates that are corrected.
            completed = bool(anew) and column.key in ("x1", "y1", "x2", "y2")
            for row, value in zip(rows, cells, strict=False):
                cell = grid.get(first + row, nothing).get(number)
                is_text = isinstance(cell, str) and _is_number(value)
                if is_text or (completed and cell is None and value is not None):
                    editor.set_value(area.sheet, first + row, number, value)
        if column.kind != "formula":
            prepared.append(NewColumn(number, [None] * (length - area.length), style))
        if is_input:
            continue
        results = dict(zip(rows, cells, strict=False))
        values = [results.get(row, column.spare) for row in range(length)]
        if column.kind == "value":
            typed = [None if value == "" else value for value in values]
            type_column(editor, (area.sheet, first, number), typed)
            continue
        text = row_formula(area.name, column.formula)[1:]
        if column.key in anew:
            for row, value in enumerate(values, start=first):
                editor.put(area.sheet, row, number, value, formula=text, style=style)
            continue
        formula: str | Callable[[int], str] | None = escape(text)
        if _lacks(editor, text):
            formula = None
        elif length > STRUCTURED_ROWS:
            named = named_columns(escape(column.formula), _column_names(editor))
            formula = short_formula(area.name, named, letters, area.area[0])
        shown = ["" if value is None else value for value in values]
        filled.append(NewColumn(number, shown, style, formula))
    editor.fill_rows(area.sheet, first, filled)
    editor.fill_rows(area.sheet, first + area.length, prepared)


def _column_names(editor: WorkbookEditor) -> set[str]:
    """Return the names of columns of our tables, where they lead there and nowhere else."""
    places, bare = column_places(editor.tables), str.maketrans("", "", "'")
    named = {name: place.translate(bare) for name, place in editor.named.items()}
    return {name for name, place in places.items() if named.get(name) == place.translate(bare)}


def _lacks(editor: WorkbookEditor, formula: str) -> bool:
    """Tell whether a formula names columns that the workbook's tables do not have."""
    for name, key in re.findall(r"(tbl\w+)\[(?:\[#[^]]+\],\[)?(\w+)\]", formula):
        area = editor.table(name)
        if area is None or key not in area.headings():
            return True
    return False


def _fixed_table(editor: WorkbookEditor, built: BookBuilder, name: str, key: str) -> None:
    """Store the results of a table whose rows are given, where the user left them so."""
    area, content = editor.table(name), built.tables[name]
    if area is None:
        return
    headings, cells, grid = area.headings(), content.cells[key], editor.grid(area.sheet).rows
    # Check points are counted; the table has as many rows as there were when it was made.
    if key not in headings or (key != "check_row" and area.length != len(cells)):
        return
    count = min(area.length, len(cells))
    stand = [grid.get(area.first + i, {}).get(headings[key]) for i in range(count)]
    if stand == [float(value or 0) for value in cells[:count]]:
        _table(editor, built, name, range(count))


def _verdict(
    editor: WorkbookEditor, built: BookBuilder, content: SurveyContent, *, rules: bool, words: bool
) -> None:
    """Judge the accuracy by the rules that stand in the workbook, or by those asked for.

    Parameters
    ----------
    rules, words : bool
        Whether the rules, and the formulas with their two words, are written anew.
    """
    area, table = editor.table("tblVerdict"), built.tables["tblVerdict"]
    if area is None or not {"tolerance", "verdict"} <= area.headings().keys():
        return
    headings, first, grid = area.headings(), area.first, editor.grid(area.sheet).rows
    accuracy = built.value_of("check_worst")
    holds, fails = word("holds", content.language), word("fails", content.language)
    formula = row_formula(area.name, table.columns[-1].formula)[1:]
    count = len(table.cells["rule"]) if rules else 0
    length = max(area.length, count)
    style = editor.styles_of(area.sheet, first).get(headings["verdict"], "")
    for i in range(length):
        row = first + i
        tolerance = grid.get(row, {}).get(headings["tolerance"])
        if rules:
            cells = {key: table.cells[key][i] if i < count else None for key in headings}
            tolerance = cells["tolerance"]
            for key in cells.keys() - {"verdict"}:
                type_value(editor, (area.sheet, row, headings[key]), cells[key])
        result = ""
        if isinstance(tolerance, int | float) and isinstance(accuracy, int | float):
            result = holds if accuracy <= tolerance / 1000 else fails
        place = (area.sheet, row, headings["verdict"])
        if rules or words:
            editor.put(*place, result, formula=formula, style=style)
        else:
            editor.set_result(*place, result)
    editor.extend(area.name, area.area[0] + length)


def _charts(editor: WorkbookEditor, built: BookBuilder, rows: Sequence[int]) -> None:
    """Store the numbers of the charts, blanks as #N/A."""
    title = chart_sheet(editor)
    if title is None:
        return
    place = place_of(editor, "chart_vectors")
    if place is not None:  # programs whose titles follow no cell show what is stored in the chart
        cell = built.book.defined_names["chart_vectors"].attr_text.rpartition("!")[2]
        heading, empty = editor.value_at(*place), built.word("chart_vectors").format(n=1)
        text = str(built.results["Charts"][cell.replace("$", "")])
        editor.replace_text(place[0], heading if isinstance(heading, str) else empty, text)
    block: RowBlock = built.blocks["Charts"]
    cells = editor.grid(title).rows
    last = max((row for row, values in cells.items() if LEFT + 1 in values), default=HEAD)
    for i in range(4):
        values: list[CellValue] = [float("nan")] * max(last - HEAD, 0)
        for row, value in zip(rows, block.columns[LEFT + i], strict=False):
            if 0 <= row < len(values):
                values[row] = value
        for row, value in enumerate(values, start=HEAD + 1):
            editor.set_result(title, row, LEFT + 1 + i, value)


def _log(editor: WorkbookEditor, content: SurveyContent) -> None:
    """Add a row to the sheet `Log`, in its first empty row."""
    area = editor.table("tblLog")
    if area is None or not content.log:
        return
    headings = area.headings()
    entries = zip(("time", "program", "what", "file", "sha256"), content.log[-1], strict=True)
    entry = {key: value for key, value in entries if key in headings}
    cells = editor.grid(area.sheet).rows
    _, left, bottom, right = area.area
    if not any(column in cells.get(bottom, {}) for column in range(left, right + 1)):
        for key, value in entry.items():
            editor.set_value(area.sheet, bottom, headings[key], value)
        return
    editor.append_columns("tblLog", {key: [value] for key, value in entry.items()})
