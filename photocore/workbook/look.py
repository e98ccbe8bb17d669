"""How new workbooks look: cells to fill in, headings, tables with formulas, coloured words."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Border, Font, PatternFill, Side
from openpyxl.worksheet.table import Table, TableFormula, TableStyleInfo
from openpyxl.worksheet.worksheet import Worksheet

INPUT_FILL = PatternFill("solid", start_color="FFF9DB", end_color="FFF9DB")
HEAD_FILL = PatternFill("solid", start_color="DCE6F1", end_color="DCE6F1")
INPUT_EDGE = Border(*(Side(style="hair", color="BFBFBF"),) * 4)


def add_table(sheet: Worksheet, name: str, area: str, columns: Iterable[tuple[str, str]]) -> None:
    """Make a table of an area; of each column its key and its formula, empty for typed cells."""
    table = Table(displayName=name, name=name, ref=area)
    table._initialise_columns()
    for described, (key, formula) in zip(table.tableColumns, columns, strict=True):
        described.name = key
        if formula:
            described.calculatedColumnFormula = TableFormula(attr_text=formula)
    table.tableStyleInfo = TableStyleInfo(name="TableStyleLight1", showRowStripes=False)
    sheet.add_table(table)


def colour_words(
    sheet: Worksheet,
    area: str,
    colours: Mapping[str, tuple[str, str]],
    *,
    bold: Collection[str] = (),
    stop: bool | None = None,
) -> None:
    """Colour the cells of a column, fill and ink, by the word they hold, which tells the same."""
    for text, (fill, ink) in colours.items():
        rule = FormulaRule(
            formula=[f'${area.partition(":")[0]}="{text}"'],
            fill=PatternFill("solid", start_color=fill, end_color=fill),
            font=Font(color=ink, bold=text in bold) if bold else Font(color=ink),
            stopIfTrue=stop,
        )
        sheet.conditional_formatting.add(area, rule)
