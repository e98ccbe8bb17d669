"""``bifocal doctor``."""

from __future__ import annotations

from pathlib import Path

from photocore.cli import print_result
from photocore.errors import InputError
from photocore.options import declared


@declared
def command(book: Path | None, as_json: bool) -> None:
    """Print versions, extras, LibreOffice, cores, memory and disk: what a fault report needs.

    Of a workbook BOOK.xlsx: what in its package no program would read, and, where LibreOffice is
    installed, which cells show something else when it calculates them anew.
    """
    from photocore.machine import diagnosis, diagnosis_lines, office
    from photocore.workbook.changing.recalculation import examination_lines, examine

    if book is None:
        found = diagnosis()
        print_result(found, diagnosis_lines(found), as_json=as_json)
        return
    found = examine(book, office())
    print_result(found, examination_lines(found, office()), as_json=as_json)
    if found["faults"] or found["differ"]:
        raise InputError(f"{book}: not as a spreadsheet program would leave it; {_MENDED}")


_MENDED = "open it in one, let it calculate, save it there, or solve it again."
