"""Recalculation by LibreOffice, independent of the results stored in a workbook."""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import openpyxl
import pytest

from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.changing.splice import splice_sheet
from photocore.workbook.reading.package import open_package, read_part, rewrite_package
from photocore.workbook.reading.xlsx import read_directory


def strip_results(source: Path, target: Path) -> Path:
    """Write a copy of a workbook whose formulas have no stored results."""
    with open_package(source) as package:
        parts = {}
        for sheet in read_directory(source, package).sheets:
            data = read_part(source, package, sheet.part)
            parts[sheet.part] = splice_sheet(source, sheet.part, data, SheetChanges()).joined(
                strip=True
            )
    rewrite_package(source, target, parts)
    return target


@functools.cache
def _profile() -> str:
    """Return the profile of this process: two conversions at once that share one fail silently.

    Making a profile costs more than most conversions.
    """
    folder = tempfile.mkdtemp(prefix="office-profile-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).as_uri()


def convert(source: Path, folder: Path, ending: str = "xlsx") -> Path:
    """Convert a file with LibreOffice; skip where it is missing, except in CI."""
    program = shutil.which("soffice") or shutil.which("libreoffice")
    if program is None:
        if os.environ.get("CI"):
            pytest.fail("LibreOffice (soffice) is not installed, but CI is set")
        pytest.skip("LibreOffice (soffice) is not installed")
    out = folder / "office-out"
    out.mkdir(parents=True, exist_ok=True)
    result = out / f"{source.stem}.{ending}"
    result.unlink(missing_ok=True)
    command = [program, f"-env:UserInstallation={_profile()}", "--headless", "--norestore"]
    command += ["--convert-to", ending, "--outdir", str(out), str(source)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    # The exit status is 0 even when nothing could be loaded: only the file tells.
    if not result.exists() or result.stat().st_size == 0:
        pytest.fail(f"LibreOffice made nothing of {source}: {run.stdout}{run.stderr}")
    return result


def recalculated(source: Path, folder: Path) -> dict[str, dict[str, object]]:
    """Return sheet -> cell -> value, every formula calculated anew by LibreOffice.

    Stored results are taken out first, since LibreOffice trusts them. Errors come as text
    (``"#DIV/0!"``), blank cells are left out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stripped = strip_results(source, folder / f"stripped-{source.stem}{source.suffix}")
    book = openpyxl.load_workbook(convert(stripped, folder), data_only=True)
    return values_of(book)


def stored(source: Path) -> dict[str, dict[str, object]]:
    """Return sheet -> cell -> value as stored in the file."""
    return values_of(openpyxl.load_workbook(source, data_only=True))


def values_of(book: openpyxl.Workbook) -> dict[str, dict[str, object]]:
    """Return sheet -> cell -> value of all cells that are not blank."""
    return {
        sheet.title: {
            cell.coordinate: cell.value
            for row in sheet.iter_rows()
            for cell in row
            if cell.value is not None
        }
        for sheet in book.worksheets
    }


def formulas_of(source: Path) -> dict[str, dict[str, str]]:
    """Return sheet -> cell -> formula of all formula cells."""
    book = openpyxl.load_workbook(source)
    return {
        sheet.title: {
            cell.coordinate: str(getattr(cell.value, "text", cell.value))
            for row in sheet.iter_rows()
            for cell in row
            if cell.data_type == "f"
        }
        for sheet in book.worksheets
    }
