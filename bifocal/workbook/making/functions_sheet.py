"""The sheet `Functions`: the formulas of the method as functions with names, explained and tried.

A function stands in the Name Manager as a LAMBDA. The file format wants ``_xlfn.`` before functions
newer than itself and ``_xlpm.`` before what LAMBDA and LET call their values.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Alignment, Font
from openpyxl.worksheet.formula import ArrayFormula

from bifocal.workbook.formulas.columns import FUNCTIONS
from photocore.workbook import (
    HEAD_FONT,
    NOTE_FONT,
    ROW_HEIGHT,
    BookBuilder,
    LiveColumn,
    SheetBuilder,
    Wording,
)

_GIVEN = re.compile(r"\[@(\w+)\]")
#: Characters in a line of column B.
_LINE = 78


def functions_sheet(builder: BookBuilder, *, named: bool) -> None:
    """Write the functions: what each takes and gives, an example, a text for Google Sheets.

    Parameters
    ----------
    builder : BookBuilder
        Takes the sheet.
    named : bool
        Whether the workbook defines them; else they are what its formulas only call.
    """
    sheet = builder.sheet("Functions", "functions_how")
    sheet.headings(4, ("name", "description", "value", "unit"), (23, 82, 18, 9))
    row, calls = 6, []
    for name in FUNCTIONS.content["functions"]:
        calls.append(row + 1 + len(FUNCTIONS.columns(name)))
        row = _function(sheet, row, name, named=named)
    known, unknown = builder.word("functions_known"), builder.word("functions_unknown")
    # Stored is what a program shows that does not calculate: it knows none.
    text = f'IF(ISERROR(C{calls[0]}),"{unknown}","{known}")'
    sheet.formula("A3", text, unknown, name="functions_state", font=NOTE_FONT)
    hidden = FormulaRule(formula=["ISERROR($C6)"], font=Font(color="FFFFFF"))
    sheet.worksheet.conditional_formatting.add(f"C6:C{row}", hidden)
    sheet.finish(landscape=True, freeze="A5", repeat="4:4")


def _function(sheet: SheetBuilder, row: int, name: str, *, named: bool) -> int:
    """Write a function from a row on; return the row of the next one."""
    book, columns = sheet.book, FUNCTIONS.columns(name)
    wording = Wording(**FUNCTIONS.content["functions"][name])
    values, labels = FUNCTIONS.content[name]["values"], FUNCTIONS.content["labels"]
    places = {column.key: f"$C${row + 1 + i}" for i, column in enumerate(columns)}
    sheet.text(f"A{row}", name, HEAD_FONT)
    sheet.text(f"B{row}", wording.in_language(book.language), HEAD_FONT)
    for column, value in zip(columns, values, strict=True):
        row += 1
        cell = f"C{row}"
        key, number = column.key, column.key.rpartition("_")[2]
        if key == name:
            text, unit = book.word("by_cells"), wording.unit
        else:
            label = Wording(**labels[key if key in labels else key.rstrip("0123456789")])
            text, unit = label.in_language(book.language).format(n=number), label.unit
        sheet.describe(row, (key, text), unit)
        if column.formula:
            formula = _GIVEN.sub(lambda match: places[match[1]], column.formula)
            sheet.formula(cell, formula, form="0.000000")
        else:
            sheet.input(cell, value)
            sheet.validate(cell, title=key, prompt=text, limits=(-1e7, 1e7))
    inputs = [column.key for column in columns if not column.formula]
    call = f"{name}({','.join(places[key] for key in inputs)})"
    row += 1
    sheet.describe(row, (f"={name}", book.word("by_function")), wording.unit)
    sheet.formula(f"C{row}", call, values[-1], form="0.000000")
    if named:
        # As an array formula: else Excel reads it as @NAME(...), for one cell.
        sheet.worksheet[f"C{row}"] = ArrayFormula(f"C{row}", f"={call}")
        book.define(name, lambda_text(columns))
    row += 1
    text = f"{name}({', '.join(inputs)}) = {_written(columns, '{}')}"
    sheet.describe(row, ("", book.word("google")))
    sheet.text(f"B{row + 1}", text)
    sheet.worksheet[f"B{row + 1}"].alignment = Alignment(wrap_text=True, vertical="top")
    sheet.worksheet.row_dimensions[row + 1].height = ROW_HEIGHT * (len(text) // _LINE + 1)
    return row + 3


def lambda_text(columns: Sequence[LiveColumn]) -> str:
    """Return a function as its name holds it.

    Parameters
    ----------
    columns : sequence of LiveColumn
        What is given, steps on the way, the result last.
    """
    inputs = (f"_xlpm.{column.key}" for column in columns if not column.formula)
    body = _written(columns, "_xlpm.{}").replace("LET(", "_xlfn.LET(", 1)
    return f"_xlfn.LAMBDA({','.join(inputs)},{body})"


def _written(columns: Sequence[LiveColumn], called: str) -> str:
    """Return what a function computes, in one formula."""
    *steps, result = (column for column in columns if column.formula)

    def own(column: LiveColumn) -> str:
        return _GIVEN.sub(lambda match: called.format(match[1]), column.formula)

    named = "".join(f"{called.format(step.key)},{own(step)}," for step in steps)
    return f"LET({named}{own(result)})" if steps else own(result)
