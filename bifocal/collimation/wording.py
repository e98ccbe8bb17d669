"""What the server says to the user, in English, Italian and German: read from `words.toml`."""

from __future__ import annotations

import re
from functools import cache
from string import Formatter
from typing import Any

from bifocal.remarks import in_language
from photocore.textfile import packaged

#: An option of the command line, which the page does not have, with its value.
_OPTION = r"--[a-z][\w-]*(?: (?:[A-Z]+|\d[\d.]*)(?:,(?:[A-Z]+|\d[\d.]*))*)?"
#: Advice to use one: in brackets of its own; a clause that begins with it; its last words. What
#: else is said stays, and so does the name of the option.
_ADVICE = tuple(
    (re.compile(pattern), instead)
    for pattern, instead in (
        (rf" \({_OPTION}(?:(?:,| or| and| o| e| oder| und) {_OPTION})*\)", ""),
        (rf" \(`bifocal \w+`(?:, {_OPTION})?\)", ""),
        (rf"[:;] {_OPTION} [a-z][^;.]*", ""),
        (rf"(?:, give| and give| with|, indicare| con| mit) {_OPTION}", ""),
        (rf", {_OPTION}(?: angeben|(?=\)))", ""),
        (r"(?<![\w-])--(?=[a-z])", ""),
    )
)

_content = cache(packaged)


class _DecimalComma(Formatter):
    """Fills sentences of languages that write 1,5 for one and a half."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return a value as its blank wants it."""
        text = super().format_field(value, format_spec)
        return text.replace(".", ",") if isinstance(value, float) else text


def say(section: str, key: str, language: str, **fields: Any) -> str:
    """Return a sentence in a language, its fields filled in.

    Examples
    --------
    >>> say("depth", "out", "en", r=1.5), say("depth", "out", "de", r=1.5)
    ('that stands out 1.5 m', 'der 1,5 m vorspringt')
    """
    filler = Formatter() if language == "en" else _DecimalComma()
    return filler.format(_content(__package__, "words")[section][key][language], **fields)


def without_options(text: str, language: str = "en") -> str:
    """Return a remark of the program in a language, without advice for the command line.

    Examples
    --------
    >>> without_options("35% of it is empty: --fill closes holes; --complete marks it.")
    '35% of it is empty.'
    >>> without_options("Distortion (calibrate, give --lens), or refraction. Check it.")
    'Distortion (calibrate), or refraction. Check it.'
    >>> without_options("A calibrated lens (`bifocal calibrate`, --lens) is more reliable.")
    'A calibrated lens is more reliable.'
    >>> without_options("+12 mm, 30 % (--wall 120,130): name a spot with --wall COL,ROW.")
    '+12 mm, 30 %: name a spot.'
    >>> from bifocal.remarks import remark
    >>> ways = "--fill closes holes with the colours around them"
    >>> without_options(remark("ortho.empty", share=0.35, ways=ways), "de")
    '35% des Bildes sind leer.'
    >>> without_options("wall--b.jpg: is blurred.")
    'wall--b.jpg: is blurred.'
    """
    text = in_language(text, language)
    for pattern, instead in _ADVICE:
        text = pattern.sub(instead, text)
    return text.strip()
