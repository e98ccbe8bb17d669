"""``multimedia shift``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import print_json, remark
from photocore.options import (
    NEW_TABLE,
    NUMBER,
    TABLE,
    Numbers,
    as_json,
    choice,
    number,
    overwrite,
)

EXAMPLE = """\b
Examples:
  multimedia shift points.csv --out shifted.csv --camera 0.2,0.1,0.75
                   --indices 1,1.5,1.337 --thicknesses 0.01
  multimedia shift points.xlsx --out shifted.xlsx --z0 500 --indices 1,1.337
  multimedia shift tank.xlsx --json       set-up taken from the workbook's cells n_1 ... z_0
"""


@click.command(epilog=EXAMPLE)
@click.argument("source", metavar="IN", type=TABLE)
@click.option("--out", type=NEW_TABLE, help="Result, .xlsx or .csv; - is a .csv on stdout.")
@click.option(
    "--camera", type=Numbers(3), metavar="X,Y,Z",
    help="Camera, in the unit of the points; Z = 0 is the interface on the water side.",
)  # fmt: skip
@number(
    "--z0", "LENGTH",
    "Instead of --camera: its distance from the first interface, nadir at X = Y = 0.", type=NUMBER,
)  # fmt: skip
@click.option(
    "--indices", type=Numbers(), metavar="N,N,...",
    help="Refractive indices from the camera to the object.  [default: the workbook's]",
)  # fmt: skip
@click.option(
    "--thicknesses", type=Numbers(), metavar="T,...",
    help="Thicknesses of the media between the first and the last, in the unit of the points.  "
    "[default: the workbook's; none for two media]",
)  # fmt: skip
@click.option("--sheet", help="The only sheet to look at.  [default: all]")
@choice(
    "--decimal", "point|comma", "Decimal separator of numbers typed as text.  [default: detected]"
)
@click.option(
    "--csv", "flavour", type=click.Choice(["plain", "excel-it", "excel-de"]), default="plain",
    show_default=True, help="How to write .csv: comma and point, or semicolon and comma.",
)  # fmt: skip
@click.option(
    "--new", is_flag=True, help="Write a new workbook with live formulas, not the table's own."
)
@overwrite
@as_json
def command(
    source: Path, out: Path | None, camera: tuple[float, float, float] | None, z0: float | None,
    as_json: bool, **options: Any,
) -> None:  # fmt: skip
    """Shift points so that straight rays see them where they are seen through the media.

    IN is a table (.xlsx, .xlsm, .ods, .csv; - for stdin) with X, Y, Z (points in water have Z
    below 0) or R, ZP (distance from the camera's nadir, depth). All lengths in one unit. A workbook
    comes back with the results put in and everything else as it was; a text table becomes .csv, or
    a workbook with live formulas.
    """
    if out is None and not as_json:
        raise click.UsageError("give --out FILE, --json, or both.")
    if camera is not None and z0 is not None:
        raise click.UsageError("give --camera or --z0, not both.")
    from multimedia.workbook.workflow import shift_file

    report = shift_file(source, out, camera=camera, z0=z0, **options)
    for text in report.remarks:
        remark(f"Note: {text}")
    if as_json:
        print_json(report.as_dict())
    if out is not None:
        remark(f"{len(report.points.ids)} points written to {out}")
