"""The options of the commands, as ``options.toml`` of their package declares them.

A row there is at once an option of the command line, a key of files and an argument in Python.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from photocore.option_types import Length, Names, Number, Numbers, Scale, Size, TableFile
from photocore.provenance import changed_photos


class Option:
    """An option or argument, said once: of the command line, as key of files, in Python.

    Parameters
    ----------
    name : str
        The key in files and the argument in Python, e.g. ``sigma_pick``.
    flags : str
        What stands on the command line, e.g. ``--sigma-pick`` or ``--mask/--no-mask``; more names
        behind spaces.
    argument : bool
        It stands there without its flag.
    **attributes
        As `click.Option` or `click.Argument` takes them.
    """

    def __init__(self, name: str, flags: str, *, argument: bool = False, **attributes: Any) -> None:
        self.name, self.flags, self.attributes = name, flags, attributes
        self.argument = argument

    @property
    def flag(self) -> str:
        """What stands on the command line, e.g. ``--sigma-pick``."""
        return self.flags.split()[0].partition("/")[0]

    @property
    def is_switch(self) -> bool:
        """Whether it is true or false."""
        return "/" in self.flags or "is_flag" in self.attributes

    @property
    def is_file(self) -> bool:
        """Whether it names a file."""
        return isinstance(self.attributes.get("type"), click.Path)

    def parameter(self) -> click.Parameter:
        """Return it as a command takes it."""
        if self.argument:
            return click.Argument([self.name], **self.attributes)
        return click.Option([*self.flags.split(), self.name], **self.attributes)

    def unset(self) -> Option:
        """Return it without a value where it is not given; its help still tells the default."""
        said = self.attributes["help"]
        if self.attributes["show_default"]:
            shown = self.flag[2:] if self.is_switch else self.attributes["default"]
            said = f"{said}  [default: {shown}]"
        changes = {"default": None, "show_default": False, "help": said}
        return Option(self.name, self.flags, **(self.attributes | changes))

    @property
    def fixed_default(self) -> Any:
        """The value it has where it is not given; None where that depends on other things."""
        value = self.attributes.get("default")
        kind = self.attributes.get("type")
        if value in (None, "", ()):
            return (
                False
                if value is None and {"is_flag", "hidden"} & self.attributes.keys() == {"is_flag"}
                else None
            )
        return kind.convert(value, None, None) if isinstance(value, str) and kind else value

    def typed_as(self, value: Any, *, in_file: bool = False) -> list[str]:
        """Return a value as words of the command line, or as keys of a file.

        Examples
        --------
        >>> Option("relief_gsd", "--relief-gsd").typed_as(0.005)
        ['--relief-gsd 0.005']
        >>> Option("mask", "--mask/--no-mask").typed_as(False)
        ['--no-mask']
        >>> Option("bounds", "--bounds").typed_as((0.0, 1.5), in_file=True)
        ['bounds = [0, 1.5]']
        """
        if self.attributes.get("multiple") and not in_file:
            return [f"{self.flag} {_shown(one)}" for one in value]
        if in_file:
            return [f"{self.name} = {_in_file(value)}"]
        if self.is_switch:
            return [self.flag if value else self.flags.rpartition("/")[2]]
        if isinstance(self.attributes.get("type"), Scale):
            return [f"{self.flag} 1:{_shown(value)}"]
        return [f"{self.flag} {_shown(value)}"]

    def is_said(self, value: object) -> bool:
        """Whether a value is more than that of an option left out; zero is a number."""
        by_default = value is False and "/" not in self.flags
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


def _shown(value: Any) -> str:
    """Return a value in one word of the command line."""
    if isinstance(value, list | tuple):
        return ",".join(map(_shown, value))
    if isinstance(value, float):
        return f"{value:.10g}"
    text = value.name if isinstance(value, Path) else str(value)
    return f'"{text}"' if not text or " " in text else text


def _in_file(value: Any) -> str:
    """Return a value as a file of options holds it."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_in_file, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:.10g}"
    return json.dumps(value.name if isinstance(value, Path) else str(value), ensure_ascii=False)


def _enter_cog(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    if value:
        from photocore.raster_places import cloud_optimised

        ctx.with_resource(cloud_optimised())


def _take_changes(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    ctx.with_resource(changed_photos(taken=value))


def _thousandth(value: float) -> float:
    """Return metres of millimetres, or millimetres of micrometres."""
    return value / 1000


#: What a row's ``kind`` stands for, given the limits it states.
KINDS: dict[str, Callable[..., Any]] = {
    "changed photos": partial(dict, is_flag=True, expose_value=False, callback=_take_changes),
    "choice": click.Choice,
    "cog": partial(dict, is_flag=True, expose_value=False, callback=_enter_cog),
    "degrees": partial(Number, to=math.radians),
    "file": partial(click.Path, path_type=Path),
    "flag": partial(dict, is_flag=True),
    "focal": partial(Number, least=0.1, most=1e5),  # [mm] from a pinhole's to a telescope's
    "integer": click.types.IntParamType,
    "length": Length,
    "names": Names,
    "new table": partial(TableFile, output=True),
    "not negative": partial(Number, least=0),
    "number": Number,
    "numbers": Numbers,
    "positive": partial(Number, above=0),
    "range": click.IntRange,
    "scale": Scale,
    "size": Size,
    "switch": partial(dict, default=None),
    "table": TableFile,
    "text": click.types.StringParamType,
    "thousandths": partial(Number, above=0, to=_thousandth),
}
#: Keys of a row that its kind takes.
LIMITS = (
    *("above", "below", "case_sensitive", "choices", "count", "finite", "least", "max", "min"),
    *("most", "whole", "word"),
)


@cache
def _texts(package: str) -> tuple[str, ...]:
    """Return the parts of a package's ``options.toml``: what commands share, and each command."""
    path = Path(str(import_module(package).__file__)).with_name("options.toml")
    return tuple(re.split(r"^(?=\[\w+\]$)", path.read_text("utf-8"), flags=re.MULTILINE))


@cache
def _shared(package: str) -> dict[str, Any]:
    """Return the tables that commands share, those of `photocore` among them."""
    tables = tomllib.loads(_texts(package)[0])
    if package != "photocore":
        tables["shared"] = _shared("photocore")["shared"] | tables["shared"]
    return tables


@cache
def _table(package: str, name: str) -> dict[str, Any]:
    """Return the table of a command, or one that several share; no other command's is parsed."""
    text = next((part for part in _texts(package) if part.startswith(f"[{name}]\n")), None)
    return dict((_shared(package) if text is None else tomllib.loads(text))[name])


def program(package: str) -> dict[str, Any]:
    """Return what the group of a package's commands says of itself and of each of them."""
    return _table(package, "program")


@cache
def options_of(package: str, group: str) -> dict[str, Option]:
    """Return the options of a command, or of a group that several take, by their names.

    Parameters
    ----------
    package : str
        Whose ``options.toml`` declares them.
    group : str
        The table. A row with ``all`` stands for all rows of another table (``unset``: without
        their defaults). One without kind takes after the row that it is ``like``, or after the
        row of its name in ``shared``.
    """
    options: dict[str, Option] = {}
    for name, row in _table(package, group).items():
        if name == "epilog":
            continue
        if "all" in row:
            for option in options_of(package, row["all"]).values():
                options.setdefault(option.name, option.unset() if "unset" in row else option)
            continue
        if not {"kind", "choices"} & row.keys():
            where, _, like = row.get("like", name).rpartition(".")
            row = _table(package, where or "shared")[like] | row
        options.setdefault(name, _option(name, row))
    return options


def _option(name: str, row: dict[str, Any]) -> Option:
    """Return the option of a row."""
    limits = {key: value for key, value in row.items() if key in LIMITS}
    attributes = {key: value for key, value in row.items() if key not in LIMITS}
    attributes.pop("like", None)
    flags = attributes.pop("flag", f"--{name.replace('_', '-')}")
    made = KINDS[kind := attributes.pop("kind", "choice")](**limits)
    if kind == "switch":
        flags += f"/--no-{flags[2:]}"
    if "unit" in attributes:
        attributes["metavar"] = attributes.pop("unit")
    if "argument" not in attributes:
        attributes.setdefault("show_default", attributes.get("default", "") != "")
    attributes = made | attributes if isinstance(made, dict) else {"type": made} | attributes
    return Option(name, flags, **attributes)


def declared(function: Callable[..., Any]) -> click.Command:
    """Return the command of a module ``PACKAGE.cli.NAME``, with the options of its table NAME."""
    package, _, name = function.__module__.split(".")
    parameters = [option.parameter() for option in options_of(package, name).values()]
    return click.command(epilog=_table(package, name)["epilog"], params=parameters)(function)
