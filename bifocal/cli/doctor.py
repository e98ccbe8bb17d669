"""``bifocal doctor``."""

from __future__ import annotations

import click

from photocore.cli import print_result
from photocore.options import as_json

EXAMPLE = """\b
Examples:
  bifocal doctor
  bifocal doctor --json
"""


@click.command(epilog=EXAMPLE)
@as_json
def command(as_json: bool) -> None:
    """Print versions, extras, LibreOffice, cores, memory and disk: what a fault report needs."""
    from photocore.machine import diagnosis, diagnosis_lines

    found = diagnosis()
    print_result(found, diagnosis_lines(found), as_json=as_json)
