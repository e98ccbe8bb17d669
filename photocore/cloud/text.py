"""Point clouds as text: any delimiter, decimal comma, columns by heading; other cells untouched."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from multimedia.bathymetry.clouds import CHUNK, Chunk, Cloud, CloudWriter
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError

#: Headings of each coordinate and of the columns other commands ask for.
HEADINGS: dict[str, tuple[str, ...]] = {
    "X": ("x", "e", "east", "easting", "ost", "est"),
    "Y": ("y", "n", "north", "northing", "nord"),
    "Z": ("z", "h", "height", "elevation", "altitude", "sfmz", "hoehe", "höhe", "quota"),
    "id": ("id", "point", "pointid", "name", "punkt", "punto"),
    "cameras": ("cameras", "images", "photos"),
    "X0": ("x0", "sensorx"),
    "Y0": ("y0", "sensory"),
    "Z0": ("z0", "sensorz"),
    "gps_time": ("gpstime", "time", "t"),
}
#: Decimals of a corrected coordinate: a nanometre, far below any measurement.
DECIMALS = 9


class CsvCloud(Cloud):
    """A text file with a heading per column, or three or more bare columns X Y Z ..."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.remarks: list[str] = []
        self._encoding = _encoding_of(path)
        with self._open() as file:
            first = next((line for line in file if line.strip()), "")
            second = next((line for line in file if line.strip()), "")
        if not first:
            raise InputError(f"{path}: the file is empty.")
        self._delimiter = next((mark for mark in ";\t,|" if mark in first), " ")
        self._comma = self._delimiter != "," and bool(
            re.search(r"\d,\d", second or first) and not re.search(r"\d\.\d", second)
        )
        names = self._split(first)
        self._headed = not all(_number(name, self._comma) is not None for name in names)
        self._names = (
            names if self._headed else ["X", "Y", "Z", *map(str, range(4, len(names) + 1))]
        )
        self._columns = {
            key: place
            for key, forms in HEADINGS.items()
            if (place := self._find(key, forms)) is not None
        }
        missing = [key for key in "XYZ" if key not in self._columns]
        if missing or len(names) < 3:
            raise InputError(
                f"{path}: no column for {', '.join(missing) or 'X, Y, Z'}; found the headings "
                f"{', '.join(map(repr, names[:12]))}. Name the columns X, Y and Z [m]."
            )
        self._refuse_millimetres()
        if not second and self._headed:
            raise InputError(f"{path}: holds headings but no points.")

    def _open(self) -> TextIO:
        return self.path.open(encoding=self._encoding, newline="")

    def _split(self, line: str) -> list[str]:
        if self._delimiter == " ":
            return line.split()
        return [cell.strip() for cell in next(csv.reader([line], delimiter=self._delimiter))]

    def _find(self, key: str, forms: tuple[str, ...]) -> int | None:
        bare = [re.sub(r"[\[(].*?[\])]|[\s_.#/-]", "", name).lower() for name in self._names]
        return next((bare.index(form) for form in (key.lower(), *forms) if form in bare), None)

    def _refuse_millimetres(self) -> None:
        for key in "XYZ":
            heading = self._names[self._columns[key]]
            unit = re.search(r"[\[(]\s*(\w+)\s*[\])]", heading)
            if unit and unit[1].lower() not in ("m", "metre", "meter", "metri"):
                raise InputError(
                    f"{self.path}: column {heading!r} is in {unit[1]}, but heights and cameras are "
                    "in metres. Convert the file to metres, and the heading to [m]."
                )

    def has(self, name: str) -> bool:
        """Return whether a column exists."""
        return name in self._columns or name in self._names

    def chunks(self, *, numbers: Sequence[str] = (), texts: Sequence[str] = ()) -> Iterator[Chunk]:
        """Yield pieces of the file."""
        with self._open() as file:
            rows = self._rows(file)
            if self._headed:
                next(rows)
            while piece := list(islice(rows, CHUNK)):
                keys = [*"XYZ", *(key for key in numbers if key in self._columns)]
                errors: list[CellError] = []
                values = {key: self._floats(piece, key, errors) for key in keys}
                if errors:
                    raise WorkbookError(errors)
                yield Chunk(
                    xyz=np.column_stack([values.pop(key) for key in "XYZ"]),
                    raw=[cells for _, cells in piece],
                    numbers=values,
                    texts={
                        k: [cells[self._columns[k]] for _, cells in piece]
                        for k in texts
                        if k in self._columns
                    },
                )

    def _rows(self, file: TextIO) -> Iterator[tuple[int, list[str]]]:
        """Yield number and cells of each row that holds something."""
        if self._delimiter == " ":
            lines: Iterator[list[str]] = (line.split() for line in file)
        else:
            lines = csv.reader(file, delimiter=self._delimiter)
        width = len(self._names)
        try:
            for number, cells in enumerate(lines, start=1):
                if any(cell.strip() for cell in cells):
                    # Short rows are blank at the end; rows longer than the heading keep their tail.
                    yield number, cells + [""] * (width - len(cells))
        except (csv.Error, UnicodeDecodeError) as error:
            raise InputError(f"{self.path}: cannot be read as a text table ({error}).") from None

    def _floats(
        self, piece: list[tuple[int, list[str]]], key: str, errors: list[CellError]
    ) -> FloatArray:
        """Return a column; cells that are no numbers are complained of and become NaN."""
        place = self._columns[key]
        values = [_number(cells[place], self._comma) for _, cells in piece]
        errors += [
            CellError(
                f"found {cells[place]!r}, expected a number"
                f"{' with a decimal comma' if self._comma else ''}. Mend the cell.",
                file=str(self.path),
                cell=f"row {number}",
                column=self._names[place],
            )
            for (number, cells), value in zip(piece, values, strict=True)
            if value is None
        ]
        return np.array([np.nan if value is None else value for value in values])

    @contextmanager
    def writer(self, path: Path, extra: Sequence[str]) -> Iterator[CloudWriter]:
        """Yield a writer of the same dialect."""
        encoding = "utf-8-sig" if self._encoding == "utf-8-sig" else "utf-8"
        with path.open("w", encoding=encoding, newline="") as file:
            writer = csv.writer(file, delimiter=self._delimiter, lineterminator="\n")
            if self._headed:
                writer.writerow([*self._names, *extra])
            yield _CsvWriter(writer, [self._columns[key] for key in "XYZ"], self._comma)


class _CsvWriter:
    def __init__(self, writer: object, places: list[int], comma: bool) -> None:
        self._writer, self._places, self._comma = writer, places, comma

    def write(self, chunk: Chunk, xyz: FloatArray, extra: Mapping[str, FloatArray]) -> None:
        """Write rows; a cell whose number did not change keeps its text."""
        columns = [list(values) for values in extra.values()]
        changed = xyz != chunk.xyz
        for number, cells in enumerate(chunk.raw):
            out = list(cells)
            for axis, place in enumerate(self._places):
                if changed[number, axis]:
                    out[place] = self._text(xyz[number, axis])
            out += [self._text(column[number]) for column in columns]
            self._writer.writerow(out)  # type: ignore[attr-defined]

    def _text(self, value: float | str) -> str:
        if isinstance(value, str):
            return value
        if not np.isfinite(value):
            return ""
        text = repr(round(float(value), DECIMALS))
        return text.replace(".", ",") if self._comma else text


def _number(text: str, comma: bool) -> float | None:
    """Return a number, NaN for a blank cell, None for anything else."""
    text = text.strip()
    if not text:
        return float("nan")
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        return None


def _encoding_of(path: Path) -> str:
    """Return the encoding of a text file."""
    with path.open("rb") as file:
        head = file.read(65_536)
    if not head.strip():
        raise InputError(f"{path}: the file is empty.")
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head or head.startswith(b"PK\x03\x04"):
        raise InputError(f"{path}: is not a text file.")
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return "utf-8" if error.start > len(head) - 4 else "cp1252"
    return "utf-8"
