"""Which letters the bytes of a text file mean, by what they spell."""

from __future__ import annotations

import codecs
import re
from collections import Counter

from photocore.remarks import remark

#: Letters beyond ASCII of languages: of the west, then of the middle of Europe.
_WEST = ("àèéìíîòóùú", "äöüß", "àâæçéèêëîïôœùûüÿ", "áéíñóúü", "àáâãçéêíóôõúü", "åäöøæé")
_MIDDLE = ("áčďéěíňóřšťúůýž", "ąćęłńóśźż", "áéíóöőúüű", "čćđšž", "áäčďéíĺľňóôŕšťúýž", "ăâîşţșț")
#: Code page and the languages that are written in it, the likelier first.
_CODES = (("cp1252", _WEST), ("mac_roman", _WEST), ("cp1250", _MIDDLE))
_NAMES = {"cp1252": "Windows-1252", "mac_roman": "Mac Roman", "cp1250": "Windows-1250",
          "shift_jis": "Shift-JIS"}  # fmt: skip
_SIGNS = frozenset("°²³µ±×·§€«»–—’‘“”…©®ºª№†•")
#: A sign, or a capital of another alphabet than its word, inside a word.
_ODD = re.compile(r"(?<=[a-z])[§°²³±×»«†•º](?=[a-z])|(?<=[A-Za-z])[\u00c0-\u00deŸŽŠŒ](?=[a-z])")
_JAPANESE = re.compile("[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e]+")
_LATIN = re.compile("[A-Za-z]")
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
        name = _spelling(content)
        if name == "cp1252":
            return content.decode(name, errors="replace"), [remark("table.not_utf8")]
        return content.decode(name), [remark("table.encoding", name=_NAMES[name])]


def _spelling(content: bytes) -> str:
    """Return the code page in which the fewest letters are of no language of it.

    Examples
    --------
    >>> _spelling("Fenêtre à gauche".encode("mac_roman")), _spelling("příční okno".encode("cp1250"))
    ('mac_roman', 'cp1250')
    >>> _spelling("窓の角".encode("shift_jis")), _spelling("Città, perché".encode("cp1252"))
    ('shift_jis', 'cp1252')
    """
    if _is_japanese(content):
        return "shift_jis"
    misfits = {}
    for code, languages in _CODES:
        try:
            text = content.decode(code)
        except UnicodeDecodeError:
            continue
        letters = Counter(c for c in text if c > "\x7f" and c not in _SIGNS)
        misfits[code] = min(
            sum(n for letter, n in letters.items() if letter.lower() not in alphabet)
            for alphabet in languages
        ) + len(_ODD.findall(text))
    best = min(misfits, key=lambda code: misfits[code], default="cp1252")
    # What no language explains is left to the commonest.
    return best if misfits.get(best, 1) < misfits.get("cp1252", 10**9) else "cp1252"


def _is_japanese(content: bytes) -> bool:
    """Whether all beyond ASCII is Japanese, and no lone sign of it stands inside a Latin word."""
    try:
        text = content.decode("shift_jis")
    except UnicodeDecodeError:
        return False
    runs = list(re.finditer(r"[^\x00-\x7f]+", text))
    lone = [
        run
        for run in runs
        if len(run[0]) == 1 and _LATIN.search(text[run.start() - 1 : run.end() + 1])
    ]
    return bool(runs) and not lone and all(_JAPANESE.fullmatch(run[0]) for run in runs)
