"""Result in, points for other programs out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bifocal.files import UNCERTAIN_FLAGS, export_points, read_survey_points, write_shifts
from bifocal.remarks import remark
from bifocal.survey import shift_of
from bifocal.workbook.pair_workflow import is_survey, is_workbook, points_of
from bifocal.workbook.workflow import solve
from photocore.errors import InputError, located
from photocore.output import check_not_input
from photocore.workbook import check_new_workbook


def export(
    source: Path, out: Path, *, world: bool = False, order: str = "PNEZD",
    flavour: str = "plain", ellipses: float = 10.0, overwrite: bool = False,
) -> tuple[str, ...]:  # fmt: skip
    """Write the points of a result in the format the ending of ``out`` names; return remarks."""
    check_not_input(out, source)
    check_new_workbook(out, overwrite=overwrite)
    if out.suffix.lower() in (".points", ".txt"):
        return _export_shifts(source, out, overwrite=overwrite)
    try:
        points, remarks = read_survey_points(source)
    except InputError:
        # A survey workbook that no program has calculated yet: its points, its set-up as typed.
        solved = points_of(source) if is_workbook(source) and is_survey(source) else None
        if solved is None:
            raise
        points, remarks = solved, ()
    with located(source):
        more = export_points(
            out, points, world=world, order=order, flavour=flavour, ellipses=ellipses,
            overwrite=overwrite,
        )  # fmt: skip
    return (*remarks, *more)


def _export_shifts(source: Path, out: Path, *, overwrite: bool) -> tuple[str, ...]:
    """Write the shifts on photo 1 of points that can be trusted; return which were left out."""
    solution = solve(source)
    shift, setup, table = shift_of(solution), solution.setup, solution.table
    feet, moves = (
        np.stack([shift[key] for key in keys.split()], -1) for keys in ("x_c y_c", "dx dy")
    )
    if setup is not None and setup.unit == "mm":
        taking = setup.taking
        if taking.pitch is None or taking.nadir1 is None or taking.enlargements[0] != 1.0:
            raise InputError(f"{setup.where}: {remark('export.no_pixels')}")
        to_pixels = np.array([1.0, -1.0]) / taking.pitch
        feet, moves = taking.nadir1 + feet * to_pixels, moves * to_pixels
    places = table.xyz[:, :2]
    good = np.isfinite(np.hstack([feet, moves, places])).all(axis=1) & solution.points.use
    good &= ~np.isin(table.flags, list(UNCERTAIN_FLAGS))
    if not good.any():
        raise InputError(f"{source}: {remark('export.no_shifts')}")
    write_shifts(out, (feet - moves)[good], feet[good], places[good], overwrite=overwrite)
    unsolved = [name for name, is_good in zip(table.ids, good, strict=True) if not is_good]
    if not unsolved:
        return ()
    shown = ", ".join(unsolved[:10]) + (" ..." if len(unsolved) > 10 else "")
    return (remark("export.not_trusted", count=len(unsolved), names=shown),)
