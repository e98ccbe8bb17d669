"""The sheet `Readme`: order of work, formulas, flags, how to measure with nothing else."""

from __future__ import annotations

from openpyxl.worksheet.pagebreak import Break

from bifocal.workbook.content import SurveyContent
from bifocal.workbook.making.cameras_sketch import SIZE, cameras_sketch, hand_sketch
from bifocal.workbook.words import WORDS, readme
from photocore.workbook import HEAD_FONT, ROW_HEIGHT, BookBuilder, SheetBuilder

#: Printed rows of the first page, where the second begins, and the height of its drawing. [pt]
_ROWS, _SECOND, _DRAWN = 34, 37, 300.0
#: Where the first paragraph stands.
_TOP = 3
#: The worked row: its name in `Points`, what r and X must be [m], and how nearly.
_NAME, _KNOWN, _NEARLY = "TEST", {"r": 1.0, "X": 2.0}, 0.002


def readme_sheet(builder: BookBuilder, content: SurveyContent) -> None:
    """Write the sheet; where points are measured by hand, what that takes and a worked row.

    Parameters
    ----------
    builder : BookBuilder
    content : SurveyContent
        What the workbook holds.
    """
    media = bool(content.media_cells)
    lines = readme(builder.language, media=media, leaning=content.leaning)
    sketch = cameras_sketch(builder.word("nadir"), builder.word("sketch"))
    if content.is_pair or media:
        builder.readme(lines, sketch, rows=_ROWS)
        return
    lines += [""] * (_SECOND - _TOP - len(lines))
    lines += str(WORDS.content["readme_hand"][builder.language]).splitlines()
    top = (_SECOND - _TOP) * ROW_HEIGHT
    sketch.size = (SIZE[0], top + _DRAWN)
    sketch.told += f" {builder.word('sketch_hand')}"
    hand_sketch(sketch, top, (builder.word("nadir"), builder.word("alike")))
    builder.readme(lines, sketch, rows=len(lines) + _TOP - 1)
    sheet = SheetBuilder(book=builder, worksheet=builder.book["Readme"])
    sheet.worksheet.row_breaks.append(Break(id=_SECOND - 1))
    sheet.worksheet.page_setup.fitToHeight = 2
    _worked_row(sheet, _TOP + lines.index("{test}"))


def _worked_row(sheet: SheetBuilder, row: int) -> None:
    """Write the line that says whether the worked row comes out, wherever it stands in `Points`."""
    say = {key: sheet.book.word(f"test_{key}") for key in ("waits", "holds", "fails")}
    off = "+".join(
        f'ABS(INDEX(tblPoints[{key}],MATCH("{_NAME}",tblPoints[id],0))-{value:g})'
        for key, value in _KNOWN.items()
    )
    judged = f'IF({off}<{_NEARLY:g},"{say["holds"]}","{say["fails"]}")'
    text = f'IFERROR({judged},"{say["waits"]}")'
    sheet.formula(f"A{row}", text, name="worked_row", font=HEAD_FONT)
