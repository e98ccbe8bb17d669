"""A workbook calculated anew by LibreOffice, where it is: which cells then show something else."""

from __future__ import annotations

import math
import re
import subprocess
import tempfile
from pathlib import Path
from typing import TypedDict

from photocore.errors import InputError
from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.changing.splice import splice_sheet
from photocore.workbook.reading.grid import CellFault, NotCalculated, Value, split_cell
from photocore.workbook.reading.package import (
    Parts,
    open_package,
    package_faults,
    read_part,
    rewrite_package,
)
from photocore.workbook.reading.references import lost_references
from photocore.workbook.reading.xlsx import open_xlsx, read_directory

_FORMULA = re.compile(r'<(?:\w+:)?c r="([A-Z]+\d+)"[^>]*>\s*<(?:\w+:)?f\b[^>]*>([^<]*)')
_ROWS = 2**20
#: Numbers that differ by less are alike. [share]
_ALIKE = 1e-6


class Examination(TypedDict):
    """What `examine` found."""

    faults: list[str]
    formulas: int
    not_calculated: int
    differ: dict[str, tuple[str, str]]
    unknown: list[str]


def examine(path: Path, program: str | None) -> Examination:
    """Return what is wrong with a workbook; the file stays as it is.

    Parameters
    ----------
    path : Path
        An .xlsx or .xlsm file.
    program : str or None
        LibreOffice, if it is there.

    Returns
    -------
    Examination
        ``faults`` of the package, ``formulas`` and how many of them were ``not_calculated`` yet,
        ``differ`` (cells that show something else when calculated anew: what is stored and what
        comes out) and ``unknown`` (cells with functions that LibreOffice does not know).

    Raises
    ------
    InputError
        If it is not a workbook, or LibreOffice makes nothing of it.
    """
    stored, broken = open_xlsx(path, max_rows=_ROWS), package_faults(path)
    faults = broken or sorted(lost_references(path))
    cells = [(t, *formula) for t in stored.titles for formula in _FORMULA.findall(stored.text(t))]
    differ: dict[str, tuple[str, str]] = {}
    unknown: list[str] = []
    blank = 0
    with open_package(path) as package:
        names = read_directory(path, package).names
    lambdas = "|".join(re.escape(n) for n, text in names.items() if "_xlfn.LAMBDA" in text)
    called = re.compile(rf"\b(?:{lambdas or '(?!)'})\(")
    with tempfile.TemporaryDirectory() as folder:
        fresh = stored
        if program and not broken:
            fresh = open_xlsx(_converted(path, Path(folder), program), max_rows=_ROWS)
        for title, cell, text in cells:
            row, column = split_cell(cell)
            old, new = (
                book.grid(title).rows.get(row, {}).get(column, "") for book in (stored, fresh)
            )
            if called.search(text) or (new == CellFault("#NAME?") and old != new):
                unknown.append(f"{title}!{cell}")
            elif isinstance(old, NotCalculated):
                blank += 1
            elif not _alike(old, new):
                differ[f"{title}!{cell}"] = _shown(old), _shown(new)
    return Examination(
        faults=faults, formulas=len(cells), not_calculated=blank, differ=differ, unknown=unknown
    )


def examination_lines(facts: Examination, program: str | None) -> list[str]:
    """Return what `examine` found for people."""
    blank = f", {facts['not_calculated']} without a result yet" if facts["not_calculated"] else ""
    lines = [*facts["faults"], f"{facts['formulas']} formulas{blank}"]
    if program is None:
        return [*lines, "LibreOffice is not installed: nothing was calculated anew"]
    lines += [
        f"{cell}: stored {old}, calculated {new}" for cell, (old, new) in facts["differ"].items()
    ]
    if facts["unknown"]:
        cells = ", ".join(facts["unknown"][:9])
        lines.append(
            f"LibreOffice does not know the functions of {len(facts['unknown'])} cells: {cells}"
        )
    return [*lines, f"{len(facts['differ'])} cells differ when calculated anew"]


def strip_results(source: Path, target: Path) -> Path:
    """Write a copy of a workbook whose formulas have no stored results."""
    parts = Parts()
    with open_package(source) as package:
        for part in (sheet.part for sheet in read_directory(source, package).sheets):
            data = read_part(source, package, part)
            parts[part] = splice_sheet(source, part, data, SheetChanges()).written(strip=True)
    rewrite_package(source, target, parts)
    return target


def _converted(path: Path, folder: Path, program: str) -> Path:
    """Return a copy that LibreOffice calculated: it trusts stored results, so they are left out."""
    bare, out = strip_results(path, folder / f"bare{path.suffix}"), folder / "out"
    profile = f"-env:UserInstallation={(folder / 'profile').as_uri()}"
    words = [program, profile, "--headless", "--norestore", "--convert-to", "xlsx", "--outdir"]
    run = subprocess.run([*words, str(out), str(bare)], capture_output=True, text=True, check=False)
    if not (out / "bare.xlsx").exists():
        raise InputError(f"{path}: LibreOffice made nothing of it: {run.stderr.strip():.200}")
    return out / "bare.xlsx"


def _alike(old: Value, new: Value) -> bool:
    if isinstance(old, float) and isinstance(new, float):
        return math.isclose(old, new, rel_tol=_ALIKE, abs_tol=1e-12)
    return old == new


def _shown(value: Value) -> str:
    """Return what a cell holds, for people."""
    return value.text if isinstance(value, CellFault) else str(value) or "blank"
