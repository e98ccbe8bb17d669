"""Point clouds as text: any delimiter, decimal comma, columns by heading; other cells untouched.

Unlike `photocore.tables`, which reads whole tables, a cloud of any size passes in pieces.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from photocore.arrays import FloatArray, IntArray
from photocore.cloud.model import PIECE, Cloud, CloudPiece, NewAttributes, NewValues, PieceWriter
from photocore.errors import LARGEST, CellError, InputError, WorkbookError
from photocore.tables.axes import EAST, HEIGHT, NAMES, NORTH
from photocore.tables.heading_words import bare, parts_of, unit_of
from photocore.tables.lists import unit_of_comment
from photocore.tables.rows import COMMENTS

#: Headings of each coordinate and of the columns other commands ask for.
HEADINGS: dict[str, tuple[str, ...]] = {
    "X": ("x", *map(bare, EAST)),
    "Y": ("y", *map(bare, NORTH)),
    "Z": ("z", "sfmz", *map(bare, HEIGHT)),
    "id": ("id", *map(bare, NAMES)),
    "cameras": ("cameras", "images", "photos"),
    "sigma_Z": ("sigmaz", "sigmah", "sz"),
    "X0": ("x0", "sensorx"),
    "Y0": ("y0", "sensory"),
    "Z0": ("z0", "sensorz"),
    "gps_time": ("gpstime", "time", "t"),
}
_WORDS = re.compile(r"\w+")
#: Decimals of a corrected coordinate: a nanometre, far below any measurement.
DECIMALS = 9


class TextCloud(Cloud):
    """A text file with a heading per column, or three or more bare columns X Y Z ..."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._encoding = _encoding_of(path)
        try:
            with self._open() as file:
                lines = (line for line in file if line.strip())
                first, second = next(lines, ""), next(lines, "")
                self._notes = 0
                while first.lstrip().startswith(COMMENTS) and (
                    second.lstrip().startswith(COMMENTS) or len(_WORDS.findall(first)) < 3
                ):
                    self._refuse_unit(first.strip(), unit_of_comment(first, str(path)))
                    first, second, self._notes = second, next(lines, ""), self._notes + 1
        except UnicodeDecodeError:
            raise InputError(f"{path}: is not a text file.") from None
        if not first:
            raise InputError(f"{path}: the file is empty; save or copy it again.")
        self._delimiter = next((mark for mark in ";\t,|" if mark in first), " ")
        self._comma = self._delimiter != "," and bool(
            re.search(r"\d,\d", second or first) and not re.search(r"\d\.\d", second)
        )
        names = [name.strip() for name in next(self._split([first]))]
        self._headed = any(self._number(name) is None for name in names)
        self._names = (
            names if self._headed else ["X", "Y", "Z", *map(str, range(4, 1 + len(names)))]
        )
        numbered = list(enumerate(self._names))[::-1]
        places = {part: k for k, name in numbered for part in parts_of(name)}
        places |= {bare(name): k for k, name in numbered}
        self._columns = {
            key: next(places[form] for form in forms if form in places)
            for key, forms in HEADINGS.items()
            if not places.keys().isdisjoint(forms)
        }
        missing = [key for key in "XYZ" if key not in self._columns]
        if missing or len(names) < 3:
            raise InputError(
                f"{path}: no column for {', '.join(missing) or 'X, Y, Z'}; found the headings "
                f"{', '.join(map(repr, names[:12]))}. Name the columns X, Y and Z [m]."
            )
        for heading in (self._names[self._columns[key]] for key in "XYZ"):
            unit = re.search(r"[\[(]\s*(\w+)\s*[\])]", heading)
            self._refuse_unit(heading, unit_of(heading) or (unit[1] if unit else ""))
        if not second and self._headed:
            raise InputError(f"{path}: holds headings but no points.")

    def _open(self) -> TextIO:
        return self.path.open(encoding=self._encoding, newline="")

    def _split(self, lines: Iterator[str] | Sequence[str]) -> Iterator[list[str]]:
        if self._delimiter == " ":
            return (line.split() for line in lines)
        return csv.reader(lines, delimiter=self._delimiter)

    def _refuse_unit(self, heading: str, unit: str) -> None:
        if unit.lower() not in ("", "m", "metre", "meter", "metri"):
            raise InputError(
                f"{self.path}: column {heading[:60]!r} is in {unit}, but heights and cameras are "
                "in metres. Convert the file to metres, and the heading to [m]."
            )

    def has(self, name: str) -> bool:
        """Return whether a column exists."""
        return name in self._columns or name in self._names

    def pieces(
        self, *, numbers: Sequence[str] = (), texts: Sequence[str] = ()
    ) -> Iterator[CloudPiece]:
        """Yield pieces of the file."""
        keys = [*"XYZ", *(key for key in numbers if key in self._columns)]
        with self._open() as file:
            rows = self._rows(file)
            for _ in range(self._notes + self._headed):
                next(rows)
            while piece := list(islice(rows, PIECE)):
                errors: list[CellError] = []
                values = {key: self._floats(piece, self._columns[key], errors) for key in keys}
                if errors:
                    raise WorkbookError(errors)
                yield CloudPiece(
                    xyz=np.column_stack([values.pop(key) for key in "XYZ"]),
                    raw=[cells for _, cells in piece],
                    numbers=values,
                    texts={
                        key: [cells[self._columns[key]] for _, cells in piece]
                        for key in texts
                        if key in self._columns
                    },
                )

    def _rows(self, file: TextIO) -> Iterator[tuple[int, list[str]]]:
        """Yield number and cells of each row that holds something."""
        width = len(self._names)
        try:
            for number, cells in enumerate(self._split(file), start=1):
                if any(cell.strip() for cell in cells):
                    # Short rows are blank at the end; rows longer than the heading keep their tail.
                    yield number, cells + [""] * (width - len(cells))
        except (csv.Error, UnicodeDecodeError) as error:
            raise InputError(f"{self.path}: cannot be read as a text table ({error}).") from None

    def _floats(
        self, piece: list[tuple[int, list[str]]], place: int, errors: list[CellError]
    ) -> FloatArray:
        """Return a column; cells that are no numbers are complained of and become NaN."""
        texts = [cells[place] for _, cells in piece]
        with suppress(ValueError):  # all filled, as most are
            plain = [text.replace(",", ".") for text in texts] if self._comma else texts
            numbers = np.array(list(map(float, plain)))
            if not (np.abs(numbers) > LARGEST).any():
                return numbers
        values = list(map(self._number, texts))
        decimal = " with a decimal comma" if self._comma else ""
        errors += [
            CellError(
                f"found {text!r}, expected a number{decimal}. Mend the cell.",
                file=str(self.path),
                cell=f"row {number}",
                column=self._names[place],
            )
            for (number, _), text, value in zip(piece, texts, values, strict=True)
            if value is None
        ]
        return np.array(values, dtype=np.float64)  # None becomes NaN

    def _number(self, text: str) -> float | None:
        """Return a number, NaN for a blank cell, None for anything else, infinity too."""
        try:
            number = float(text.replace(",", ".") if self._comma else text)
            return None if abs(number) > LARGEST else number
        except ValueError:
            return None if text.strip() else np.nan

    @contextmanager
    def _written(self, path: Path, extra: NewAttributes) -> Iterator[PieceWriter]:
        """Yield a writer of the same dialect; a cell whose number did not change keeps its text."""
        encoding = "utf-8-sig" if self._encoding == "utf-8-sig" else "utf-8"
        places = [self._columns[key] for key in "XYZ"]
        with path.open("w", encoding=encoding, newline="") as file:
            writer = csv.writer(file, delimiter=self._delimiter, lineterminator="\n")
            if self._headed:
                writer.writerow([*self._names, *extra])

            def write(piece: CloudPiece, xyz: FloatArray, values: NewValues) -> None:
                rows = [list(cells) for cells in piece.raw]
                for axis, place in enumerate(places):
                    moved = np.flatnonzero(xyz[:, axis] != piece.xyz[:, axis])
                    for number, text in zip(moved, self._texts(xyz[moved, axis]), strict=True):
                        rows[number][place] = text
                for column in values.values():
                    for row, text in zip(rows, self._texts(column), strict=True):
                        row.append(text)
                writer.writerows(rows)

            yield write

    def _texts(self, values: FloatArray | IntArray | list[str]) -> list[str]:
        """Return the cells of a column; unknown numbers are blank."""
        if isinstance(values, list):
            return values
        texts = [
            repr(round(value, DECIMALS)) if math.isfinite(value) else ""
            for value in values.tolist()
        ]
        return [text.replace(".", ",") for text in texts] if self._comma else texts


def _encoding_of(path: Path) -> str:
    """Return the encoding of a text file."""
    with path.open("rb") as file:
        head = file.read(65_536)
    if not head.strip():
        raise InputError(f"{path}: the file is empty; save or copy it again.")
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
