"""Option types and options shared by the commands of both packages.

Every number on a command line passes through `Number`, the one place that refuses what is not
finite or not possible, as wrong usage that names the option.
"""

from __future__ import annotations

import io
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile, ZipFile

import click

from photocore.errors import LARGEST
from photocore.log import COMMAND_LINE

Command = TypeVar("Command", bound=Callable[..., Any])
#: Where a command finds the files that stand for stdin and stdout.
STREAMS = ("photocore.stdin", "photocore.stdout")
FILE = click.Path(path_type=Path)


class Option:
    """An option, said once: on the command line, as a key of files, as an argument in Python.

    Parameters
    ----------
    *names : str
        As `click.option` takes them: the flag, and the argument where that has another name.
    **attributes
        As `click.option` takes them.
    """

    def __init__(self, *names: str, **attributes: Any) -> None:
        self.names, self.attributes = names, attributes

    @property
    def flag(self) -> str:
        """What stands on the command line, e.g. ``--sigma-pick``."""
        return self.names[0].partition("/")[0]

    @property
    def name(self) -> str:
        """The key in files and the argument in Python, e.g. ``sigma_pick``."""
        return self.names[-1] if len(self.names) > 1 else self.flag[2:].replace("-", "_")

    @property
    def is_switch(self) -> bool:
        """Whether it is true or false."""
        return "/" in self.names[0] or "is_flag" in self.attributes

    @property
    def is_file(self) -> bool:
        """Whether it names a file."""
        return isinstance(self.attributes.get("type"), click.Path)

    def __call__(self, command: Command) -> Command:
        """Give a command the option."""
        return click.option(*self.names, **self.attributes)(command)

    def but(self, *names: str, **changes: Any) -> Option:
        """Return it with other names or attributes."""
        return Option(*(names or self.names), **{**self.attributes, **changes})

    def unset(self) -> Option:
        """Return it without a value where it is not given; its help still tells the default."""
        default, said = self.attributes.get("default"), self.attributes["help"]
        if self.attributes.get("show_default"):
            shown = default if not self.is_switch else self.flag[2:]
            said = f"{said}  [default: {shown}]"
        return self.but(default=None, show_default=False, help=said)

    def is_said(self, value: object) -> bool:
        """Whether a value is more than that of an option left out; zero is a number."""
        by_default = "/" not in self.names[0] and value is False
        return not (value is None or value == () or by_default)

    def typed(self, value: object) -> Any:
        """Return what a field of a page holds: a number may also be typed as on the command line.

        Raises
        ------
        ValueError
            With what was expected.
        """
        kind = self.attributes.get("type")
        return kind.typed(value) if isinstance(kind, Number) else self.read(value)

    def read(self, value: object) -> Any:
        """Return what a file holds, checked as on the command line.

        Raises
        ------
        ValueError
            With what was expected.
        """
        kind = self.attributes.get("type", click.STRING)
        if self.is_switch:
            if not isinstance(value, bool):
                raise ValueError("true or false")
            return value
        if self.attributes.get("multiple") or isinstance(kind, Names):
            if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
                raise ValueError("a list of texts")
            return tuple(value)
        if isinstance(kind, Number):
            return kind.read(value)
        if isinstance(kind, click.Choice):
            try:
                return kind.convert(str(value), None, None)
            except click.BadParameter:
                raise ValueError(f"one of {', '.join(kind.choices)}") from None
        if not isinstance(value, str):
            raise ValueError("a text")
        return value


def takes(*options: Option) -> Callable[[Command], Command]:
    """Return what gives a command options, in their order."""

    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


overwrite = Option("--overwrite", is_flag=True, help="Replace existing files.")
as_json = Option("--json", "as_json", is_flag=True, help="Print one JSON object.")
COG = Option("--cog", is_flag=True, help="Write rasters as cloud-optimised GeoTIFF.")


def _enter_cog(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    if value:
        from photocore.raster_places import cloud_optimised

        ctx.with_resource(cloud_optimised())


cog = COG.but(expose_value=False, callback=_enter_cog)


class TableFile(click.Path):
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
        super().__init__(path_type=Path)
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


#: A table that is read, and one that is written.
TABLE, NEW_TABLE = TableFile(), TableFile(output=True)


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


#: Takes the place of click's FLOAT in every command.
NUMBER = Number()
POSITIVE, NOT_NEGATIVE = Number(above=0), Number(least=0)
#: A principal distance in millimetres: from a pinhole's to a telescope's.
FOCAL = Number(least=0.1, most=1e5)
#: Millimetres or micrometres, handed on as metres or millimetres.
THOUSANDTHS = Number(above=0, to=lambda value: value / 1000)


def number(name: str, unit: str, text: str, *, type: Number = POSITIVE, **more: Any) -> Option:
    """Return an option that takes one number: its unit, its help, and a default that is shown."""
    return Option(name, type=type, metavar=unit, help=text, show_default="default" in more, **more)


def choice(name: str, words: str, text: str, **more: Any) -> Option:
    """Return an option that takes one of ``"these|words"``, its help, a default that is shown."""
    kind = click.Choice(words.split("|"), case_sensitive=more.pop("case_sensitive", True))
    return Option(name, type=kind, help=text, show_default="default" in more, **more)


def switch(name: str, text: str) -> Option:
    """Return an option that holds unless its ``--no-`` form is given."""
    return Option(f"--{name}/--no-{name}", default=True, show_default=True, help=text)


def sigma(name: str, unit: str, text: str) -> Option:
    """Return the option of a standard deviation, 0 where it is not given."""
    return number(name, unit, text, type=NOT_NEGATIVE, default=0.0)


class Numbers(Number):
    """So many numbers with commas or semicolons between them; decimal points.

    Parameters
    ----------
    count : int, optional
        How many; any number of them when None.
    word : str
        That may stand in their place.
    limits
        As for `Number`; they hold for each.
    """

    name = "numbers"
    is_single = False

    def __init__(self, count: int | None = None, *, word: str = "", **limits: Any) -> None:
        super().__init__(**limits)
        self.count, self.word = count, word
        many = "a list of" if count is None else count
        self.described = f"{word and word + ' or '}{many} numbers with commas between them"
        quoted = f'"{word}", or ' if word else ""
        self.in_files = f"{quoted}a list of {'' if count is None else f'{count} '}numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a tuple of numbers, or the word."""
        return value if self.word and value == self.word else super().convert(value, param, ctx)

    def read(self, value: object) -> Any:
        """Return what a file holds: a list, or the word."""
        if self.word and value == self.word:
            return value
        if not isinstance(value, list) or self.count not in (None, len(value)):
            raise ValueError(self.wanted)
        return self._checked(value)

    def parse(self, text: str) -> list[float]:
        """Split at the separators; a list may end in one."""
        parts = text.replace(";", ",").split(",")
        numbers = [float(part) for part in parts if part.strip() or self.count is not None]
        if self.count not in (None, len(numbers)):
            raise ValueError(text)
        return numbers


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


#: A board for calibration: what is on it, and how many of it.
PATTERN = choice(
    "--pattern", "chessboard|circles|asymmetric-circles|charuco", "What is on the board.",
    default="chessboard",
)  # fmt: skip
BOARD = Option(
    "--board", type=Size(least=1, whole=True),
    help="Inner corners of a chessboard, circles of a grid, squares of a ChArUco board, across x "
    "up.",
)  # fmt: skip


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

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None  # noqa: ARG002
    ) -> tuple[str, ...]:  # fmt: skip
        """Return the names; none for an empty text."""
        if isinstance(value, tuple):
            return value
        return tuple(part.strip() for part in value.split(",") if part.strip())
