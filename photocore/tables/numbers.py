"""Numbers as people type them: decimal commas, thousands, units, odd minus signs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import LARGEST

Decimal = Literal["point", "comma"]
Evidence = Literal["point", "comma", "none", "grouped comma", "grouped point"]

#: Units people type, as they are written in headings; spelling to stable symbol.
_SPELLINGS = {"um": "µm μm um", "px": "px pixel pixels pix", "degC": "°c"}
_SPELLINGS |= {"deg": "° deg degree degrees gradi", "gon": "gon gons"}
#: The foot of 0.3048 m, and that of the United States' surveys, 2 ppm longer.
_SPELLINGS |= {"ft": "ft feet foot ift intft internationalfeet internationalfoot"}
_US = "ftus usft sft ussft footus feetus surveyfeet surveyfoot surveyft"
_SPELLINGS |= {"ftUS": f"{_US} ussurveyfeet ussurveyfoot"}
_SPELLINGS |= {unit: unit for unit in ("mm", "cm", "dm", "m", "km", "rad", "%", "nm", "-")}
UNITS = {word: unit for unit, words in _SPELLINGS.items() for word in words.split()}
#: Metres in each unit of length.
METRES = {"m": 1.0, "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "km": 1e3}
FEET = {"ft": 0.3048, "ftUS": 1200 / 3937}
METRES |= FEET
_SPACES = dict.fromkeys(map(ord, "\u00a0\u2007\u2009\u202f\u2002\u2003"), " ")
_MINUS = dict.fromkeys(map(ord, "\u2212\u2012\u2013\ufe63\uff0d"), "-")
_NUMBER = re.compile(
    r"(?P<number>[+-]?(?:\d[\d.,' \u2019]*|[.,]\d+)(?:[eE][+-]?\d+)?)"
    r"\s*(?P<unit>[^\d\s.,'+-][^\d.,]*|)"
)
_JOINTS = re.compile(r"[\s_.-]+")
_PLAIN = re.compile(r"[+-]?[0-9]+([.,][0-9]*)?")
#: The exponent as Fortran writes it.
_FORTRAN = re.compile(r"(?<=[\d.,])[dD](?=[+-]?\d+\s*$)")
#: Degrees, minutes and seconds: 12°30'15.5".
_DMS = re.compile(
    r"([+-]?)(\d{1,3})\s*[°dD]\s*(\d{1,2})\s*['′’m]\s*(?:(\d{1,2}(?:[.,]\d+)?)\s*(?:\"|″|”|''|s))?"
)
#: Units of angles that mean degrees to some and gon to others.
GRAD = frozenset(("g", "gr", "grad", "grads"))
#: Thousands: groups of three digits with one kind of separator between them.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}([.,' \u2019])\d{3}(\1\d{3})*(?=$|[eE])")


@dataclass(frozen=True, slots=True)
class NumberText:
    """A text that looks like a number, taken apart but not yet read.

    Parameters
    ----------
    digits : str
        The number with its separators, blanks for thousands already taken out.
    unit : str
        Unit typed behind it, as typed.
    evidence : str
        Which decimal separator the text proves, if any.
    """

    digits: str
    unit: str
    evidence: Evidence

    @property
    def has_thousands(self) -> bool:
        """Whether the text certainly has separators between thousands."""
        return self.digits.count(".") + self.digits.count(",") > 1

    def value(self, decimal: Decimal) -> float | None:
        """Return the number read with a decimal separator; None if it cannot be one."""
        plain_point = self.evidence == decimal == "point" and self.digits.count(".") == 1
        plain_point = plain_point and "," not in self.digits
        if self.evidence == "none" or plain_point:
            return float(self.digits)
        text, mark, opposite = (
            (self.digits, ".", ",") if decimal == "point" else (self.digits, ",", ".")
        )
        mantissa = re.split("[eE]", text)[0]
        whole, _, fraction = mantissa.partition(mark)
        if opposite in fraction or mark in fraction:
            return None
        if opposite in whole and not _GROUPED.match(whole):
            return None
        try:
            return float(text.replace(opposite, "").replace(mark, "."))
        except ValueError:
            return None


def take_apart(text: str) -> NumberText | None:
    r"""Return the parts of a text that looks like a number with or without unit, else None.

    >>> take_apart("−1 250,5 mm")
    NumberText(digits='-1250,5', unit='mm', evidence='comma')
    >>> take_apart("43.00d0").value("point")
    43.0
    >>> take_apart("n/a") is None
    True
    >>> take_apart("12°30'36''")
    NumberText(digits='12.51', unit='°', evidence='point')
    """
    if plain := _PLAIN.fullmatch(text):
        return NumberText(text, "", _evidence(text) if plain[1] else "none")
    clean = _FORTRAN.sub("e", text.translate(_SPACES).translate(_MINUS).strip())
    match = _NUMBER.fullmatch(clean)
    if match is None:
        return _of_degrees(clean)
    digits = match["number"].strip()
    for blank in (" ", "'", "\u2019"):
        if blank in digits:
            whole, mark, rest = re.match(r"([^.,]*)([.,]?)(.*)", digits).groups()  # type: ignore[union-attr]
            if not _GROUPED.match(whole) or blank in rest:
                return None
            digits = whole.replace(blank, "") + mark + rest
    return NumberText(digits, match["unit"].strip(), _evidence(digits))


def _of_degrees(text: str) -> NumberText | None:
    """Return an angle in degrees, minutes and seconds as a number of degrees."""
    match = _DMS.fullmatch(text)
    if match is None:
        return None
    sign, degrees, minutes, seconds = match.groups()
    parts = float(minutes), float((seconds or "0").replace(",", "."))
    if max(parts) >= 60:
        return None
    digits = f"{sign}{float(degrees) + parts[0] / 60 + parts[1] / 3600:.12f}".rstrip("0")
    return NumberText(f"{digits}0" if digits.endswith(".") else digits, "°", "point")


def _evidence(digits: str) -> Evidence:
    """Return which decimal separator a number's text proves, if any."""
    point, comma = digits.count("."), digits.count(",")
    if point and comma:
        return "point" if digits.rfind(".") > digits.rfind(",") else "comma"
    if not point and not comma:
        return "none"
    # 1,250,000 can only be grouped; 1,250 may be either.
    if _GROUPED.match(digits):
        if point + comma > 1:
            return "point" if comma else "comma"
        return "grouped point" if point else "grouped comma"
    return "point" if point else "comma"


def unit_symbol(text: str) -> str:
    """Return the stable symbol of a unit, empty when it is not a known unit.

    >>> unit_symbol("[Pixel]"), unit_symbol("furlong"), unit_symbol("US survey feet")
    ('px', '', 'ftUS')
    """
    word = text.strip(" []().").casefold()
    return UNITS.get(word) or UNITS.get(_JOINTS.sub("", word), "")


def converted(value: float, unit: str, target: str) -> float | None:
    """Return a length in another unit, None where the two do not convert."""
    if unit in METRES and target in METRES:
        return float(f"{value * METRES[unit] / METRES[target]:.15g}")
    return None


def proven_by(texts: Iterable[NumberText]) -> set[Decimal]:
    """Return the decimal separators that texts prove."""
    return {text.evidence for text in texts if text.evidence in ("point", "comma")}


def decimal_of(
    text: NumberText, proven: set[Decimal], *, thousands: bool, elsewhere: set[Decimal]
) -> Decimal | None:
    """Return the decimal separator with which to read a text, None where it stays ambiguous.

    A wrong guess is wrong a thousandfold, so 1,250 is only read when the column, or else the other
    columns of the table, leave one meaning.

    Parameters
    ----------
    text : NumberText
        The text.
    proven, elsewhere : set
        Separators that its own column and the other columns prove.
    thousands : bool
        Whether its column certainly has separators between thousands.
    """
    agreed = next(iter(proven)) if len(proven) == 1 else None
    evidence = text.evidence
    if evidence in ("point", "comma"):
        return evidence
    if evidence == "none":
        return "point"
    mark: Decimal = "comma" if evidence == "grouped comma" else "point"
    if agreed:
        return agreed if agreed == mark or thousands else None
    if elsewhere:
        return mark if elsewhere == {mark} else None
    return "point" if mark == "point" else None


#: A text that may be a number with three decimals or one with thousands.
_THREE_DECIMALS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")


def plain_numbers(texts: Sequence[str]) -> tuple[FloatArray, set[str]] | None:
    """Return numbers (NaN where blank) with what they prove; None if any is not plain.

    The quick road for columns that hold nothing but digits and one decimal mark. What they prove
    is a decimal ``"point"`` or ``"comma"``, or only ``"grouped point"`` / ``"grouped comma"`` where
    each mark may also separate thousands.
    """
    numbers, decimal, mark = _floats(texts, "."), "point", "."
    if numbers is None:
        numbers, decimal, mark = _floats(texts, ","), "comma", ","
    if numbers is None:
        return None
    # Only numbers of three decimals can be mistaken for thousands; look at their texts alone.
    with np.errstate(over="ignore"):
        thousandths = (np.rint(numbers * 1000) / 1000 == numbers) | ~np.isfinite(numbers)
    proven = set() if thousandths.all() else {decimal}
    for index in np.flatnonzero(thousandths).tolist():
        if decimal in proven:
            break
        if mark in texts[index]:
            grouped = _THREE_DECIMALS.fullmatch(texts[index].strip())
            proven.add(f"grouped {decimal}" if grouped else decimal)
    return numbers, proven


def is_clear(proven: Set[str], others: Set[str], decimal: Decimal | None) -> bool:
    """Whether plain numbers have one meaning, given what they and the other columns prove."""
    if not proven:
        return True
    decimal = decimal or ("point" if "point" in proven else "comma" if "comma" in proven else None)
    if decimal is not None:
        return proven <= {decimal, f"grouped {decimal}"}
    return proven == {"grouped point"} and "comma" not in others


class ArrowTexts(Sequence[str]):
    """A column of texts in Arrow's memory, which reads clean numbers without Python objects."""

    def __init__(self, column: Any) -> None:
        self.column = column

    @cached_property
    def texts(self) -> list[str]:
        """Texts as Python knows them."""
        return self.column.to_pylist()

    def __len__(self) -> int:
        return len(self.column)

    def __getitem__(self, index: Any) -> Any:
        return self.texts[index]

    def has(self, text: str) -> bool:
        """Whether any of the texts contains another one."""
        from pyarrow import compute

        return bool(compute.any(compute.match_substring(self.column, text)).as_py())

    def floats(self, mark: str) -> FloatArray | None:
        """Return numbers (NaN where empty), exact to the last bit; None if any is not clean."""
        from pyarrow import ArrowInvalid, compute, scalar

        blank = scalar(None, self.column.type)
        filled = compute.if_else(compute.equal(self.column, ""), blank, self.column)
        try:
            array = compute.cast(compute.replace_substring(filled, mark, "."), "float64")
        except ArrowInvalid:
            return None
        numbers: FloatArray = array.to_numpy(zero_copy_only=False)
        is_clean = (np.abs(numbers) <= LARGEST).sum() == len(array) - array.null_count
        return numbers if is_clean else None


def _floats(texts: Sequence[str], mark: str) -> FloatArray | None:
    """Return numbers with this decimal mark (NaN where blank); None if any is not plain."""
    if isinstance(texts, ArrowTexts):
        # No number with the other mark can be read; Arrow takes long to find out.
        if texts.has("," if mark == "." else "."):
            return None
        numbers = texts.floats(mark)
        if numbers is not None:
            return numbers
        texts = texts.texts
    if mark == ",":
        if any("." in text for text in texts):
            return None
        texts = [text.replace(",", ".") for text in texts]
    blanks = 0
    try:
        array = np.fromiter(map(float, texts), dtype=np.float64, count=len(texts))
    except ValueError:
        filled = [text.strip() or "nan" for text in texts]
        blanks = sum(not text.strip() for text in texts)
        try:
            array = np.fromiter(map(float, filled), dtype=np.float64, count=len(texts))
        except ValueError:
            return None
    # Python also reads "nan", "inf" and "1_000", which no surveyor means as numbers.
    if np.count_nonzero(~(np.abs(array) <= LARGEST)) != blanks or "_" in "".join(texts):
        return None
    return array
