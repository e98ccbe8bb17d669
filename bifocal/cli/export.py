"""``bifocal export``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import click

from photocore.cli import remark
from photocore.option_types import NEW_TABLE, NOT_NEGATIVE, TABLE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ExportCommand:
    """The options of ``bifocal export``, and examples.

    bifocal export result.xlsx --out points.dxf
    bifocal export result.xlsx --out points.csv --order PENZD --world
    bifocal export result.xlsx --out points.csv --csv-flavour excel-it
    bifocal export result.xlsx --out shifts.points
    """

    result: Annotated[Path, Argument(TABLE)]
    out: Annotated[Path, Typed(NEW_TABLE)]
    """File to write; its ending chooses the format: .dxf .ply .las .laz .csv .geojson .xlsx;
    .points (QGIS) and .txt (ImageMagick) say how to warp photo 1; - is a .csv on stdout"""
    world: bool = False
    """E, N, H instead of the wall's X, Y, relief [m]."""
    order: Literal["PNEZD", "PENZD"] = "PNEZD"
    """Columns of a .csv: Point, North, East, height Z, Description."""
    flavour: Annotated[Literal["plain", "excel-it", "excel-de"], Typed(flag="--csv-flavour")] = (
        "plain"
    )
    """Separator, decimal sign and encoding of a .csv."""
    ellipses: Annotated[float, Typed(NOT_NEGATIVE, "TIMES")] = 10.0
    """Error ellipses of a .dxf, times one sigma; 0 for none."""
    overwrite: OverwriteOption = False


@declared(ExportCommand)
def command(options: ExportCommand) -> None:
    """Write the points of a solved survey (RESULT: .xlsx, .ods or .csv) for other programs."""
    from bifocal.workbook import export

    for note in export(
        options.result,
        options.out,
        world=options.world,
        order=options.order,
        flavour=options.flavour,
        ellipses=options.ellipses,
        overwrite=options.overwrite,
    ):
        remark(note)
    click.echo(options.out)
