"""Result in, points for other programs out."""

from __future__ import annotations

from pathlib import Path

from bifocal.files.exports import export_points
from bifocal.files.point_tables import read_survey_points
from photocore.errors import InputError, located
from photocore.workbook.newbook import check_new_workbook


def export(
    source: Path, out: Path, *, world: bool = False, order: str = "PNEZD",
    flavour: str = "plain", overwrite: bool = False,
) -> tuple[str, ...]:  # fmt: skip
    """Write the points of a result in the format the ending of ``out`` names; return remarks."""
    if out.exists() and source.exists() and out.samefile(source):
        raise InputError(f"{out}: is the survey itself; name another file to export to.")
    check_new_workbook(out, overwrite=overwrite)
    points, remarks = read_survey_points(source)
    with located(source):
        more = export_points(
            out, points, world=world, order=order, flavour=flavour, overwrite=overwrite
        )
    return (*remarks, *more)
