"""Every word of the survey workbook in English, Italian and German: read from `words.toml`."""

from __future__ import annotations

from photocore.workbook import LANGUAGES, WordBook

__all__ = ["LANGUAGES", "WORDS", "headings", "readme", "term", "word"]

WORDS = WordBook(__package__)
term, word = WORDS.term, WORDS.word


def readme(language: str, *, media: bool = False, leaning: bool = False) -> list[str]:
    """Return the paragraphs of the sheet `Readme`; with media the formulas of bent rays."""
    lines = WORDS.readme(language)
    if not media:
        return lines
    texts = WORDS.content["readme_leaning" if leaning else "readme_media"]
    bent = str(texts[language]).splitlines()
    first = next(row for row, line in enumerate(lines) if line.startswith("ds ="))
    return [*lines[:first], *bent, *lines[first + len(bent) :]]


def headings(section: str, key: str) -> tuple[str, ...]:
    """Return every heading of a column, or label of a cell of ``setup``, that is understood."""
    entry = term(section, key)
    return (*(entry.names if entry else ()), *WORDS.content["headings"].get(key, ()))
