"""Recalculate a workbook with LibreOffice after taking every cached value out of it."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import Any

import openpyxl

from tests.office import calculated


def strip_cached_values(source: Path, target: Path) -> None:
    """Copy a workbook without the values of its formula cells."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for info in old.infolist():
            data = old.read(info.filename)
            if info.filename.startswith("xl/worksheets/sheet"):
                text = data.decode()
                text = re.sub(r"(</f>)<v>[^<]*</v>", r"\1", text)
                text = re.sub(r"(<f[^>]*/>)<v>[^<]*</v>", r"\1", text)
                text = re.sub(r'(<c r="[A-Z]+\d+"(?: s="\d+")?) t="(?:str|e)"(><f)', r"\1\2", text)
                data = text.encode()
            new.writestr(info.filename, data)


def recalculated(path: Path, folder: Path) -> openpyxl.Workbook:
    """Return the workbook as LibreOffice calculates it, values only."""
    bare = folder / f"bare-{path.stem}.xlsx"
    strip_cached_values(path, bare)
    return calculated(bare, folder)


def rows_of(book: openpyxl.Workbook, sheet: str, head: int) -> list[dict[str, Any]]:
    """Return the rows below the keys in row ``head`` as dictionaries."""
    table = book[sheet].iter_rows(min_row=head, values_only=True)
    keys = [key for key in next(table)]
    return [
        {key: value for key, value in zip(keys, row, strict=True) if key is not None}
        for row in table
    ]
