"""``bifocal report``."""

from __future__ import annotations

from pathlib import Path

import click

from bifocal.options import LANGUAGE, SCALE, UNIT
from photocore.cli import progress_bar, remark, tell_written
from photocore.options import FILE, overwrite

EXAMPLE = """\b
Examples:
  bifocal report result.xlsx --out report.html
  bifocal report wall.pair.json --control points.csv --check check.csv --relief relief.tif
                 --ortho ortho.tif --scale 1:50 --out report.pdf
  bifocal report wall --language it --out rapporto.html
"""


@click.command(epilog=EXAMPLE)
@click.argument("source", type=FILE)
@click.option("--out", type=FILE, required=True, help="Report to write: .html or .pdf.")
@click.option("--control", type=FILE, help="Table of the control points of a PAIR file.")
@click.option("--check", type=FILE, help="Table of independent check points of a PAIR file.")
@click.option("--relief", type=FILE, help="Relief map of `bifocal relief`.")
@click.option("--ortho", type=FILE, help="Orthophoto of `bifocal ortho`.")
@SCALE.but(help="Scale asked for, to be judged.")
@click.option("--title", default="", help="Title.  [default: the file's name]")
@LANGUAGE.but(help="Of the report.")
@UNIT
@overwrite
def command(
    source: Path, out: Path, control: Path | None, check: Path | None, relief: Path | None,
    ortho: Path | None, scale: float | None, title: str, language: str, unit: str | None,
    overwrite: bool,
) -> None:  # fmt: skip
    """Report what was measured, with which geometry, and how good it is.

    SOURCE is a solved workbook, a PAIR file, or the folder of `bifocal facade` or `bifocal
    survey`. The report is one file that needs nothing else: accuracy and verdict per drawing
    scale first, then geometry, photos, relief, residuals, and the method with one point worked
    through for a pocket calculator.
    """
    from bifocal.reports.workflow import ReportTask, report_of

    task = ReportTask(
        title=title, language=language, scale=scale, control=control, check=check, relief=relief,
        ortho=ortho, unit=unit or "",
    )  # fmt: skip
    with progress_bar("report") as progress:
        for text in report_of(source, out, task, overwrite=overwrite, progress=progress):
            remark(text)
    tell_written(out)
