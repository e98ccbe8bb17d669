"""The words of a heading: its bare form, the unit it says, and the forms it may be known by."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache

from photocore.tables.axes import EAST, NORTH
from photocore.tables.numbers import GRAD, UNITS, unit_symbol

_UNIT = re.compile(r"\s*[\[(]\s*([^\])]*)\s*[\])]\s*$")
_LOOSE_UNIT = re.compile(r"[\s_,]+(mm|cm|m|ft|ftus|px|pixel|deg|°|gon|rad)$", re.IGNORECASE)
#: Ends a unit: square metres and the like.
_POWER = re.compile(r"(?:[²³]|\^?[23])$")
#: Ends a heading that says from where heights are counted, or that it holds values.
_DATUM = re.compile(
    r"[\s_.,-]*(?:\b|_|(?<=\b[EHNXYZ]))(?:(?:m[\s.]*)?(?:ü|ue|über)[\s.]*)?"
    r"(?:NH?N|NAP|TAW|NGF|IGN ?69|DHHN ?\d*|LN ?02|A?M?SL|a\.s\.l\.|s\. ?l\. ?m\."
    r"|m?s\.?[ln]\.?m\.?|ortho?m?|wert|values?|valore|valeur|coord(?:inat[ea]|\.)?|koordinate"
    r"|UTM ?\d*[NS]?|GK ?\d*|L93|CC\d\d|LV ?\d\d)$",
    re.IGNORECASE,
)
#: Begins a heading of a coordinate, and says nothing of which.
_PREFIX = re.compile(
    r"^\W*(?:coord(?:inat[ea])?|koordinate|grid|point|local)[\s_.]+(?=\w)", re.IGNORECASE
)
#: Begins a heading of what coordinates are worth.
_PRECISION = re.compile(r"\W*(?:accuracy|precision|error|sigma|std|rms)", re.IGNORECASE)
#: An axis named by its letter and, in round brackets, by its direction, which counts; "(est)" is
#: short for an estimate as well.
_DIRECTED = re.compile(r"\s*[XY]\s*\(\s*(\w+)\s*\)\s*", re.IGNORECASE)
_DIRECTIONS = frozenset(word.casefold() for word in (*EAST, *NORTH) if len(word) > 3)
#: Units people measure in that no command takes.
_FOREIGN = frozenset(
    (*GRAD, "in", "inch", "inches", "yd", "yard", "yards", "mi", "mile", "miles",
     "furlong", "furlongs", "mil", "mils", "arcsec", "arcmin", "mgon", "mrad")
)  # fmt: skip
#: What may stand in square brackets besides lengths, angles and pixels.
_NO_LENGTHS = frozenset(("1", "–", "s", "‰"))
_DROPPED = re.compile(r"[\s_.\-:/'\"`´]+")
#: What a heading begins with where its row is a comment.
_COMMENT = re.compile(r"^\s*(?:#|//)\s*(?=\w)")


@lru_cache(maxsize=10_000)
def bare(text: str) -> str:
    """Return a heading without unit, case, blanks and punctuation.

    >>> bare("S_1 [mm]"), bare("Distanza radiale 1 (mm)"), bare("#Label")
    ('s1', 'distanzaradiale1', 'label')
    """
    text = _COMMENT.sub("", unicodedata.normalize("NFKC", text).casefold())
    return _DROPPED.sub("", _UNIT.sub("", text))


def unit_of(text: str) -> str:
    """Return the unit a heading says in brackets or at its end, as a stable symbol.

    >>> unit_of("s1 [mm]"), unit_of("theta"), unit_of("x far px")
    ('mm', '', 'px')
    """
    unit = _UNIT.search(text) or _LOOSE_UNIT.search(text)
    return unit_symbol(_DATUM.sub("", unit[1])) if unit else ""


def unknown_unit(text: str) -> str:
    """Return the unit a heading says where it is none that is known, else an empty text.

    What stands in square brackets is a unit; in round ones it may be any word, so only units that
    people use elsewhere count there.

    >>> unknown_unit("s1 [furlong]"), unknown_unit("E (yd)"), unknown_unit("cov [m²]")
    ('furlong', 'yd', '')
    >>> unknown_unit("X (east)"), unknown_unit("scale [1]")
    ('', '')
    """
    match = _UNIT.search(text)
    if match is None:
        return ""
    word = _DATUM.sub("", match[1]).strip(" .")
    base = _POWER.sub("", word).casefold()
    if match[0].lstrip().startswith("("):
        return word if base in _FOREIGN else ""
    return "" if not word or base in UNITS or base in _NO_LENGTHS else word


def numbered(text: str, digit: str) -> str:
    """Return a heading with a digit in front of its unit: ``x [mm]`` of photo 1 is ``x1 [mm]``."""
    unit = _UNIT.search(text)
    return f"{text[: unit.start()]}{digit}{unit[0]}" if unit else f"{text.strip()}{digit}"


def forms_of(variants: Sequence[str]) -> list[str]:
    """Return the bare forms a heading may be known by, the strictest first.

    >>> forms_of(["x1 [mm]"]), forms_of(["X (North)"]), forms_of(["Y (est)"])
    (['x1'], ['north'], ['y'])
    >>> forms_of(["x [px]"])  # no coordinate on the wall
    ['pixelx']
    """
    forms = [*dict.fromkeys(form for text in variants for form in _forms(text))]
    return forms or [""]


@lru_cache(maxsize=10_000)
def _forms(text: str) -> tuple[str, ...]:
    """Return the bare forms of one heading, none empty: as it is, and without a unit at its end."""
    if bare(text) in ("x", "y") and unit_of(text) == "px":
        text = f"pixel {bare(text)}"
    directed = _DIRECTED.fullmatch(text)
    if directed and directed[1].casefold() in _DIRECTIONS:
        text = directed[1]
    forms = bare(text), bare(_LOOSE_UNIT.sub("", _UNIT.sub("", text).strip()))
    return tuple(filter(None, forms))


@lru_cache(maxsize=10_000)
def parts_of(text: str) -> frozenset[str]:
    """Return bare forms of what a heading says besides itself: sides of a slash, less a datum.

    >>> [sorted(parts_of(text)) for text in ("X/Easting", "Höhe m ü. NN", "Point Elevation [m]")]
    [['easting', 'x'], ['höhe'], ['elevation']]
    >>> parts_of("Accuracy_X/Y/Z_(m)")
    frozenset()
    """
    whole = _UNIT.sub("", text).strip()
    sides = whole.split("/") if whole.count("/") == 1 and not _PRECISION.match(whole) else []
    plain = _PREFIX.sub("", _DATUM.sub("", whole))
    return frozenset(map(bare, (*sides, plain))) - {"", bare(text)}
