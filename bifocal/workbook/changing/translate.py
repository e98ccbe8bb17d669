"""Another language for a survey workbook that exists: its labels, not what the user wrote."""

from __future__ import annotations

from dataclasses import replace

from openpyxl import Workbook

from bifocal.workbook.content import SurveyContent
from bifocal.workbook.making.book import build
from bifocal.workbook.words import word
from photocore.workbook import BookBuilder, WorkbookEditor, place_of, plain_title

#: Words in charts, footers and rules: they stand in no cell.
_ELSEWHERE = ("chart_plan", "chart_sigma", "chart_error", "page", "holds", "fails", "Points")


def translate(
    editor: WorkbookEditor, built: BookBuilder, content: SurveyContent, language: str
) -> None:
    """Replace the words of the program by those of another language, wherever they were moved to.

    Parameters
    ----------
    editor : WorkbookEditor
        The workbook.
    built : BookBuilder
        A new one of the same content.
    content : SurveyContent
        What it holds, with the language wanted.
    language : str
        The language it is in.
    """
    old = build(replace(content, language=language)).book
    new = built.book
    for name, defined in new.defined_names.items():
        _reword(editor, built, old, name, defined.attr_text)
    for sheet in new.worksheets:
        if sheet.title not in editor.titles:
            continue
        before = old[sheet.title]
        words = {
            before[cell.coordinate].value: cell.value
            for row in sheet.iter_rows()
            for cell in row
            if cell.data_type == "s" and before[cell.coordinate].value != cell.value
        }
        inside = [area.area for area in editor.tables if area.sheet == sheet.title]
        for row, cells in editor.grid(sheet.title).rows.items():
            for column, value in cells.items():
                is_data = any(
                    top < row <= bottom and left <= column <= right
                    for top, left, bottom, right in inside
                )
                if isinstance(value, str) and value in words and not is_data:
                    editor.set_value(sheet.title, row, column, words[value])
        for key in _ELSEWHERE:
            texts = [word(key, spoken) for spoken in (language, content.language)]
            quoted = {"page": "R{} &P", "holds": '="{}"', "fails": '="{}"'}.get(key, "{}")
            editor.replace_text(sheet.title, *(quoted.format(text) for text in texts))


def _reword(
    editor: WorkbookEditor, built: BookBuilder, old: Workbook, name: str, place: str
) -> None:
    """Write a named formula anew where words of the language stand in it."""
    sheet, _, cell = place.replace("$", "").partition("!")
    sheet, anchor = plain_title(sheet), place_of(editor, name)
    if ":" in cell or anchor is None or old[sheet][cell].data_type != "f":
        return
    formula = built.book[sheet][cell].value
    if formula != old[sheet][cell].value:
        editor.put(*anchor, built.results[sheet].get(cell), formula=formula[1:])
