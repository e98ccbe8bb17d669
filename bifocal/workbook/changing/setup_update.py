"""Options written into the cells of a survey workbook that exists; sheets it lacks."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from openpyxl import load_workbook

from bifocal.remarks import remark
from bifocal.workbook.content import SurveyContent, setup_cells
from bifocal.workbook.formulas.columns import adjustment_names
from bifocal.workbook.formulas.setup_cells import TITLE_BLOCK, cells_of, formulas, groups
from bifocal.workbook.making.charts import HEAD, KEYS, LEFT
from bifocal.workbook.words import word
from photocore.errors import InputError
from photocore.workbook import (
    BookBuilder,
    Calculation,
    CellValue,
    NotCalculated,
    Unknown,
    WorkbookEditor,
    fixed_cell,
    place_of,
    quoted_title,
    with_names,
)

#: Options that have no cell of their own; those of the distances depend on each other.
_OTHERS = {"d1", "d2", "pair", "rules", "adjust_setup"}
#: The table by which a sheet is known, whatever it is called now.
_TABLES = {
    "Results": "tblResults",
    "Check": "tblCheck",
    "Georeference": "tblGeo",
    "Planning": "tblPlan",
    "Log": "tblLog",
}


def add_missing_sheets(editor: WorkbookEditor, built: BookBuilder) -> list[str]:
    """Add the sheets that a survey workbook needs and the user took away; return their titles."""
    missing = [title for title, table in _TABLES.items() if editor.table(table) is None]
    if place_of(editor, "d_1") is None:
        missing.append("Setup")
    check = editor.table("tblCheck")
    # Its last chart draws the errors of the sheet Check, which it finds by its title.
    if chart_sheet(editor) is None and (check is None or check.sheet == "Check"):
        missing.append("Charts")
    if missing:
        add_sheets(editor, built, {title: title for title in missing})
    return missing


def chart_sheet(editor: WorkbookEditor) -> str | None:
    """Return the sheet of the charts, known by its columns, whatever it is called now."""
    columns = range(LEFT + 1, LEFT + 1 + len(KEYS))
    for title in sorted(editor.titles, key=lambda title: title != "Charts"):
        head = editor.grid(title).rows.get(HEAD, {})
        if tuple(head.get(column) for column in columns) == KEYS:
            return title
    return None


def add_sheets(editor: WorkbookEditor, built: BookBuilder, titles: Mapping[str, str]) -> None:
    """Add sheets of a survey workbook behind all others; by their titles, what to call them."""
    editor.add_sheets(built.parts(), {t: editor.free_title(w) for t, w in titles.items()})


def store_functions(editor: WorkbookEditor) -> None:
    """Store what the sheet `Functions` shows where another program saved it without results.

    A function that only its name knows shows what the cells above it calculate.
    """
    state = place_of(editor, "functions_state")
    cells = {} if state is None else editor.grid(state[0]).rows
    blank = [(row, column) for row, values in sorted(cells.items())
             for column, value in values.items() if isinstance(value, NotCalculated)]  # fmt: skip
    if state is None or not blank:
        return
    book, value = Calculation(load_workbook(editor.path)), None
    for row, column in blank:
        if (row, column) != state[1:]:
            with suppress(Unknown):
                value = book.value(state[0], row, column)
            editor.set_result(state[0], row, column, value)


def write_options(
    editor: WorkbookEditor, content: SurveyContent, options: Mapping[str, object]
) -> None:
    """Write options into their cells, in place of the formula of a default too.

    Raises
    ------
    InputError
        If a cell has lost its name.
    """
    cells = {**setup_cells(content), "g_model": content.model}
    written = cells_of(options.keys() - _OTHERS)
    if content.is_pair:
        written.discard("sigma_s")  # follows from sigma_px
        if content.sigma_px is not None:
            written.add("sigma_px")
        if "pair" in options or "adjust_setup" in options:
            listed = groups(is_pair=True, media=content.media_cells)
            typed = {name for group in listed[:-1] for name in group}
            written |= typed - {"delta_d", "sigma_r_max", "k_off", "k_plane", *TITLE_BLOCK}
    elif content.setup is not None:
        written |= {"input_unit"} | (
            {"c_2", "enlargement_2"} if "adjust_setup" in options else set()
        )
    if {"d1", "d2", "pair"} & options.keys():
        written |= _distances(editor, cells)
    for name in sorted(written):
        place = place_of(editor, name)
        if place is None:
            if place_of(editor, "d_2") is not None and cells.get(name) is not None:
                raise InputError(remark("survey.no_cell_named", of=editor.path, name=name))
            continue
        if not _holds(editor, place, cells.get(name)):
            editor.put(*place, cells.get(name))


def _holds(editor: WorkbookEditor, place: tuple[str, int, int], value: CellValue) -> bool:
    """Whether a cell holds a typed value, and no formula."""
    sheet, row, column = place
    present = editor.value_at(*place)
    model = editor.models(sheet, row).get(column)
    if present is None and value == "mm":
        return True
    return (present == value) and (model is None or not model.formula)


def _distances(editor: WorkbookEditor, cells: dict[str, CellValue]) -> set[str]:
    """Return which cells of d_1, d_2 and delta_d take the distances, so that they agree."""
    d_1, step = place_of(editor, "d_1"), place_of(editor, "delta_d")
    first, second = cells.get("d_1"), cells.get("d_2")
    if d_1 is None or step is None or first is None or second is None:
        return {"d_1", "d_2"}
    if not isinstance(editor.value_at(*step), int | float):
        return {"d_1", "d_2"}
    # The difference as people write it: 8.1, not 8.100000000000001.
    cells["delta_d"] = round(float(first) - float(second), 12)
    model = editor.models(d_1[0], d_1[1]).get(d_1[2])
    formula = with_names(model.formula, editor.book.names) if model is not None else ""
    follows = formula.replace(" ", "") == formulas()["d_1"]
    return {"d_2", "delta_d"} if follows else {"d_1", "d_2", "delta_d"}


def write_corrections(editor: WorkbookEditor, content: SurveyContent) -> None:
    """Write what corrects the coordinates of a photo into cells of their own below `Setup`."""
    place = place_of(editor, "d_1")
    if content.setup is None or place is None:
        return
    sheet, known_row, column = place
    below = max(editor.grid(sheet).rows, default=known_row) + 2
    styles = editor.styles_of(sheet, known_row)
    for image, matrix in enumerate(content.setup.adjusted, start=1):
        if matrix is None:
            continue
        for name, value in zip(adjustment_names(image), matrix.ravel().tolist(), strict=True):
            own_place = place_of(editor, name)
            if own_place is None:
                own_place = (sheet, below, column)
                editor.define(name, f"{quoted_title(sheet)}!{fixed_cell(below, column)}")
                editor.put(sheet, below, 1, name)
                editor.put(sheet, below, 2, word("correction", content.language).format(n=image))
                below += 1
            editor.put(*own_place, value, style=styles.get(column, ""))
        below += 1
