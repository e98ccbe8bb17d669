"""What a report is made of, whatever it is written as: headings, texts, tables, figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

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
    """A table; first column to the left, the others to the right."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


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
