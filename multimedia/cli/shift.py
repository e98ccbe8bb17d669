"""``multimedia shift``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import click

from photocore.cli import print_json, remark
from photocore.option_types import NEW_TABLE, TABLE, Numbers
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ShiftCommand:
    """The options of ``multimedia shift``, and examples.

    multimedia shift points.csv --out shifted.csv --camera 0.2,0.1,0.75
                     --indices 1,1.5,1.337 --thicknesses 0.01
    multimedia shift points.xlsx --out shifted.xlsx --z0 500 --indices 1,1.337
    multimedia shift tank.xlsx --json       set-up taken from the workbook's cells n_1 ... z_0
    """

    source: Annotated[Path, Argument(TABLE, "IN")]
    out: Annotated[Path | None, Typed(NEW_TABLE)] = None
    """Result, .xlsx or .csv; - is a .csv on stdout."""
    camera: Annotated[tuple[float, float, float] | None, Typed(Numbers(3), "X,Y,Z")] = None
    """Camera, in the unit of the points; Z = 0 is the interface on the water side."""
    z0: Annotated[float | None, Typed(unit="LENGTH")] = None
    """Instead of --camera: its distance from the first interface, nadir at X = Y = 0."""
    indices: Annotated[tuple[float, ...] | None, Typed(Numbers(), "N,N,...")] = None
    """Refractive indices from the camera to the object.  [default: the workbook's]"""
    thicknesses: Annotated[tuple[float, ...] | None, Typed(Numbers(), "T,...")] = None
    """Thicknesses of the media between the first and the last, in the unit of the
    points.  [default: the workbook's; none for two media]"""
    sheet: str | None = None
    """The only sheet to look at.  [default: all]"""
    decimal: Literal["point", "comma"] | None = None
    """Decimal separator of numbers typed as text.  [default: detected]"""
    flavour: Annotated[Literal["plain", "excel-it", "excel-de"], Typed(flag="--csv")] = "plain"
    """How to write .csv: comma and point, or semicolon and comma."""
    new: bool = False
    """Write a new workbook with live formulas, not the table's own."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(ShiftCommand)
def command(options: ShiftCommand) -> None:
    """Shift points so that straight rays see them where they are seen through the media.

    IN is a table (.xlsx, .xlsm, .ods, .csv; - for stdin) with X, Y, Z (points in water have Z
    below 0) or R, ZP (distance from the camera's nadir, depth). All lengths in one unit. A workbook
    comes back with the results put in and everything else as it was; a text table becomes .csv, or
    a workbook with live formulas.
    """
    if options.out is None and not options.as_json:
        raise click.UsageError("give --out FILE, --json, or both.")
    if None not in (options.camera, options.z0):
        raise click.UsageError("give --camera or --z0, not both.")
    from multimedia.workbook import shift_file

    report = shift_file(
        options.source,
        options.out,
        camera=options.camera,
        z0=options.z0,
        indices=options.indices,
        thicknesses=options.thicknesses,
        sheet=options.sheet,
        decimal=options.decimal,
        flavour=options.flavour,
        new=options.new,
        overwrite=options.overwrite,
    )
    for text in report.remarks:
        remark(f"Note: {text}")
    if options.as_json:
        print_json(report.as_dict())
    if options.out is not None:
        remark(f"{len(report.points.ids)} points written to {options.out}")
