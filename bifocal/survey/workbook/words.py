"""Every word of the survey workbook in English, Italian and German: read from `words.toml`."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

LANGUAGES = ("en", "it", "de")


class Wording(NamedTuple):
    """One expression in every language, with the unit of what it names."""

    en: str
    it: str
    de: str
    unit: str = ""

    def in_language(self, language: str) -> str:
        """Return the expression in a language."""
        return self[LANGUAGES.index(language)]

    @property
    def names(self) -> tuple[str, ...]:
        """The expression in all languages."""
        return self[: len(LANGUAGES)]


@cache
def _content() -> dict[str, dict[str, Any]]:
    return tomllib.loads(files(__package__).joinpath("words.toml").read_text(encoding="utf-8"))


def term(section: str, key: str) -> Wording | None:
    """Return an entry of the sections ``columns``, ``setup`` or ``words``; None if absent."""
    entry = _content()[section].get(key)
    return None if entry is None else Wording(**entry)


def word(key: str, language: str) -> str:
    """Return a word of the workbook in a language."""
    return Wording(**_content()["words"][key]).in_language(language)


def label(key: str, language: str) -> str:
    """Return a column's label with its unit."""
    column = Wording(**_content()["columns"][key])
    name = column.in_language(language)
    return f"{name} [{column.unit}]" if column.unit else name


def headings(section: str, key: str) -> tuple[str, ...]:
    """Return every heading of a column, or label of a cell of ``setup``, that is understood."""
    known = term(section, key)
    return (*(known.names if known else ()), *_content()["headings"].get(key, ()))


def readme(language: str) -> list[str]:
    """Return the paragraphs of the sheet `Readme`; "#" marks a heading."""
    return str(_content()["readme"][language]).splitlines()
