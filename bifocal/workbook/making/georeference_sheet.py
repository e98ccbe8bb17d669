"""The sheet `Georeference`: control points, the weighted fit as live formulas, residuals."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bifocal.survey import LARGEST_RESIDUAL, SCALE_SHARE
from bifocal.survey.weighted_similarity import TURNS
from bifocal.workbook.content import SurveyContent, control_cells
from bifocal.workbook.formulas.columns import FORMULAS, georeference_columns
from bifocal.workbook.formulas.space_block import STEP_FORM, SpaceBlock
from bifocal.workbook.formulas.world_state import STATE, sentence
from photocore.workbook import (
    HEAD_FONT,
    LABEL_FONT,
    NOTE_FONT,
    WRONG,
    BookBuilder,
    LiveColumn,
    SheetBuilder,
    colour_where,
    column_letters,
)

#: Row of the keys of the control points; model and parameters stand above.
CONTROL_HEAD = 12
#: First column and rows of the steps of the fit: above the folded columns of the table.
_LEFT, _TOP, _ROWS = 10, 3, 8
#: Where the residuals stand, and how far right of them the steps go on.
_RESIDUALS, _BESIDE = 50, 6
#: Where the words of the head stand, and its formulas: those of `formulas.toml`, in their order.
_WORDS = {
    **{f"A{4 + i}": f"geo_{word}" for i, word in enumerate(("model", "auto", "used"))},
    **{f"A{7 + i}": f"geo_{word}" for i, word in enumerate(("n", "scale", "sigma0", "alpha"))},
    **{"D4": "geo_wall", "D5": "geo_world", "D7": "geo_rotation"},
}
_HEAD = (
    *(f"B{row}" for row in range(6, 11)),
    *(f"{letter}{row}" for letter in "GHI" for row in (4, 5)),
    *(f"{letter}{row}" for row in (7, 8, 9) for letter in "GHI"),
)


def georeference(builder: BookBuilder, content: SurveyContent) -> None:
    """Write control points, the closed-form transformation and the residuals."""
    rows, geo = content.control_rows, content.georeference
    sheet = builder.sheet("Georeference")
    sheet.word("A3", "geo_how", NOTE_FONT)
    for cell, key in _WORDS.items():
        sheet.word(cell, key)
    sheet.input("B4", content.model, name="g_model")
    prompt, choices = builder.word("geo_models"), "auto,levelled,3D,2D"
    sheet.validate("B4", title="g_model", prompt=prompt, choices=choices)
    sheet.input("B5", None if geo is None else geo.model, name="g_auto", editable=False)
    head = FORMULAS.columns("georeference", parts={"last": str(TURNS)})
    for cell, line in zip(_HEAD, head, strict=True):
        sheet.formula(cell, line.formula, form=line.number_format, name=line.key)
    sheet.formula("A2", sentence(STATE, builder.word), name=STATE, font=HEAD_FONT)
    colour_where(sheet.worksheet, "A2", "g_alarm=1", WRONG)
    space = SpaceBlock(sheet, blank=geo is None or geo.model != "3D")
    _write_steps(sheet, FORMULAS.columns("georeference", rows="steps", parts=_parts(space)))
    cells = control_cells(content)
    columns = georeference_columns(is_pair=content.is_pair)
    sheet.table("tblGeo", columns, at=(CONTROL_HEAD, 1), rows=rows, cells=cells)
    space.finish()
    last = column_letters(len(columns))
    marked = f"A{CONTROL_HEAD + 1}:{last}{CONTROL_HEAD + rows}"
    colour_where(sheet.worksheet, marked, f'${last}{CONTROL_HEAD + 1}="CHECK"', WRONG, bold=True)
    for letter, width in (("A", 23), ("G", 12.5), ("H", 12.5), ("I", 12.5)):
        sheet.worksheet.column_dimensions[letter].width = width
    repeat = f"{CONTROL_HEAD - 1}:{CONTROL_HEAD}"
    sheet.finish(landscape=True, freeze=f"B{CONTROL_HEAD + 1}", repeat=repeat)


def _parts(space: SpaceBlock) -> dict[str, str]:
    """Return what the steps name of the block of the model 3D, and how many turns there are."""
    return {
        "last": str(TURNS),
        "scale_share": f"{SCALE_SHARE:g}",
        "residual": f"{LARGEST_RESIDUAL:g}",
        "turns": " ".join(f"{i}:{i - 1}" for i in range(2, TURNS + 1)),
        "entries": space.entries.range,
        **{f"shift_{axis}": space.shift.column(n) for n, axis in enumerate("XYZ")},
        **{f"D{n}": space.design.column(n) for n in range(4)},
        **{f"B{i + 1}{j + 1}": space.entries.fixed(3 * j + i, 0) for i, j in np.ndindex(3, 3)},
        **{f"I{i}{j}": space.inverse.fixed(i, j) for i, j in np.ndindex(4, 4)},
    }


def _write_steps(sheet: SheetBuilder, steps: Iterable[LiveColumn]) -> None:
    """Write the steps of the fit, each beside its name, above the folded columns."""
    for i, step in enumerate(steps):
        row, left = _TOP + i % _ROWS, _LEFT + 2 * (i // _ROWS)
        # Not above the residuals, which are not folded away.
        left += _BESIDE if left >= _RESIDUALS else 0
        sheet.text(f"{column_letters(left)}{row}", step.key, LABEL_FONT)
        place = f"{column_letters(left + 1)}{row}"
        sheet.formula(place, step.formula, form=STEP_FORM, name=step.key)
