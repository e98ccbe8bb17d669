"""``bifocal doctor``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from photocore.cli import print_result
from photocore.errors import InputError
from photocore.options import Argument, declared
from photocore.shared_options import JsonOption


@dataclass(frozen=True, kw_only=True)
class DoctorCommand:
    """The options of ``bifocal doctor``, and examples.

    bifocal doctor
    bifocal doctor --json
    bifocal doctor survey.xlsx
    """

    book: Annotated[Path | None, Argument(unit="[BOOK.xlsx]")] = None
    as_json: JsonOption = False


@declared(DoctorCommand)
def command(options: DoctorCommand) -> None:
    """Print versions, extras, LibreOffice, cores, memory and disk: what a fault report needs.

    Of a workbook BOOK.xlsx: what in its package no program would read, and, where LibreOffice is
    installed, which cells show something else when it calculates them anew.
    """
    from photocore.machine import diagnosis, diagnosis_lines, office
    from photocore.workbook import examination_lines, examine

    if options.book is None:
        report = diagnosis()
        print_result(report, diagnosis_lines(report), as_json=options.as_json)
        return
    book = examine(options.book, office())
    print_result(book, examination_lines(book, office()), as_json=options.as_json)
    if book["faults"] or book["differ"]:
        raise InputError(f"{options.book}: not as a spreadsheet program would leave it; {_MENDED}")


_MENDED = "open it in one, let it calculate, save it there, or solve it again."
