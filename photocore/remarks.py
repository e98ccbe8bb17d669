"""Remarks with a key and values; their words lie in a package's `remarks.toml`, in 3 languages.

A remark is a ``str``, its English words: files, JSON and the command line hold these. Reports and
pages call `Remarks.in_language`, which knows a remark by its words wherever it stands, also in a
text that was read from a file or put together from several.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache, partial
from string import Formatter
from typing import Any

from photocore.textfile import packaged
from photocore.workbook.making.words import LANGUAGES

#: Entries of this section are single words: looked up only as values of blanks ``{...!s}``.
WORDS = "word."
#: What a blank with a number format may hold; any other holds any text.
_NUMBER, _TEXT = r"[-+−\d.,:einfa%]+?", r"[^\n]+?"


class Remark(str):
    """Something to tell the user, in English words.

    Attributes
    ----------
    key : str
        Its section and name in `remarks.toml`.
    values : mapping
        What fills its blanks.
    """

    key: str
    values: Mapping[str, Any]


class Remarks:
    """The remarks of a package and of those it builds on.

    Parameters
    ----------
    *packages : str
        Each with a file `remarks.toml` of tables ``[section.name]``, each of which holds one text
        with blanks a language. A blank is a format field; ``!s`` says that its value is itself
        looked up.

    Examples
    --------
    >>> remark = Remarks("bifocal")
    >>> text = remark("survey.off_radial_more", count=3)
    >>> text
    '... and 3 more OFF-RADIAL points.'
    >>> remark.in_language(f"survey.xlsx: {text}", "it")
    'survey.xlsx: ... e altri 3 punti OFF-RADIAL.'
    """

    def __init__(self, *packages: str) -> None:
        self.packages = packages
        self.in_language = lru_cache(4096)(self._in_language)

    @cached_property
    def texts(self) -> dict[str, dict[str, str]]:
        """Texts by key and language."""
        found: dict[str, dict[str, str]] = {}
        for package in self.packages:
            for section, entries in packaged(package, "remarks").items():
                found |= {f"{section}.{name}": words for name, words in entries.items()}
        return found

    def __call__(self, key: str, /, *, of: object = "", **values: Any) -> Remark:
        """Return a remark by its key, its blanks filled, behind the place that it is about."""
        told = Remark((f"{of}: " if of else "") + self.texts[key]["en"].format(**values))
        told.key, told.values = key, values
        return told

    def _in_language(self, text: str, language: str) -> str:
        """Return a text with all remarks known in it in another of `LANGUAGES`.

        Parameters
        ----------
        text : str
            A `Remark`, or any text that holds some: their words tell which.
        language : str
        """
        if language == LANGUAGES[0]:
            return str(text)
        for entry in self._entries:
            # The longest alone first: it tells nearly all of them apart.
            if entry.literals[0] in text and all(part in text for part in entry.literals):
                text = entry.pattern.sub(partial(self._worded, entry, language), text)
        return str(text)

    def _worded(self, entry: _Entry, language: str, match: re.Match[str]) -> str:
        blanks = match.groupdict()
        for name in entry.nested & blanks.keys():
            words = (self._words.get(word, {language: word}) for word in blanks[name].split(", "))
            listed = ", ".join(word[language] for word in words)
            blanks[name] = self.in_language(listed, language)
        return entry.texts[language].format(**blanks)

    @cached_property
    def _words(self) -> dict[str, dict[str, str]]:
        return {text["en"]: text for key, text in self.texts.items() if key.startswith(WORDS)}

    @cached_property
    def _entries(self) -> list[_Entry]:
        """What is searched for, longest first."""
        found = [_Entry(text) for key, text in self.texts.items() if not key.startswith(WORDS)]
        return sorted(found, key=lambda entry: -sum(map(len, entry.literals)))


class _Entry:
    """A text of `remarks.toml`: how to know it, and its other languages without formats."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        parts = list(Formatter().parse(texts["en"]))
        self.literals = sorted((text for text, *_ in parts if text), key=len, reverse=True)
        self.nested = {name for _, name, _, mark in parts if name and mark == "s"}
        self.pattern = re.compile("".join(_patterns(parts)))
        self.texts = {key: re.sub(r"(?<=\w)[:!][^{}]*}", "}", text) for key, text in texts.items()}


def _patterns(parts: list[Any]) -> Iterator[str]:
    """Yield the parts of the regular expression that knows a text."""
    known: set[str] = set()
    for place, (literal, name, form, _) in enumerate(parts):
        yield re.escape(literal)
        if name is None:
            continue
        kind = _NUMBER if form else _TEXT
        if place == len(parts) - 1:
            kind = kind[:-1]  # at the end as much as there is
        yield f"(?P={name})" if name in known else f"(?P<{name}>{kind})"
        known.add(name)


remark = Remarks("photocore")
