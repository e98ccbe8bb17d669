"""What a report is made of, whatever it is written as: headings, texts, tables, figures."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

#: Numbers with signs and a short unit: what is compared digit by digit.
_NUMBER = re.compile(r"(?=.*\d)[-+±<>≤≥≈~\d.,:;/×e%() ]+[^\W\d]{0,3}[%°²³]?")
#: Draws into a matplotlib Figure or SubFigure.
Draw: TypeAlias = Callable[[Any], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """A heading; level 1 is the report's title."""

    text: str
    level: int = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Paragraph:
    """A text; ``small`` for what is rarely read, ``lines`` as computed line by line.

    ``link`` is a file beside the report that a page's text leads to; the text itself names it.
    """

    text: str
    small: bool = False
    lines: tuple[str, ...] = ()
    link: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Banner:
    """What must be seen first; ``good`` None where it is neither."""

    text: str
    details: tuple[str, ...] = ()
    good: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table; its first column and those of words to the left, those of numbers to the right."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""

    @property
    def to_the_left(self) -> tuple[bool, ...]:
        """Which columns are set to the left: most of their filled cells are no numbers.

        Examples
        --------
        >>> rows = [["P1", "0.125", "mm", "-"], ["P2", "-3.1", "mm", "12 %"]]
        >>> TextTable(headings=["point", "r", "unit", "share"], rows=rows).to_the_left
        (True, False, True, False)
        """
        return tuple(
            column == 0 or _are_words([row[column] for row in self.rows])
            for column in range(len(self.headings))
        )


def _are_words(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell.strip(" -\N{EN DASH}")]
    return 2 * sum(_NUMBER.fullmatch(cell.strip()) is not None for cell in filled) < len(filled)


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure over the full width, its height over its width, and what it shows."""

    draw: Draw
    ratio: float
    caption: str


Block: TypeAlias = Heading | Paragraph | Banner | TextTable | Picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A report.

    Attributes
    ----------
    title, language : str
    subject : str
        Program, date and the like, for the properties of the file.
    blocks : tuple of Block
    """

    title: str
    language: str
    subject: str
    blocks: tuple[Block, ...]
