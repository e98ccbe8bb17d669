"""What a workbook's formulas give is what the library solved: else it is not written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bifocal.remarks import remark
from bifocal.workbook.content import SurveyContent
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.workbook import BookBuilder, CellValue

#: Numbers that differ by less are alike: of what is above 1, and of what is uncertain in a number.
ALIKE = 1e-9
#: Turns that are cut off magnify rounding, the more the less control agrees: by so much of sigma0.
_CUT_OFF = 1e-6
#: Control that contradicts itself by more than this share of its extent leads nowhere, on the sheet
#: as elsewhere: both say so, and their numbers are not compared.
_CONTRADICTORY = 0.01

#: A column's key, its cells, what was solved, and what of it is uncertain.
_Column = tuple[str, Sequence[CellValue], FloatArray, FloatArray]


def refuse_contradictions(builder: BookBuilder, content: SurveyContent) -> None:
    """Refuse a workbook whose formulas give other numbers than the library solved.

    Raises
    ------
    InputError
        Naming the first such cell.
    """
    table = content.table
    if table is None:
        return
    for key, cells, solved, uncertain in _columns(builder, content):
        numbers = np.array([v if isinstance(v, float) else np.nan for v in cells[: len(solved)]])
        allowed = ALIKE * np.fmax(np.fmax(1.0, np.abs(solved)), uncertain)
        if content.georeference is not None and key not in table.columns:
            allowed = np.fmax(allowed, _CUT_OFF * content.georeference.sigma0)
        differs = np.abs(numbers - solved) > allowed
        if key.startswith("sigma_"):  # in squares: rounding is left of points placed exactly
            differs &= np.abs(numbers**2 - solved**2) > ALIKE * (solved**2 + uncertain**2)
        differs |= np.isnan(numbers) != np.isnan(solved)
        if differs.any():
            row = int(np.flatnonzero(differs)[0])
            about = {"key": key, "name": table.ids[row], "cell": cells[row] or "-"}
            raise InputError(remark("survey.sheet_contradicts", solved=solved[row], **about))


def _columns(builder: BookBuilder, content: SurveyContent) -> Iterator[_Column]:
    """Yield what both have; photos typed in the other order share relief alone."""
    table, cells = content.table, builder.tables["tblPoints"].cells
    assert table is not None
    keys = (
        ("r", "sigma_r") if content.as_given else ("r", "sigma_r", "X", "Y", "sigma_X", "sigma_Y")
    )
    for key in keys:
        yield key, cells[key], table[key], table["sigma_r"]
    if content.georeference is None or content.as_given:
        return
    placed, results = content.placed, builder.tables["tblResults"].cells
    near, sigma = placed.near, placed.sigma
    if content.georeference.sigma0 > _CONTRADICTORY * np.nanmax(np.ptp(near, axis=0), initial=0.0):
        return
    for i, axis in enumerate("ENH"):
        yield f"n_{axis}", cells[f"n_{axis}"], near[:, i], sigma[:, i]
        yield f"sigma_{axis}", results[f"sigma_{axis}"], sigma[:, i], table["sigma_r"]
