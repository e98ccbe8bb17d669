"""``bifocal doctor``."""

from __future__ import annotations

from photocore.cli import print_result
from photocore.options import declared


@declared
def command(as_json: bool) -> None:
    """Print versions, extras, LibreOffice, cores, memory and disk: what a fault report needs."""
    from photocore.machine import diagnosis, diagnosis_lines

    found = diagnosis()
    print_result(found, diagnosis_lines(found), as_json=as_json)
