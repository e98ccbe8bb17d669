"""Words of workbooks in English, Italian and German, read from a package's `words.toml`."""

from __future__ import annotations

import re
from functools import cached_property
from typing import Any, NamedTuple

from photocore.textfile import packaged

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


class WordBook:
    """The words of one kind of workbook.

    Parameters
    ----------
    package : str
        Where its `words.toml` lies, with the sections ``words``, ``columns``, ``prompts`` and
        ``readme``, and others of its own. An entry is one key's, or that of all keys which have a
        number or capitals where it has ``{n}``.
    """

    def __init__(self, package: str) -> None:
        self.package = package

    @cached_property
    def content(self) -> dict[str, dict[str, Any]]:
        """The file."""
        return packaged(self.package, "words")

    def term(self, section: str, key: str) -> Wording | None:
        """Return an entry of a section, also the one of all keys like it; None if absent."""
        entries = self.content[section]
        if key in entries:
            return Wording(**entries[key])
        for family, entry in entries.items():
            form = family.replace("{n}", r"(\d+|[A-Z]+)")
            if form != family and (match := re.fullmatch(form, key)):
                return Wording(**{name: text.format(n=match[1]) for name, text in entry.items()})
        return None

    def word(self, key: str, language: str) -> str:
        """Return a word in a language."""
        return Wording(**self.content["words"][key]).in_language(language)

    def label(self, key: str, language: str) -> str:
        """Return a column's label with its unit."""
        column = self.term("columns", key)
        assert column is not None, key
        name = column.in_language(language)
        return f"{name} [{column.unit}]" if column.unit else name

    def prompt(self, key: str, language: str) -> str:
        """Return what a cell says when it is chosen: its own prompt, or its column's label."""
        entry = self.term("prompts", key)
        return entry.in_language(language) if entry else self.label(key, language)

    def readme(self, language: str) -> list[str]:
        """Return the paragraphs of the sheet `Readme`; "#" marks a heading."""
        return str(self.content["readme"][language]).splitlines()
