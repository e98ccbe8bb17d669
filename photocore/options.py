"""The options of the commands: the fields of a class, typed and with words.

A field is at once an option of the command line, a key of files, a field of the page and a value in
Python. Its type and default say what it holds, the string below it what a user reads of it, and
`Typed`, annotated to it, how it is typed: bounds, unit, flag.
"""

from __future__ import annotations

import ast
import inspect
import json
import sys
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache, wraps
from inspect import cleandoc
from itertools import pairwise
from pathlib import Path
from textwrap import indent
from typing import Annotated, Any

import click

from photocore.option_types import Checked, FilePath, Names, Number, Numbers, Scale


class Typed:
    """How the value of a field is typed; a string below the field says what it is.

    Parameters
    ----------
    kind : click.ParamType, optional
        Number with bounds, table, names ...; by default what the type of the field tells: flag or
        switch, whole number, number, choice, file, text.
    unit : str
        What stands behind the option in the help, e.g. ``M``.
    flag : str
        What is typed where it is not the name, more of them behind spaces.
    text : str
        What the option is, where several classes have it; one of them may say it otherwise.
    default : float, optional
        The default in the unit that is typed, where that is not the unit of the program.
    **more
        What else `click.Option` takes.
    """

    def __init__(
        self,
        kind: click.ParamType | None = None,  # type: ignore[type-arg,unused-ignore]
        unit: str = "",
        *,
        flag: str = "",
        text: str = "",
        default: float | None = None,
        **more: Any,
    ) -> None:
        self.kind, self.unit, self.flag, self.text = kind, unit, flag, text
        self.default, self.more = default, more


class Argument(Typed):
    """How a field is typed that stands on the command line without a flag."""


#: Of a field that is a group: its options have no defaults here, their help still tells them.
UNSET = "without defaults"


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
        if self.attributes.get("multiple") and isinstance(kind, Numbers):
            one = isinstance(value, list) and not any(isinstance(part, list) for part in value)
            return tuple(map(kind.read, [value] if one or not isinstance(value, list) else value))
        if self.attributes.get("multiple") or isinstance(kind, Names):
            if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
                raise ValueError("a list of texts")
            return tuple(map(self._understood, value))
        if isinstance(kind, Number):
            return kind.read(value)
        if isinstance(kind, click.Choice):
            try:
                return kind.convert(str(value), None, None)
            except click.BadParameter:
                raise ValueError(f"one of {', '.join(kind.choices)}") from None
        if not isinstance(value, str):
            raise ValueError("a text")
        return self._understood(value)

    def _understood(self, text: str) -> str:
        """Return a text that is understood where it is used."""
        kind = self.attributes.get("type")
        if isinstance(kind, Checked):
            try:
                kind.convert(text, None, None)
            except click.BadParameter:
                raise ValueError(kind.wanted) from None
        return text


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


#: What ``X | None`` is at run time; the second of types such as Literal.
UNIONS = (types.UnionType, typing.Union)


@cache
def _texts(module: str) -> dict[str, dict[str, str]]:
    """Return what the strings below fields say, by class and field of a module."""
    texts: dict[str, dict[str, str]] = {}
    for node in ast.parse(inspect.getsource(sys.modules[module])).body:
        if isinstance(node, ast.ClassDef):
            texts[node.name] = {
                field.target.id: " ".join(cleandoc(text.value.value).split("\n"))
                for field, text in pairwise(node.body)
                if isinstance(field, ast.AnnAssign)
                and isinstance(field.target, ast.Name)
                and isinstance(text, ast.Expr)
                and isinstance(text.value, ast.Constant)
                and isinstance(text.value.value, str)
            }
    return texts


def _option(field: Field[Any], hint: Any, notes: Sequence[Typed], text: str) -> Option:
    """Return the option of a field of a type; the last of the notes on it counts first."""
    parts = typing.get_args(hint) if typing.get_origin(hint) in UNIONS else (hint,)
    kind = next(part for part in parts if part is not types.NoneType)
    type_ = next((note.kind for note in notes if note.kind), None)
    several = typing.get_origin(kind) is tuple and getattr(type_, "is_single", True)
    if typing.get_origin(kind) is tuple and typing.get_origin(typing.get_args(kind)[0]) is tuple:
        several = True  # a list of numbers, over and over
    if several:
        kind = typing.get_args(kind)[0]
    required, default = field.default is MISSING, field.default
    attributes: dict[str, Any] = {"type": type_ or _type_of(kind), "required": required}
    if unit := next((note.unit for note in notes if note.unit), ""):
        attributes["metavar"] = unit
    if any(isinstance(note, Argument) for note in notes):
        attributes["nargs"] = -1 if several else 1
        return Option(field.name, field.name, argument=True, **attributes)
    flags = next((note.flag for note in notes if note.flag), f"--{field.name.replace('_', '-')}")
    attributes["help"] = text or next((note.text for note in notes if note.text), "")
    attributes["multiple"] = several
    if kind is bool:
        del attributes["type"]
    if kind is bool and default is False:
        attributes["is_flag"] = True
    elif kind is bool:
        flags, attributes["default"] = f"{flags}/--no-{flags[2:]}", default
    elif not (required or several or default is None):
        value = next((note.default for note in notes if note.default is not None), default)
        shown = f"1:{_shown(value)}" if isinstance(type_, Scale) else _shown(value)
        as_text = isinstance(value, tuple) or isinstance(type_, Scale)
        attributes["default"] = shown if as_text else value
    attributes["show_default"] = attributes.get("default") not in (None, "")
    for note in notes:
        attributes |= note.more
    return Option(field.name, flags, **attributes)


def _type_of(kind: Any) -> click.ParamType:  # type: ignore[type-arg,unused-ignore]
    """Return how values of a type are typed where nothing is noted."""
    if typing.get_origin(kind) is typing.Literal:
        return click.Choice(typing.get_args(kind))
    plain = {Path: FilePath(), float: Number(), int: click.INT}
    return plain.get(kind, click.STRING)


@cache
def options_of(declaring: type) -> dict[str, Option]:
    """Return the fields of a class as options, by their names.

    A field that is such a class itself is a group: its options stand in its place, once each.
    """
    hints = typing.get_type_hints(declaring, include_extras=True)
    texts = _texts(declaring.__module__)[declaring.__name__]
    options: dict[str, Option] = {}
    for field in fields(declaring):
        hint, notes = hints[field.name], []
        if typing.get_origin(hint) is Annotated:
            hint, notes = hint.__origin__, hint.__metadata__[::-1]
        if is_dataclass(hint):
            for option in options_of(hint).values():  # type: ignore[arg-type]
                options.setdefault(option.name, option.unset() if UNSET in notes else option)
        else:
            option = _option(field, hint, notes, texts.get(field.name, ""))
            options.setdefault(field.name, option)
    return options


def _made(declaring: type, values: Mapping[str, Any]) -> Any:
    """Return an object of a class of options with values by their names, groups filled as well."""
    hints = typing.get_type_hints(declaring, include_extras=True)
    held = {name: values[name] for name in hints if name in values}
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    return declaring(**held, **{name: _made(kind, values) for name, kind in groups.items()})  # type: ignore[arg-type]


def declared(declaring: type) -> Callable[[Callable[..., Any]], click.Command]:
    """Return what makes a command of a function, with the fields of a class as its options.

    The function takes an object of the class as `options`; or, if it has other arguments, the
    values by their names. The docstring of the class, but for its first line, ends the help:
    examples.
    """
    _, _, text = cleandoc(declaring.__doc__ or "").partition("\n\n")
    examples, *more = text.split("\n\n")
    parts = [f"\b\nExamples:\n{indent(examples, '  ')}"]
    parts += [f"\b\n{part}" if "\n  " in part else part for part in more]
    parameters = [option.parameter() for option in options_of(declaring).values()]

    def command_of(function: Callable[..., Any]) -> click.Command:
        @wraps(function)
        def work(**values: Any) -> Any:
            return function(_made(declaring, values))

        arguments = str(inspect.signature(function))
        callback = work if arguments.startswith("(options:") else function
        return click.command(epilog="\n\n".join(parts) + "\n", params=parameters)(callback)

    return command_of
