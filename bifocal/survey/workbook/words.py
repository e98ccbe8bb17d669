"""Every word of the survey workbook in English, Italian and German: read from `words.toml`."""

from __future__ import annotations

from photocore.workbook.words import LANGUAGES, WordBook

__all__ = ["LANGUAGES", "WORDS", "headings", "readme", "term", "word"]

WORDS = WordBook(__package__)
term, word, readme = WORDS.term, WORDS.word, WORDS.readme


def headings(section: str, key: str) -> tuple[str, ...]:
    """Return every heading of a column, or label of a cell of ``setup``, that is understood."""
    known = term(section, key)
    return (*(known.names if known else ()), *WORDS.content["headings"].get(key, ()))
