"""Result in, points for other programs out."""

from __future__ import annotations

from pathlib import Path

from bifocal.files.exports import export_points
from bifocal.files.point_tables import read_survey_points
from bifocal.workbook.pair_workflow import is_survey, is_workbook, points_of
from photocore.errors import InputError, located
from photocore.output import check_not_input
from photocore.workbook.making.newbook import check_new_workbook


def export(
    source: Path, out: Path, *, world: bool = False, order: str = "PNEZD",
    flavour: str = "plain", ellipses: float = 10.0, overwrite: bool = False,
) -> tuple[str, ...]:  # fmt: skip
    """Write the points of a result in the format the ending of ``out`` names; return remarks."""
    check_not_input(out, source)
    check_new_workbook(out, overwrite=overwrite)
    try:
        points, remarks = read_survey_points(source)
    except InputError:
        # A survey workbook that no program has calculated yet: its points, its set-up as typed.
        found = points_of(source) if is_workbook(source) and is_survey(source) else None
        if found is None:
            raise
        points, remarks = found, ()
    with located(source):
        more = export_points(
            out, points, world=world, order=order, flavour=flavour, ellipses=ellipses,
            overwrite=overwrite,
        )  # fmt: skip
    return (*remarks, *more)
