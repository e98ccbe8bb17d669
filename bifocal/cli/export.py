"""``bifocal export``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import remark
from photocore.options import NEW_TABLE, NOT_NEGATIVE, TABLE, choice, number, overwrite

EXAMPLE = """\b
Examples:
  bifocal export result.xlsx --out points.dxf
  bifocal export result.xlsx --out points.csv --order PENZD --world
  bifocal export result.xlsx --out points.csv --csv-flavour excel-it
"""


@click.command(epilog=EXAMPLE)
@click.argument("result", type=TABLE)
@click.option(
    "--out", type=NEW_TABLE, required=True,
    help="File to write; its ending chooses the format: .dxf .ply .las .laz .csv .geojson .xlsx; "
    "- is a .csv on stdout",
)  # fmt: skip
@click.option("--world", is_flag=True, help="E, N, H instead of the wall's X, Y, relief [m].")
@choice(
    "--order", "PNEZD|PENZD", "Columns of a .csv: Point, North, East, height Z, Description.",
    default="PNEZD",
)  # fmt: skip
@choice(
    "--csv-flavour", "plain|excel-it|excel-de", "Separator, decimal sign and encoding of a .csv.",
    default="plain",
)  # fmt: skip
@number(
    "--ellipses", "TIMES", "Error ellipses of a .dxf, times one sigma; 0 for none.", default=10.0,
    type=NOT_NEGATIVE,
)  # fmt: skip
@overwrite
def command(
    result: Path, out: Path, world: bool, order: str, csv_flavour: str, ellipses: float,
    overwrite: bool,
) -> None:  # fmt: skip
    """Write the points of a solved survey (RESULT: .xlsx, .ods or .csv) for other programs."""
    from bifocal.workbook.export_workflow import export

    for note in export(
        result, out, world=world, order=order, flavour=csv_flavour, ellipses=ellipses,
        overwrite=overwrite,
    ):  # fmt: skip
        remark(note)
    click.echo(out)
