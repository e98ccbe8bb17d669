"""``bifocal export``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import remark
from photocore.options import declared


@declared
def command(result: Path, out: Path, **options: Any) -> None:
    """Write the points of a solved survey (RESULT: .xlsx, .ods or .csv) for other programs."""
    from bifocal.workbook.export_workflow import export

    for note in export(result, out, **options):
        remark(note)
    click.echo(out)
