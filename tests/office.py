"""Recalculation by LibreOffice, independent of the results stored in a workbook."""

from __future__ import annotations

import atexit
import functools
import hashlib
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import openpyxl
import pytest

from photocore.workbook.changing.recalculation import strip_results
from tests.equipment import place


@functools.cache
def _profile() -> str:
    """Return the profile of this process: two conversions at once that share one fail silently.

    Making a profile costs more than most conversions.
    """
    folder = tempfile.mkdtemp(prefix="office-profile-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).as_uri()


def convert(source: Path, folder: Path, ending: str = "xlsx") -> Path:
    """Convert a file with LibreOffice; return the new one."""
    return _converted(source, folder, ending, [f"{source.stem}.{ending}"])[0]


def _converted(source: Path, folder: Path, ending: str, names: list[str]) -> list[Path]:
    """Convert a file into files of these names."""
    program = place("office")
    out = folder / "office-out"
    out.mkdir(parents=True, exist_ok=True)
    results = [out / name for name in names]
    for result in results:
        result.unlink(missing_ok=True)
    command = [program, f"-env:UserInstallation={_profile()}", "--headless", "--norestore"]
    command += ["--convert-to", ending, "--outdir", str(out), str(source)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    # The exit status is 0 even when nothing could be loaded: only the file tells.
    if any(not result.exists() or result.stat().st_size == 0 for result in results):
        pytest.fail(f"LibreOffice made nothing of {source}: {run.stdout}{run.stderr}")
    return results


#: All sheets as text in UTF-8: texts in quotes, numbers as they are, not as they are shown.
_TEXT = "csv:Text - txt - csv (StarCalc):44,34,76,1,,0,true,true,false,false,false,-1"
_FIELD = re.compile(r'(?:"((?:[^"]|"")*)"|([^,\n]*))(,|\n)')
_calculated: dict[str, openpyxl.Workbook] = {}


def calculated(source: Path, folder: Path) -> openpyxl.Workbook:
    """Return a workbook without results with those that LibreOffice finds; of the same bytes, once.

    They come as text, which costs half of what another workbook costs.
    """
    key = hashlib.sha256(source.read_bytes()).hexdigest()
    if key not in _calculated:
        book = openpyxl.load_workbook(source, data_only=True)
        names = [f"{source.stem}-{title}.csv" for title in book.sheetnames]
        for sheet, path in zip(book, _converted(source, folder, _TEXT, names), strict=True):
            for row, values in enumerate(_rows(path.read_text(encoding="utf-8")), start=1):
                for column, value in enumerate(values, start=1):
                    if value is not None:
                        sheet.cell(row, column).value = value
        while len(_calculated) > 3:
            del _calculated[next(iter(_calculated))]
        _calculated[key] = book
    return _calculated[key]


def _rows(text: str) -> Iterator[list[object]]:
    """Yield the rows of a sheet that went out as text."""
    row: list[object] = []
    for quoted, bare, end in _FIELD.findall(text):
        row.append(quoted.replace('""', '"') or _value(bare))
        if end == "\n":
            yield row
            row = []


def _value(text: str) -> object:
    """Return what a cell that is no text holds."""
    if text in ("", "TRUE", "FALSE"):
        return {"TRUE": True, "FALSE": False}.get(text)
    if text.endswith("%"):
        return float(text[:-1]) / 100
    try:
        return float(text) if set(text) & set(".eE") else int(text)
    except ValueError:  # an error, a date
        return text


def recalculated(source: Path, folder: Path) -> dict[str, dict[str, object]]:
    """Return sheet -> cell -> value, every formula calculated anew by LibreOffice.

    Stored results are taken out first, since LibreOffice trusts them. Errors come as text
    (``"#DIV/0!"``), blank cells are left out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stripped = strip_results(source, folder / f"stripped-{source.stem}{source.suffix}")
    return values_of(calculated(stripped, folder))


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
