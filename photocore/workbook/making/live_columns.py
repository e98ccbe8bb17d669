"""Columns of the tables of new workbooks: keys, kinds, number formats and live formulas.

Formulas are written with ``[@key]`` for the cell of the same row; `row_formula` turns that into the
file's structured references. Only functions of Excel 2007 are used, no text formats, no locale.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

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
    spare : int or None
        What the formula shows in rows that hold no point; None where it shows nothing.
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
    spare: int | None = None
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


def row_formula(table: str, text: str) -> str:
    """Return a formula with ``[@key]`` written as the file format wants it."""
    return "=" + re.sub(r"\[@(\w+)\]", rf"{table}[[#This Row],[\1]]", text)


def formula_column(key: str, formula: str, places: int | None = None, **more: object) -> LiveColumn:
    """Return a column that is calculated."""
    return LiveColumn(key=key, kind="formula", formula=formula, places=places, **more)  # type: ignore[arg-type]
