"""Which letters the bytes of a text file mean, by what they spell."""

from __future__ import annotations

import codecs
import math
import re
from collections import Counter
from itertools import islice

from photocore.remarks import remark

#: Letters beyond ASCII of languages, the commonest first: of the west, then of mid-Europe.
_WEST = ("àèéùòìóîíú", "üäöß", "éèàêçôœâîûùëïæÿ", "óíáéñúü", "ãçáéíóêâõúôàü", "öäåé", "øåæé")
_MIDDLE = ("íáéěřčžýšůúťďňó", "łąęóżśćźń", "éáöóőüíúű", "čšžćđ", "áíčéýúžšťľôňäďóĺŕ", "ăîâşţ")
#: Code page, its name, the languages that are written in it, and how rare it is. [bit]
_CODES = (
    ("cp1252", "Windows-1252", _WEST, 0.0),
    ("mac_roman", "Mac Roman", _WEST, 1.5),
    ("cp1250", "Windows-1250", _MIDDLE, 1.5),
    ("iso8859-2", "ISO 8859-2", _MIDDLE, 2.0),
    ("shift_jis", "Shift-JIS", ("",), 3.0),
)
_SIGNS = frozenset("°²³µ±×·§€«»–—’‘“”„…©®ºª№†•¿¡")
_LETTER = r"[^\W\d_]"
_WORD = re.compile(f"{_LETTER}+")
#: Signs where no one writes them, and Japanese against a small letter of a Latin word.
_ASTRAY = re.compile(
    rf"(?<={_LETTER})[§°º±µ×»«†•·‘“”–—…¿¡©®€](?={_LETTER})|(?<=[^\W\d_m])[²³]|[†©®€·»”](?={_LETTER})"
    rf"|(?<={_LETTER})[„¿¡«]|¡(?!.*!)|¿(?!.*\?)|[a-z][\u3000-\uffff]|[\u3000-\uffff][a-z]"
)
_JAPANESE = re.compile("[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff9f]")
#: Bits of a letter of another language of the same code, of none, of a sign or capital astray; and
#: the difference below which two codes are both possible.
_RARE, _STRANGE, _ODD, _CLOSE = 6.5, 8.0, 5.0, 2.5
#: First byte of the rarer signs of Japanese.
_UNUSUAL = 0x98
#: Lines with letters beyond ASCII that are looked at.
_LINES = 5000
#: Share of NUL bytes at odd or even places from which a text is UTF-16.
_NULS = 0.3


def decoded(content: bytes) -> tuple[str, list[str]]:
    """Return the text of a file of any usual encoding, and what was taken for granted.

    Raises
    ------
    UnicodeDecodeError
        If it is broken UTF-16.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16"), []
    for start, name in enumerate(("utf-16-be", "utf-16-le")):
        part = content[start::2][:5000]
        if len(content) % 2 == 0 and part.count(0) > _NULS * len(part):
            return content.decode(name), [remark("table.encoding", name=name.upper())]
    try:
        return content.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        lines = (line for line in content.splitlines() if not line.isascii())
        code, name, others = _spelling(b"\n".join(islice(lines, _LINES)))
        key = "unsure" if others else "not_utf8" if code == "cp1252" else "encoding"
        notes: list[str] = [remark(f"table.{key}", name=name, others=others)]
        return content.decode(code, errors="replace"), notes


def _spelling(content: bytes) -> tuple[str, str, str]:
    """Return the code page whose languages spell this most readily, its name, and rivals.

    Examples
    --------
    >>> _spelling("Fenêtre à gauche".encode("mac_roman")), _spelling("příční zeď".encode("cp1250"))
    (('mac_roman', 'Mac Roman', ''), ('cp1250', 'Windows-1250', ''))
    >>> _spelling("窓の角".encode("shift_jis"))[0], _spelling("bod č. 7".encode("cp1250"))
    ('shift_jis', ('cp1252', 'Windows-1252', 'Windows-1250, ISO 8859-2'))
    """
    costs: dict[str, float] = {}
    texts: dict[str, str] = {}
    for code, _, languages, rarity in _CODES:
        try:
            texts[code] = content.decode(code)
        except UnicodeDecodeError:
            continue
        costs[code] = rarity + _cost(texts[code], languages)
    names = {code: name for code, name, *_ in _CODES}
    best = min(costs, key=lambda code: costs[code], default="cp1252")
    rivals = [
        names[code] for code in costs
        if texts[code] != texts[best] and costs[code] < costs[best] + _CLOSE
    ]  # fmt: skip
    return best, names[best], ", ".join(rivals)


def _cost(text: str, languages: tuple[str, ...]) -> float:
    """Return how unlikely a text is in the likeliest of some languages. [bit]"""
    signs = Counter(sign for sign in text if sign > "\x7f")
    letters = Counter(sign.lower() for sign in signs.elements() if sign not in _SIGNS)
    every = "".join(languages)

    def bits(letter: str, alphabet: str) -> float:
        if letter in alphabet:
            return math.log2(2 + alphabet.index(letter))
        if not every and _JAPANESE.match(letter):
            code = letter.encode("shift_jis")
            return 2.5 if len(code) == 1 else 4.0 if code[0] >= _UNUSUAL else 1.5
        return _RARE if letter in every else _STRANGE

    spelt = min(sum(n * bits(c, alphabet) for c, n in letters.items()) for alphabet in languages)
    words = [word for word in _WORD.findall(text) if not word.isascii()]
    mixed = sum(not (w.islower() or w.isupper() or w.istitle()) for w in words) if every else 0
    return spelt + signs.total() - letters.total() + _ODD * (len(_ASTRAY.findall(text)) + mixed)
