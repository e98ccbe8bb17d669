"""``bifocal export``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import remark
from photocore.options import declared


@declared
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
