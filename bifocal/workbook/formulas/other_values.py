"""What the cells of `Setup` hold for a third photo and more beside an ideal pair."""

from __future__ import annotations

from bifocal.model.hypotheses import SCALE_TOLERANCE
from bifocal.survey.setup import OtherPhoto, SurveySetup
from bifocal.workbook.formulas.setup_cells import other_cells
from photocore.workbook.changing.cells import CellValue


def other_values(setup: SurveySetup) -> dict[str, CellValue]:
    """Return the cells of `Setup` for the photos beside those of the pair, by name."""
    cells: dict[str, CellValue] = {}
    scale1 = OtherPhoto(d=setup.taking.d1, c=setup.taking.c1).scale
    for k, other in enumerate(setup.others, start=3):
        column, row = other.nadir or (None, None)
        typed = (other.c, other.d, other.enlargement or 1, column, row)
        cells |= dict(zip(other_cells(k), typed, strict=True))
        scale = other.scale
        cells[f"m_{k}"] = None if scale != scale else scale * 1000
        ratio = scale * (other.enlargement or 1) / scale1
        if ratio == ratio:
            agree = abs(ratio - 1) <= SCALE_TOLERANCE
            cells[f"check_scale_{k}"] = "OK" if agree else "CHECK"
        if setup.unit == "px":
            cells |= {f"off_x{k}": column or 0, f"off_y{k}": row or 0}
    return cells
