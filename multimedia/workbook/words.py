"""Every word of the multimedia workbook in English, Italian and German."""

from __future__ import annotations

from photocore.workbook import LANGUAGES, WordBook

__all__ = ["LANGUAGES", "WORDS"]

WORDS = WordBook(__package__)
