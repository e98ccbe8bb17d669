"""Every text of the report in English, Italian and German: read from `words.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import cache
from importlib.resources import files

from photocore.errors import InputError
from photocore.workbook.words import LANGUAGES

__all__ = ["LANGUAGES", "words_in"]

Words = Callable[..., str]


@cache
def _content() -> dict[str, dict[str, str]]:
    return tomllib.loads(files(__package__).joinpath("words.toml").read_text(encoding="utf-8"))


def words_in(language: str) -> Words:
    """Return the function that gives a text by its key, its blanks filled.

    Raises
    ------
    InputError
        If the language is none of `LANGUAGES`.
    """
    if language not in LANGUAGES:
        raise InputError(f"language: {language!r} is none of {', '.join(LANGUAGES)}.")

    def say(key: str, **blanks: object) -> str:
        return _content()[key][language].format(**blanks)

    return say
