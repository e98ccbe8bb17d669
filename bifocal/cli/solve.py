"""``bifocal solve``."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import click

from photocore.cli import print_json, remark, text_table
from photocore.options import FILE, FOCAL, NEW_TABLE, TABLE, as_json, choice, number, overwrite
from photocore.workbook.making.words import LANGUAGES

EXAMPLE = """\b
Examples:
  bifocal solve survey.xlsx --out result.xlsx
  bifocal solve points.csv --pair wall.pair.json --json
  bifocal solve far.dxf near.dxf --pair setup.xlsx --out result.xlsx
  bifocal solve distances.csv --d1 17.5 --d2 9.5 --c1 35 --c2 19 --out result.csv
  bifocal solve old.xlsx --columns "id=A,s1=distance far,s2=D" --d1 17.5 --d2 9.5
"""
#: Points shown on the screen; the files hold all.
SHOWN = 40


@click.command(epilog=EXAMPLE)
@click.argument("survey", type=TABLE, metavar="SURVEY...", nargs=-1, required=True)
@click.option(
    "--out", type=NEW_TABLE, metavar="FILE",
    help="Result: a workbook (.xlsx, .xlsm), a text table (.csv), or - (stdout).  [default: none]",
)  # fmt: skip
@click.option(
    "--pair", type=FILE, metavar="PAIR.pair.json",
    help="Pair file, for points in raw pixels, or a survey workbook for its set-up.  "
    "[default: the workbook's own set-up]",
)  # fmt: skip
@as_json
@click.option(
    "--columns", metavar="MAP",
    help='Which column is which: "id=A,s1=My heading" or "id,x1,y1,x2,y2" for tables without '
    "headings.  [default: found by heading]",
)  # fmt: skip
@click.option("--sheet", metavar="NAME", help="Sheet of the points.  [default: found]")
@choice("--decimal", "point|comma", "Decimal separator of numbers typed as text.  [default: found]")
@click.option("--visible-only", is_flag=True, help="Leave out hidden and filtered rows.")
@number("--d1", "M", "Distance of camera 1 [m].  [default: Setup]")
@number("--d2", "M", "Distance of camera 2 [m].  [default: Setup]")
@number("--c1", "MM", "Principal distance of image 1 [mm].  [default: Setup]", type=FOCAL)
@number("--c2", "MM", "Principal distance of image 2 [mm].  [default: Setup]", type=FOCAL)
@number("--enlargement1", "X", "Print 1, if measured: size over the sensor's.  [default: Setup]")
@number("--enlargement2", "X", "The same of print 2; 1 = measured on the sensor.  [default: Setup]")
@number("--pitch", "MM", "Size of a pixel [mm].  [default: Setup]")
@choice("--unit", "mm|px", "Unit of x1 y1 x2 y2.  [default: as headings or Setup say, else mm]")
@number("--sigma-s", "MM", "Precision of an image coordinate [mm].  [default: Setup, else 0.5 px]")
@number(
    "--sigma-px", "PX",
    "Precision of a raw pixel [px].  [default: the pair file's, else from the misfits of 20 "
    "or more points, else 0.5]",
)  # fmt: skip
@number(
    "--sigma-r-max", "M", "Sigma of r beyond which a point is UNCERTAIN [m].  [default: 2 % of d2]"
)
@click.option(
    "--adjust-setup", is_flag=True,
    help="Correct the set-up by points of the reference plane (code PLANE, r = 0).",
)  # fmt: skip
@click.option(
    "--georeference", "model", type=click.Choice(["auto", "levelled", "3D", "2D"]),
    help="Model of the roto-translation.  [default: the workbook's, else auto]",
)  # fmt: skip
@number(
    "--scale-tolerance", "SHARE", "Share by which the scales of both photos may differ.",
    default=0.02,
)  # fmt: skip
@click.option(
    "--tolerance-rule", "rules", multiple=True, metavar="RULE",
    help="Rule for the verdict: line-0.18, print-0.25, eckstein, a number of mm at scale "
    "(0.2mm) or fixed cm (2cm); repeat it.  [default: the three named]",
)  # fmt: skip
@click.option(
    "--lang", "language", type=click.Choice(LANGUAGES),
    help="Language of a new workbook.  [default: the survey's, else en]",
)  # fmt: skip
@overwrite
def command(
    survey: tuple[Path, ...], out: Path | None, as_json: bool, language: str | None,
    overwrite: bool, **options: Any,
) -> None:  # fmt: skip
    """Solve measured points: relief r, displacements, coordinates, precision, check points.

    SURVEY is a survey workbook, or any table (.xlsx, .xlsm, .ods, .csv) with the headings id and
    x1 y1 x2 y2, or s1 s2 theta, or col1 row1 col2 row2 (raw pixels, with --pair).
    - is a table on stdin.
    Or give two lists of picks, of photo 1 and of photo 2 (.csv, .xlsx, .dxf), joined by the names
    of the points, with --pair: a pair file, or a survey workbook for its set-up.
    """
    from bifocal.survey.results import length_unit, point_rows, solution_json, summary
    from bifocal.survey.setup import Measuring, Taking
    from bifocal.workbook.output import check_target, write_result
    from bifocal.workbook.reading.reader import ReadOptions, column_map
    from bifocal.workbook.workflow import solve
    from photocore.output import check_not_input
    from photocore.workbook.making.newbook import check_new_workbook

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
        said = write_result(out, solution, language=language, overwrite=overwrite)
        count = len(solution.table)
        noun = "point" if count == 1 else "points"
        remark(f"{out}: {count} {noun} written{'; ' + said if said else '.'}")
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
