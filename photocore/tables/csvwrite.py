"""Writing text tables in the flavours spreadsheets expect, safe against formula injection."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from photocore.errors import InputError
from photocore.output import atomic_path

#: The cells of a column: an array of numbers, or a text or number a row.
Cells = np.ndarray[Any, Any] | Sequence[str] | Sequence[int] | Sequence[float]
Columns = dict[str, Cells]
#: Flavour -> (delimiter, decimal separator, encoding, line end). Excel in Italy and Germany reads a
#: CSV file as its own language writes it, and needs the byte-order mark to see UTF-8.
FLAVOURS: dict[str, tuple[str, str, str, str]] = {
    "plain": (",", ".", "utf-8", "\n"),
    "excel-it": (";", ",", "utf-8-sig", "\r\n"),
    "excel-de": (";", ",", "utf-8-sig", "\r\n"),
}
#: Where a text needs an apostrophe: at its beginning, and behind semicolons and line ends, at which
#: Excel in Italy and Germany splits any text table, quotes or not.
_DANGEROUS = re.compile(r"(?:^|(?<=[;\r\n]))(?='*[=+\-@\t\r])")


def write_csv(
    path: Path | str,
    columns: Mapping[str, Cells],
    *,
    flavour: str = "plain",
    formats: Mapping[str, str] | None = None,
    headings: bool = True,
    overwrite: bool = False,
) -> None:
    """Write columns as a text table, whole or not at all.

    Parameters
    ----------
    path : path
        The file.
    columns : mapping
        Heading to array of numbers or sequence of texts, all of one length. NaN becomes an empty
        field; texts that a spreadsheet would run as a formula get a leading apostrophe, which
        `photocore.tables.read_table` takes off again.
    flavour : {"plain", "excel-it", "excel-de"}
        Comma and decimal point, or semicolon, decimal comma and byte-order mark.
    formats : mapping, optional
        Heading to format specification, e.g. ``".4f"``; without one, numbers are written so that
        they read back to the last bit.
    headings : bool
        Whether to write the row of headings.
    overwrite : bool
        Whether to replace an existing file.

    Raises
    ------
    InputError
        If the flavour is unknown, the columns differ in length, or the file cannot be written.
    """
    if flavour not in FLAVOURS:
        raise InputError(f'csv flavour "{flavour}" is not known; choose {", ".join(FLAVOURS)}.')
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise InputError(f"{path}: the columns have different lengths {sorted(lengths)}.")
    delimiter, decimal, encoding, end = FLAVOURS[flavour]
    formats = formats or {}
    shown = [_fields(values, decimal, formats.get(name, "")) for name, values in columns.items()]
    with (
        atomic_path(path, overwrite=overwrite) as temporary,
        temporary.open("w", encoding=encoding, newline="") as file,
    ):
        writer = csv.writer(file, delimiter=delimiter, lineterminator=end)
        if headings:
            writer.writerow([guarded(name) for name in columns])
        writer.writerows(zip(*shown, strict=True))


def guarded(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula.

    >>> guarded("=1+1"), guarded("P1"), guarded("P1;=1+1")
    ("'=1+1", 'P1', "P1;'=1+1")
    """
    if not _DANGEROUS.search(text):
        return text
    try:
        float(text)
    except ValueError:
        return _DANGEROUS.sub("'", text)
    return text  # a number, however it begins, is harmless


def _fields(values: Cells, decimal: str, form: str) -> Iterable[str]:
    """Return the fields of one column."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "fiub":
        return _number_fields(values, decimal, form)
    return [
        guarded(item) if isinstance(item, str) else _one_number(item, decimal, form)
        for item in values
    ]


def _number_fields(values: np.ndarray[Any, Any], decimal: str, form: str) -> list[str]:
    if values.dtype.kind in "iub":
        return list(map(str, values.astype(np.int64).tolist()))
    plain = values.tolist()
    if form:
        texts = [format(value, form) for value in plain]
    else:
        texts = [text.removesuffix(".0") for text in map(repr, plain)]
    if decimal != ".":
        texts = [text.replace(".", decimal) for text in texts]
    for index in np.flatnonzero(~np.isfinite(values)):
        texts[index] = ""
    return texts


def _one_number(item: Any, decimal: str, form: str) -> str:
    if item is None:
        return ""
    if isinstance(item, bool | int | np.integer | np.bool_):
        return str(int(item))
    return _number_fields(np.asarray([item], dtype=np.float64), decimal, form)[0]
