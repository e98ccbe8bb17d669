"""What options hold: numbers, sizes, names, tables.

Every number passes through `Number`, the one place that refuses what is not finite or not possible,
as wrong usage that names the option.
"""

from __future__ import annotations

import io
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import click

from photocore.errors import LARGEST
from photocore.log import COMMAND_LINE
from photocore.names import on_disk

#: Where a command finds the files that stand for stdin and stdout.
STREAMS = ("photocore.stdin", "photocore.stdout")


class FilePath(click.Path):
    """A file or folder; accents of its name may be letters of their own or not, as on the disk."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, that of the one that is called so."""
        return on_disk(Path(os.fsdecode(super().convert(value, param, ctx))), any_case=False)


class TableFile(FilePath):
    """A file that holds a table; ``-`` stands for stdin or stdout.

    What comes from stdin (a text table, or a workbook) is kept as a file while the command runs.
    What goes to stdout is written as ``.csv`` first, and printed only when it is whole; the
    results that the command prints otherwise are then left out.

    Parameters
    ----------
    output : bool
        Written instead of read.
    """

    name = "file"

    def __init__(self, *, output: bool = False) -> None:
        super().__init__()
        self.output = output

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, that of a temporary file where ``-`` is given."""
        if ctx is None or ctx.resilient_parsing or str(value) != "-":
            return super().convert(value, param, ctx)
        key = STREAMS[self.output]
        if key in ctx.meta:
            self.fail("- can stand for one table only.", param, ctx)
        from photocore.output import temporary_folder

        # The whole command's context is closed also where the rest of the line is wrong.
        ctx = ctx.find_root()
        folder = ctx.with_resource(temporary_folder())
        if not self.output:
            path = ctx.meta[key] = _from_stdin(folder)
            return path
        if "--json" in shlex.split(ctx.meta.get(COMMAND_LINE, "")):
            self.fail("both it and --json go to stdout; choose one of them.", param, ctx)
        path, stdout = folder / "stdout.csv", sys.stdout
        ctx.meta[key] = path

        def show() -> None:
            if path.is_file():
                stdout.flush()
                stdout.buffer.write(path.read_bytes())
                stdout.flush()

        # Closed in the opposite order: stdout is itself again, then comes the table.
        ctx.call_on_close(show)
        ctx.with_resource(redirect_stdout(io.StringIO()))
        return path


def _from_stdin(folder: Path) -> Path:
    """Return a file with what stands on stdin, of the ending that its content asks for."""
    data = sys.stdin.buffer.read()
    ending = ".csv"
    if data[:2] == b"PK":
        ending = ".xlsx"
        with suppress(BadZipFile), ZipFile(io.BytesIO(data)) as package:
            ending = ".ods" if "content.xml" in package.namelist() else ".xlsx"
    path = folder / f"stdin{ending}"
    path.write_bytes(data)
    return path


class Number(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A finite number with a decimal point or comma.

    Parameters
    ----------
    above, below : float, optional
        Open limits.
    least, most : float, optional
        Closed limits.
    finite : bool
        Refuse NaN, infinity and what is beyond `LARGEST`.
    whole : bool
        Refuse fractions, and return int.
    to : callable, optional
        Turns the number into the unit of the program, e.g. `math.radians`.
    called : str
        What a file or a field is said to lack, in place of "a number".
    """

    name = "number"
    described = "a number; the unit is in the help."
    in_files = "a number"
    is_single, takes_text = True, False

    def __init__(
        self,
        *,
        above: float | None = None,
        below: float | None = None,
        least: float | None = None,
        most: float | None = None,
        finite: bool = True,
        whole: bool = False,
        to: Callable[[float], float] = float,
        called: str = "",
    ) -> None:
        self.in_files = called or self.in_files
        self.above, self.below, self.least, self.most = above, below, least, most
        self.finite = finite
        self.to = int if whole else to

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, or a tuple of them, in the unit of the program."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = self.parse(str(value).strip())
        except ValueError:
            self.fail(f"{value!r} is not {self.described}", param, ctx)
        fault = next(filter(None, map(self.fault, numbers)), None)
        if fault:
            self.fail(f"{fault}, got {value}.", param, ctx)
        converted = tuple(self.to(number) for number in numbers)
        return converted[0] if self.is_single else converted

    def parse(self, text: str) -> list[float]:
        """Return the numbers a text holds; ValueError where it is something else."""
        return [float(text.replace(",", "."))]

    def fault(self, number: float) -> str | None:
        """Return what is wrong with a number."""
        if self.finite and not abs(number) <= LARGEST:
            return f"must be a finite number, not beyond {LARGEST:g}"
        if self.to is int and number != int(number):
            return "must be a whole number"
        for limit, outside, words in self._limits():
            if outside(number, limit):
                return f"must be {words}"
        return None

    def _limits(self) -> Iterator[tuple[float, Callable[[float, float], bool], str]]:
        """Yield each limit, what tells that a number is beyond it, and what it must be."""
        for limit, outside, words in (
            (self.above, float.__le__, "above {}"),
            (self.below, float.__ge__, "below {}"),
            (self.least, float.__lt__, "{} or more"),
            (self.most, float.__gt__, "{} or less"),
        ):
            if limit is not None:
                yield float(limit), outside, words.format("zero" if limit == 0 else f"{limit:g}")

    def read(self, value: object) -> Any:
        """Return what a file holds, in the unit of the program; ValueError says what it must be."""
        if isinstance(value, str) and self.takes_text:
            with suppress(ValueError):
                value = self.parse(value)[0]
        return self._checked([value])[0]

    def typed(self, value: object) -> Any:
        """Return what a field of a page holds: as in a file, or as on the command line."""
        if not isinstance(value, str):
            return self.read(value)
        try:
            return self.convert(value.replace("\N{MINUS SIGN}", "-"), None, None)
        except click.BadParameter:
            raise ValueError(self.wanted) from None

    def _checked(self, values: Sequence[object]) -> tuple[float, ...]:
        numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
        # A whole number may be too large for a float.
        if len(numbers) < len(values) or any(
            not abs(v) <= LARGEST or self.fault(float(v)) for v in numbers
        ):
            raise ValueError(self.wanted)
        return tuple(self.to(float(v)) for v in numbers)

    @property
    def wanted(self) -> str:
        """What a file must hold."""
        return " and ".join([self.in_files, *(words for *_, words in self._limits())]).replace(
            " and", "", 1
        )


def thousandth(value: float) -> float:
    """Return metres of millimetres, or millimetres of micrometres."""
    return value / 1000


class Numbers(Number):
    """So many numbers with commas or semicolons between them; decimal points.

    Parameters
    ----------
    count : int, optional
        How many; any number of them when None.
    word : str
        That may stand in their place.
    rising : bool
        The second half of them, each above its fellow of the first: low and high, or a box.
    limits
        As for `Number`; they hold for each.
    """

    name = "numbers"
    is_single = False

    def __init__(
        self, count: int | None = None, *, word: str = "", rising: bool = False, **limits: Any
    ) -> None:
        super().__init__(**limits)
        self.count, self.word, self.rising = count, word, rising
        many = "a list of" if count is None else count
        self.described = f"{word and word + ' or '}{many} numbers with commas between them"
        quoted = f'"{word}", or ' if word else ""
        self.in_files = f"{quoted}a list of {'' if count is None else f'{count} '}numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a tuple of numbers, or the word."""
        if self.word and value == self.word:
            return value
        numbers = super().convert(value, param, ctx)
        if self.rising and not _rises(numbers):
            self.fail(f"must be {RISING[len(numbers)]}, got {value}.", param, ctx)
        return numbers

    def read(self, value: object) -> Any:
        """Return what a file holds: a list, or the word."""
        if self.word and value == self.word:
            return value
        if not isinstance(value, list) or self.count not in (None, len(value)):
            raise ValueError(self.wanted)
        numbers = self._checked(value)
        if self.rising and not _rises(numbers):
            raise ValueError(f"{self.wanted}, {RISING[len(numbers)]}")
        return numbers

    def parse(self, text: str) -> list[float]:
        """Split at the separators; a list may end in one."""
        parts = text.replace(";", ",").split(",")
        numbers = [float(part) for part in parts if part.strip() or self.count is not None]
        if self.count not in (None, len(numbers)):
            raise ValueError(text)
        return numbers


#: What rising numbers are, by their count.
RISING = {2: "low, high with low < high", 4: "xmin,ymin,xmax,ymax with xmin < xmax, ymin < ymax"}


def _rises(numbers: Sequence[float]) -> bool:
    """Whether each number of the second half is above its fellow of the first."""
    half = len(numbers) // 2
    return all(low < high for low, high in zip(numbers[:half], numbers[half:], strict=True))


class Checked(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A text kept as it is typed, which a reader must understand.

    Parameters
    ----------
    reader : callable
        Raises ValueError, or `click.BadParameter`, where it does not.
    wanted : str
        What it understands.
    """

    name = "text"

    def __init__(self, reader: Callable[[str], Any], wanted: str) -> None:
        self.reader, self.wanted = reader, wanted

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the text; an empty one says nothing."""
        try:
            _ = value and self.reader(value)
        except (ValueError, click.BadParameter):
            self.fail(f"{value!r} is not {self.wanted}.", param, ctx)
        return value


class Size(Number):
    """Two numbers as WIDTHxHEIGHT; decimal commas are understood."""

    name = "WxH"
    described = "WIDTHxHEIGHT, e.g. 22.7x15.1"
    is_single = False

    def parse(self, text: str) -> list[float]:
        """Return width and height."""
        parts = text.lower().replace("*", "x").replace("×", "x").replace(",", ".").split("x")
        width, height = (float(part) for part in parts)
        return [width, height]


class Scale(Number):
    """A scale 1:N."""

    name = "1:N"
    described = "a scale, e.g. 1:500"
    takes_text = True

    @property
    def wanted(self) -> str:
        """What a file must hold."""
        return 'a scale, "1:50" or 50'

    def __init__(self) -> None:
        super().__init__(above=0)

    def parse(self, text: str) -> list[float]:
        """Return N."""
        return [float(text.removeprefix("1:"))]


class Length(Number):
    """A length in metres, or with its unit: 0.005, 5mm, 0.5 cm."""

    name = "M"
    described = "a length, e.g. 0.005 or 5mm"
    in_files = 'a length [m] or "5mm",'
    takes_text = True

    def parse(self, text: str) -> list[float]:
        """Return metres."""
        text = text.lower().replace(",", ".")
        # 5 * 1e-3 is 0.005 exactly, 3.69 * 1e-3 is not 0.00369: divide instead.
        for unit, parts in (("mm", 1000.0), ("cm", 100.0), ("m", 1.0)):
            if text.endswith(unit):
                return [float(text.removesuffix(unit)) / parts]
        return [float(text)]


class Names(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Names with commas between them."""

    name = "text"
    is_single = False

    def convert(self, value: Any, *_: object) -> tuple[str, ...]:
        """Return the names; none for an empty text."""
        if isinstance(value, tuple):
            return value
        return tuple(part.strip() for part in value.split(",") if part.strip())


POSITIVE, NOT_NEGATIVE = Number(above=0), Number(least=0)
#: From a pinhole's to a telescope's. [mm]
FOCAL = Number(least=0.1, most=1e5)
TABLE, NEW_TABLE = TableFile(), TableFile(output=True)
