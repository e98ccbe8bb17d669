"""Remarks with a key, values and a level; their words lie in `remarks.toml`, in 3 languages.

A remark is a ``str``, its English words: messages, files and the command line hold these. Each is
remembered with its key and values as it is made, and files of JSON keep these beside the words
(`with_keys`, `learn`), so that `Remarks.in_language` finds a remark wherever it stands, also in a
text put together from several, by what was made and never by how it reads.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from numbers import Integral
from string import Formatter
from typing import Any

from photocore.textfile import packaged
from photocore.workbook import LANGUAGES

#: Entries of this section are single words: looked up only as values of blanks ``{...!s}``.
WORDS = "word."
#: By this key JSON files hold what their remarks are made of.
KEYS = "remark_keys"
#: How much a remark weighs, the worst first.
LEVELS = ("stop", "alarm", "doubt", "hint")
#: Tables of `remarks.toml` that list the keys of a level other than ``doubt``, which is the rule.
_LISTED = {"alarms": "alarm", "hints": "hint"}
#: Remarks that are remembered, the latest; and the shortest text that may hold one.
_REMEMBERED, _SHORTEST = 4_000, 5


class Remark(str):
    """Something to tell the user, in English words.

    Attributes
    ----------
    key : str
        Its section and name in `remarks.toml`.
    values : mapping
        What fills its blanks.
    level : str
        One of `LEVELS`: ``stop`` where nothing was made, ``alarm`` where what was made is wrong if
        nothing is done, ``doubt`` where it may be, ``hint``.
    """

    key: str
    values: Mapping[str, object]
    level: str

    def stop(self) -> None:
        """Say that nothing was made."""
        self.level = "stop"
        for _, part in _within(self):
            part.level = "stop"

    def __reduce__(self) -> tuple[Any, ...]:
        return _remembered, (str(self), self.key, dict(self.values), self.level)


#: What was made, by its English words.
_MADE: dict[str, Remark] = {}


def _remembered(text: str, key: str, values: Mapping[str, object], level: str) -> Remark:
    remark = Remark(text)
    remark.key, remark.values, remark.level = key, values, level
    if len(text) >= _SHORTEST:
        _MADE.pop(text, None)
        _MADE[text] = remark
        if len(_MADE) > _REMEMBERED:
            del _MADE[next(iter(_MADE))]
    return remark


def _within(text: str) -> Iterator[tuple[int, Remark]]:
    """Yield the remarks that a text holds and where, from left to right, none inside another."""
    held = [_MADE[text]] if text in _MADE else []
    if not held and len(text) >= _SHORTEST:
        held = [told for words, told in _MADE.items() if words in text]
    end = 0
    while held:
        places = [(text.find(told, end), -len(told), told) for told in held]
        places = [found for found in places if found[0] >= 0]
        if not places:
            return
        place, length, told = min(places)
        yield place, told
        end, held = place - length, [found[2] for found in places]


def keys_in(text: str) -> set[str]:
    """Return the keys of the remarks that a text holds.

    Examples
    --------
    >>> text = Remarks("bifocal")("survey.off_radial_more", count=3)
    >>> keys_in(f"survey.xlsx: {text}")
    {'survey.off_radial_more'}
    """
    return {part.key for _, part in _within(text)}


def level_of(text: str) -> str:
    """Return the worst level of the remarks that a text holds; ``hint`` where it holds none.

    Examples
    --------
    >>> level_of(f"survey.xlsx: {Remarks('bifocal')('survey.off_radial_more', count=3)}")
    'doubt'
    """
    return min((part.level for _, part in _within(text)), key=LEVELS.index, default="hint")


def alarms_in(texts: Iterable[str]) -> list[str]:
    """Return the texts that say that what was made is wrong: what a file carries on of its making.

    Examples
    --------
    >>> alarms_in([Remarks("bifocal")("orientation.no_wall"), "a note"])[0][:10]
    'NO WALL FO'
    """
    return [text for text in texts if level_of(text) in LEVELS[:2]]


def with_keys(value: dict[str, object]) -> dict[str, object]:
    """Return an object for JSON with keys, values and levels of all remarks that its texts hold."""
    held: dict[str, object] = {}

    def collect(part: Any) -> None:
        if isinstance(part, str):
            for _, told in _within(part):
                if told not in held:
                    values = {name: _plain(one) for name, one in told.values.items()}
                    held[str(told)] = {"key": told.key, "values": values, "level": told.level}
                    collect([one for one in values.values() if isinstance(one, str)])
        elif isinstance(part, Mapping):
            for one in part.values():
                collect(one)
        elif isinstance(part, list | tuple):
            for one in part:
                collect(one)

    collect({name: part for name, part in value.items() if name != KEYS})
    rest = {name: part for name, part in value.items() if name != KEYS}
    return {**rest, KEYS: held} if held else rest


def learn(value: Any) -> None:
    """Remember the remarks of an object read from JSON."""
    held = value.get(KEYS) if isinstance(value, dict) else None
    for text, entry in (held if isinstance(held, dict) else {}).items():
        if isinstance(entry, dict) and isinstance(entry.get("values"), dict):
            level = entry.get("level")
            level = level if level in LEVELS else "doubt"
            _remembered(text, str(entry.get("key")), entry["values"], level)


def _plain(value: Any) -> Any:
    """Return a value of a blank as JSON can hold it; a number that is none as its text."""
    if isinstance(value, str | bool | Integral):
        return str(value) if isinstance(value, str) else int(value)
    try:
        number = float(value)
    except (TypeError, ValueError):
        return str(value)
    return number if math.isfinite(number) else str(number)


class Remarks:
    """The remarks of a package and of those it builds on.

    Parameters
    ----------
    *packages : str
        Each with a file `remarks.toml` of tables ``[section.name]``, each of which holds one text
        with blanks a language. A blank is a format field; ``!s`` says that its value is itself
        looked up. Tables ``[alarms]`` and ``[hints]`` list the keys of those that are more or less
        than a doubt.

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

    @cached_property
    def texts(self) -> dict[str, dict[str, str]]:
        """Texts by key and language."""
        found: dict[str, dict[str, str]] = {}
        for package in self.packages:
            for section, entries in packaged(package, "remarks").items():
                if section not in _LISTED:
                    found |= {f"{section}.{name}": words for name, words in entries.items()}
        return found

    @cached_property
    def levels(self) -> dict[str, str]:
        """Levels by key, of remarks that are no plain doubts."""
        return {
            key: level
            for package in self.packages
            for table, level in _LISTED.items()
            for key in packaged(package, "remarks").get(table, {}).get("keys", ())
        }

    def __call__(self, key: str, /, *, of: object = "", **values: Any) -> Remark:
        """Return a remark by its key, its blanks filled, behind the place that it is about."""
        words = self.texts[key]["en"].format(**values)
        remark = _remembered(words, key, values, self.levels.get(key, "doubt"))
        if not of:
            return remark
        placed = Remark(f"{of}: {words}")
        placed.key, placed.values, placed.level = remark.key, remark.values, remark.level
        return placed

    def in_language(self, text: str, language: str) -> str:
        """Return a text with all remarks that it holds in another of `LANGUAGES`.

        Parameters
        ----------
        text : str
            A `Remark`, or any text that holds some.
        language : str
        """
        if language == LANGUAGES[0]:
            return str(text)
        parts, end = "", 0
        for place, part in _within(text):
            parts += text[end:place] + self._worded(part, language)
            end = place + len(part)
        return parts + text[end:]

    def _worded(self, part: Remark, language: str) -> str:
        if part.key not in self.texts:
            return str(part)
        parts = ""
        for literal, name, form, mark in Formatter().parse(self.texts[part.key][language]):
            parts += literal
            if name is not None:
                value = part.values.get(name, "")
                value = repr(value) if mark == "r" else value
                parts += self._blank(value, form or "", language, is_word=mark == "s")
        return parts

    def _blank(self, value: Any, form: str, language: str, *, is_word: bool) -> str:
        """Return what fills a blank: numbers in their form, remarks among texts translated."""
        if not isinstance(value, str):
            try:
                return format(value, form)
            except (TypeError, ValueError):  # of a file that somebody changed
                return str(value)
        if is_word:
            words = (self._words.get(word, {language: word}) for word in value.split(", "))
            value = ", ".join(word[language] for word in words)
        return self.in_language(value, language)

    @cached_property
    def _words(self) -> dict[str, dict[str, str]]:
        return {text["en"]: text for key, text in self.texts.items() if key.startswith(WORDS)}


remark = Remarks("photocore")
