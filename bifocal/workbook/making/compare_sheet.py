"""The sheet `Compare`: relief of every pair of photos at the check points, beside each other."""

from __future__ import annotations

from openpyxl.styles import Alignment

from bifocal.workbook.content import CHECK_ROWS, SurveyContent
from bifocal.workbook.formulas.columns import compare_columns, compared
from bifocal.workbook.making.reference_sheets import statistics_of
from bifocal.workbook.making.setup_sheet import pair_names
from photocore.workbook import HEAD_FONT, BookBuilder, column_letters

#: Row of the keys of the table; statistics stand above.
HEAD = 11


def compare(builder: BookBuilder, content: SurveyContent) -> None:
    """Write errors of relief of every pair, and of all photos together, with their statistics."""
    sheet = builder.sheet("Compare", "compare_how")
    columns, kinds = compare_columns(content.others), compared(content.others)
    keys = [column.key for column in columns]
    sheet.word("A9", "expected_sigma")
    titles = (*pair_names(content.others), builder.word("all_photos"))
    for title, (r, sigma) in zip(titles, kinds, strict=True):
        letter = column_letters(keys.index(f"e_{r}") + 1)
        sheet.text(f"{letter}4", title, HEAD_FONT)
        sheet.worksheet[f"{letter}4"].alignment = Alignment(horizontal="right")
        statistics_of(sheet, letter, f"tblCompare[e_{r}]", f"compare_{{}}_{r}")
        text = f'IF({letter}5=0,"",SQRT(SUMSQ(tblCompare[{sigma}])/{letter}5))'
        sheet.formula(f"{letter}9", text, form="0.0000", name=f"compare_sigma_{r}")
    sheet.table("tblCompare", columns, at=(HEAD, 1), rows=content.check_rows, cells={})
    sheet.worksheet.column_dimensions["A"].width = 26
    sheet.finish(landscape=True, freeze=f"B{HEAD + 1}", repeat=f"{HEAD - 1}:{HEAD}")
    if content.check_rows <= CHECK_ROWS:  # else a page of headings alone follows
        sheet.worksheet.page_setup.fitToHeight = 1
