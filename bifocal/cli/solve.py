"""``bifocal solve``."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import click

from bifocal.options.commands import SolveCommand
from photocore.cli import print_json, remark, text_table
from photocore.options import declared

#: Points shown on the screen; the files hold all.
SHOWN = 40


@declared(SolveCommand)
def command(survey: tuple[Path, ...], out: Path | None, as_json: bool, **options: Any) -> None:
    """Solve measured points: relief r, displacements, coordinates, precision, check points.

    SURVEY is a survey workbook, or any table (.xlsx, .xlsm, .ods, .csv) with the headings id and
    x1 y1 x2 y2, or s1 s2 theta, or col1 row1 col2 row2 (raw pixels, with --pair; of a set of photos
    col3 row3 and more, blank where not seen).
    - is a table on stdin. Raw pixels may also stand in a row a photo: id, photo, col, row.
    Or give two lists of picks, of photo 1 and of photo 2 (.csv, .xlsx, .dxf), joined by the names
    of the points, with --pair: a pair file, or a survey workbook for its set-up.
    """
    from bifocal.survey import Measuring, Taking, length_unit, point_rows, solution_json, summary
    from bifocal.workbook import ReadOptions, check_target, column_map, solve, write_result
    from photocore.output import check_not_input
    from photocore.workbook import check_new_workbook

    language, overwrite = options.pop("language"), options.pop("overwrite")
    if out is not None:
        if out.suffix.lower() == ".csv":
            check_not_input(out, *survey)
        if not (out.exists() and survey[0].exists() and out.samefile(survey[0])):
            check_new_workbook(out, overwrite=overwrite)
    if len(survey) > 2:
        raise click.UsageError("Give one survey, or two lists of picks: photo 1 and photo 2.")
    options["columns"] = column_map(options["columns"])
    values: dict[str, Any] = {
        name: kind(**{f.name: options.pop(f.name) for f in fields(kind) if f.name in options})
        for name, kind in (("taking", Taking), ("measuring", Measuring), ("reading", ReadOptions))
    }
    source = survey[0] if len(survey) == 1 else (survey[0], survey[1])
    solution = solve(source, **values, **options)
    if out is not None:
        check_target(out, solution, overwrite=overwrite)
    for text in solution.remarks:
        remark(text)
    if out is not None:
        note = write_result(out, solution, language=language, overwrite=overwrite)
        count = len(solution.table)
        noun = "point" if count == 1 else "points"
        remark(f"{out}: {count} {noun} written{'; ' + note if note else '.'}")
    if as_json:
        print_json(solution_json(solution))
        return
    unit = length_unit(solution)
    headings = ["id", "r [m]", f"e1 [{unit}]", f"e2 [{unit}]", "X [m]", "Y [m]"]
    headings += ["sigma_X [m]", "sigma_Y [m]", "sigma_r [m]"]
    click.echo(text_table([*headings, "flag"], point_rows(solution, SHOWN)))
    if len(solution.table) > SHOWN:
        click.echo(f"... and {len(solution.table) - SHOWN} more points (--json or --out for all).")
    for line in summary(solution):
        click.echo(line)
