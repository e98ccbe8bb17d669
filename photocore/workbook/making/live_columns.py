"""Columns of the tables of new workbooks: keys, kinds, number formats and live formulas.

Formulas are written with ``[@key]`` for the cell of the same row; `row_formula` turns that into the
file's structured references. Only functions of Excel 2007 are used, no text formats, no locale.
"""

from __future__ import annotations

import re
import tomllib
from collections import ChainMap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Any

#: Columns of names and words, not of numbers.
TEXT_KEYS = ("id", "code", "note", "rule")
#: Typed numbers lie between minus and plus this, unless a column says otherwise.
_LIMIT = 1e7


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveColumn:
    """One column of a table.

    Attributes
    ----------
    key : str
        Heading; stable, ASCII, never translated.
    label : str
        Which words stand above it; empty: those of its key.
    kind : str
        ``input`` (typed by the user), ``formula``, or ``value`` (written by the program).
    formula : str
        With ``[@key]`` for the same row.
    places : int or None
        Decimals shown; None for text and whole numbers.
    width : float
        In characters.
    folded : bool
        Whether the column is grouped and folded away: a step on the way, not a result.
    spare : float or None
        What the formula shows in rows that hold no point; None where it shows nothing, NaN #N/A.
    form : str
        Number format in place of the one that follows from ``places``.
    choices : str
        What may be typed, with commas between; empty where any number may be.
    limits : tuple of float
        The least and the largest number that can be meant.
    """

    key: str
    label: str = ""
    kind: str = "input"
    formula: str = ""
    places: int | None = None
    width: float = 9.5
    folded: bool = False
    spare: float | None = None
    form: str = ""
    choices: str = ""
    limits: tuple[float, float] = (-_LIMIT, _LIMIT)

    @property
    def number_format(self) -> str:
        """How its cells show numbers."""
        if self.form or self.places is not None:
            return self.form or ("0." + "0" * self.places if self.places else "0")
        # Names typed as 1-2 must not turn into dates: text, but only where text is typed.
        return "@" if self.kind == "input" and self.key in TEXT_KEYS else "General"


@lru_cache(maxsize=1024)  # of every row the same
def row_formula(table: str, text: str) -> str:
    """Return a formula with ``[@key]`` written as the file format wants it."""
    return "=" + re.sub(r"\[@(\w+)\]", rf"{table}[[#This Row],[\1]]", text)


class FormulaBook:
    """The tables and formulas of one kind of workbook, read from a package's `formulas.toml`.

    A row of ``columns`` is a `LiveColumn`. Where it says ``each``, it stands for one column a word:
    ``{0}`` is the word, ``{1}``, ``{2}`` its letters, or what stands between its colons. Any value
    may be a table from facts to what holds where they do (``"xy !media"``; an empty key: always);
    a row with ``when`` is there only where its facts hold, one with ``rows`` is another list. In
    formulas ``{name one two}`` is a part of ``[parts]``, of the table's or of all, with what it is
    given as ``{1}``, ``{2}``.

    Parameters
    ----------
    package : str
        Where the file lies.
    name : str
        What it is called.
    """

    def __init__(self, package: str, name: str = "formulas") -> None:
        self.package, self.name = package, name

    @cached_property
    def content(self) -> dict[str, dict[str, Any]]:
        """The file."""
        text = files(self.package).joinpath(f"{self.name}.toml").read_text(encoding="utf-8")
        return tomllib.loads(text)

    def columns(
        self,
        table: str,
        facts: Collection[str] = (),
        parts: Mapping[str, str] | None = None,
        *,
        rows: str = "columns",
    ) -> tuple[LiveColumn, ...]:
        """Return the columns of a table, or single formulas that are described alike.

        Parameters
        ----------
        table : str
            Its section.
        facts : collection of str
            What holds.
        parts : mapping, optional
            Further parts of formulas.
        rows : str
            Which list of the section.
        """
        lines, shared = self.content[table], self.content
        every = ChainMap(dict(parts or {}), lines.get("parts", {}), shared["parts"])
        formulas = _Formulas(
            facts,
            {name: chosen(text, facts) for name, text in every.items()},
            ChainMap(lines.get("rows", {}), shared.get("rows", {})),
        )
        return tuple(formulas.expanded(lines[rows], ()))


@dataclass(frozen=True, slots=True)
class _Formulas:
    """What rows are filled with: the facts that hold, the parts of formulas, lists of rows."""

    facts: Collection[str]
    parts: Mapping[str, str]
    rows: Mapping[str, Sequence[Mapping[str, Any]]]

    def expanded(
        self, rows: Iterable[Mapping[str, Any]], arguments: Sequence[str]
    ) -> Iterator[LiveColumn]:
        """Yield the columns of some rows."""
        for row in rows:
            if not holds(row.get("when", ""), self.facts):
                continue
            words = self.filled(row["each"], arguments).split() if "each" in row else [None]
            for word in words:
                arguments_of_row = (
                    arguments
                    if word is None
                    else (word, *(word.split(":") if ":" in word else word))
                )
                if "rows" in row:
                    yield from self.expanded(self.rows[row["rows"]], arguments_of_row)
                else:
                    yield self._column(row, arguments_of_row)

    def _column(self, row: Mapping[str, Any], arguments: Sequence[str]) -> LiveColumn:
        values = {n: chosen(v, self.facts) for n, v in row.items() if n not in ("when", "each")}
        values = {name: value for name, value in values.items() if value is not None}
        for name in ("key", "label", "formula"):
            values[name] = self.filled(values.get(name, "{0}" if name == "key" else ""), arguments)
        if "limits" in values:
            values["limits"] = tuple(values["limits"])
        return LiveColumn(**{"kind": "formula" if values["formula"] else "input", **values})

    def filled(self, text: str, arguments: Sequence[str] = ()) -> str:
        """Return a formula with what is given, and its parts, in their places."""
        text = _GIVEN.sub(
            lambda m: arguments[int(m[1])] if int(m[1]) < len(arguments) else "", text
        )
        while match := _PART.search(text):
            name, *own = match[1].split()
            part = self.filled(self.parts[name], (name, *own))
            text = text[: match.start()] + part + text[match.end() :]
        return text


#: A place for what a part is given, and a part without others inside.
_GIVEN, _PART = re.compile(r"\{(\d)\}"), re.compile(r"\{([^{}]+)\}")


def chosen(value: Any, facts: Collection[str]) -> Any:
    """Return a value, of a table of values the first whose facts hold; None if none do."""
    if not isinstance(value, dict):
        return value
    return next((text for condition, text in value.items() if holds(condition, facts)), None)


def holds(condition: str, facts: Collection[str]) -> bool:
    """Tell whether facts hold, and those after "!" do not."""
    return all((word.lstrip("!") in facts) != word.startswith("!") for word in condition.split())
