"""Texts of reports in English, Italian and German, read from a package's `words.toml`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from photocore.errors import InputError
from photocore.textfile import packaged
from photocore.workbook import LANGUAGES

__all__ = ["LANGUAGES", "texts_of", "words_of"]

Words = Callable[..., str]


@cache
def texts_of(package: str) -> dict[str, dict[str, str]]:
    """Return the texts of a package by key and language; ``{...}`` are blanks to fill."""
    return packaged(package, "words")


def words_of(package: str, language: str) -> Words:
    """Return the function that gives a text by its key, its blanks filled.

    Raises
    ------
    InputError
        If the language is none of `LANGUAGES`.
    """
    if language not in LANGUAGES:
        raise InputError(f"language: {language!r} is none of {', '.join(LANGUAGES)}.")

    def say(key: str, **blanks: object) -> str:
        return texts_of(package)[key][language].format(**blanks)

    return say
