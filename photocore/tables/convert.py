"""From the cells of one column to an array: every bad cell is named, none stops the others."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import LARGEST
from photocore.remarks import remark
from photocore.tables.advice import advice
from photocore.tables.model import Column
from photocore.tables.numbers import (
    GRAD,
    Decimal,
    NumberText,
    converted,
    decimal_of,
    proven_by,
    take_apart,
    unit_symbol,
)
from photocore.workbook import CellDate, CellFault, NamedNumber, NotCalculated, Value

Complain = Callable[[int, str], None]

#: What every complaint about a formula without a stored result begins with.
NOT_CALCULATED = "its formula has never been calculated"
_YES = {"1", "yes", "y", "true", "x", "on", "si", "sì", "s", "vero", "ja", "j", "wahr"}
_NO = {"0", "no", "n", "false", "off", "falso", "nein", "falsch"}


def decimal_evidence(values: Iterable[Value | None]) -> set[Decimal]:
    """Return the decimal separators that the texts of a column prove."""
    parts = (take_apart(value) for value in values if isinstance(value, str))
    return proven_by(part for part in parts if part is not None)


def numbers(
    column: Column,
    values: Sequence[Value | None],
    *,
    unit: str,
    decimal: Decimal | None,
    elsewhere: set[Decimal],
    complain: Complain,
) -> tuple[FloatArray, str, list[str]]:
    """Return a column's numbers (NaN where blank), the unit its cells say, and remarks.

    Parameters
    ----------
    column : Column
        What is expected.
    values : sequence
        Cell values, None where blank.
    unit : str
        Unit that the heading says, empty if none.
    decimal : {"point", "comma"}, optional
        Decimal separator of texts as the user says; detected when None.
    elsewhere : set
        Separators that the other columns of the table prove, for a column that proves none.
    complain : callable
        Takes the index of a bad cell and what is wrong with it.
    """
    result = np.full(len(values), np.nan)
    texts: dict[int, NumberText] = {}
    unfinished: list[int] = []
    target = unit or column.unit
    # What has a unit was measured; other columns of foreign tables hold what they like.
    largest = LARGEST if target else sys.float_info.max
    for index, value in enumerate(values):
        if isinstance(value, float):
            result[index] = value
            if not abs(value) <= largest:
                complain(index, f"found {value}, expected a finite number up to {largest:g}.")
        elif value is None:
            continue
        elif isinstance(value, str):
            part = take_apart(value)
            if part is not None:
                texts[index] = part
            elif value.strip():
                complain(index, _not_a_number(value, target))
        elif isinstance(value, NotCalculated):
            unfinished.append(index)
        else:
            complain(index, _wrong_type(value, target))
    if unfinished:
        more = f" (and {len(unfinished) - 1} more in this column)" if len(unfinished) > 1 else ""
        complain(unfinished[0], _not_calculated(more))
    common_unit = _typed_unit(texts, target, complain, has_bare=bool(np.isfinite(result).any()))
    _read_texts(result, texts, decimal, elsewhere, complain, largest)
    typed = sum(bool(part.unit) for part in texts.values())
    written: list[str] = (
        [remark("table.unit_taken_off", column=column.key, count=typed)] if typed else []
    )
    if column.kind == "integer":
        for broken in np.flatnonzero(np.isfinite(result) & (result != np.floor(result))):
            complain(int(broken), f"found {result[broken]:.15g}, expected a whole number.")
    return result, common_unit or unit, written


def flags(values: Sequence[Value | None], complain: Complain) -> FloatArray:
    """Return 1 for yes, 0 for no, NaN where blank."""
    result = np.full(len(values), np.nan)
    for index, value in enumerate(values):
        if value is None or (isinstance(value, str) and not value.strip()):
            continue
        word = f"{value:.15g}" if isinstance(value, float) else str(value).strip().casefold()
        if word in _YES | _NO:
            result[index] = float(word in _YES)
        elif isinstance(value, float | str):
            complain(index, f'found "{_short(str(value))}", expected 1 (yes) or 0 (no).')
        else:
            complain(index, _wrong_type(value, ""))
    return result


def texts(values: Sequence[Value | None], complain: Complain) -> list[str]:
    """Return a column's texts; whole numbers lose the decimal point, so that 1.0 is ``"1"``."""
    if {*map(type, values)} == {str}:
        return [*map(str.strip, values)]  # type: ignore[arg-type]
    result = []
    for index, value in enumerate(values):
        text = ""
        if isinstance(value, NamedNumber):
            text = value.shown
        elif isinstance(value, float):
            text = str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
        elif isinstance(value, str):
            text = value.strip()
        elif isinstance(value, bool):
            text = "TRUE" if value else "FALSE"
        elif isinstance(value, CellDate):
            text = value.shown
        elif isinstance(value, CellFault | NotCalculated):
            complain(index, _wrong_type(value, ""))
        result.append(text)
    return result


def _read_texts(
    result: FloatArray,
    parts: dict[int, NumberText],
    decimal: Decimal | None,
    elsewhere: set[Decimal],
    complain: Complain,
    largest: float,
) -> None:
    """Fill in the numbers that were typed as text, with one decimal separator for the column."""
    proven = proven_by(parts.values())
    thousands = any(part.has_thousands for part in parts.values())
    commas = sum(part.evidence == "comma" for part in parts.values())
    points = sum(part.evidence == "point" for part in parts.values())
    usual: Decimal = "comma" if commas > points else "point"
    for index, part in parts.items():
        mark = decimal or decimal_of(part, proven, thousands=thousands, elsewhere=elsewhere)
        if mark is None:
            small, large = sorted((part.value("comma") or 0, part.value("point") or 0), key=abs)
            about = {"found": part.digits, "small": small, "large": large}
            how = advice("meaning", "--decimal", small=f"{small:.15g}", large=f"{large:.15g}")
            complain(index, f"{remark('table.two_meanings', **about)} {how}")
            continue
        value = part.value(mark)
        mixed = decimal is None and len(proven) == 2 and mark != usual and part.evidence != "none"
        if value is None or mixed:
            complain(index, _mixed(part, decimal or usual))
        elif not abs(value) <= largest:
            shown = _short(part.digits)
            complain(index, f'found "{shown}", which is too large; the limit is {largest:g}.')
        else:
            result[index] = value


def _typed_unit(
    parts: dict[int, NumberText], target: str, complain: Complain, *, has_bare: bool
) -> str:
    """Check the units typed into cells; return the one all have where the heading says none.

    Bad cells are taken out of ``parts``. ``has_bare`` tells that the column holds numbers besides:
    the unit of one cell says nothing about them.
    """
    symbols = {index: unit_symbol(part.unit) for index, part in parts.items() if part.unit}
    if not symbols:
        return ""
    if not target and "" not in symbols.values():
        has_bare |= len(symbols) < len(parts)
        if len(set(symbols.values())) == 1 and not has_bare:
            return next(iter(symbols.values()))
        common, count = Counter(symbols.values()).most_common(1)[0]
        if has_bare or 2 * count <= len(symbols):
            complain(min(symbols), _unlike_units(parts, symbols, has_bare=has_bare))
            for index in symbols:
                del parts[index]
            return ""
        _typed_unit(parts, common, complain, has_bare=False)
        return common
    for index, symbol in symbols.items():
        part = parts[index]
        if symbol and symbol == target:
            continue
        shown = f"{part.digits} {part.unit}"
        if part.unit.casefold() in GRAD and target in ("deg", "gon", "rad"):
            complain(index, remark("table.which_grad", found=_short(shown)))
            del parts[index]
            continue
        value = part.value("comma" if "," in part.digits else "point")
        number = converted(value, symbol, target) if value is not None and symbol else value
        advice = f"Write {number:.15g}; the" if number is not None else "The"
        complain(
            index,
            f'found "{_short(shown)}", expected a number{target and f" in {target}"}. '
            f"{advice} unit belongs in the heading.",
        )
        del parts[index]
    return ""


def _unlike_units(parts: dict[int, NumberText], symbols: dict[int, str], *, has_bare: bool) -> str:
    """Return the complaint about a column of unknown unit whose cells do not all say the same."""
    first = parts[min(symbols)]
    shown = f'found "{_short(f"{first.digits} {first.unit}")}"'
    if len(symbols) > 1:
        shown += f" (and {len(symbols) - 1} more with a unit in this column)"
    others = sorted({*symbols.values()} - {symbols[min(symbols)]})
    while_ = f"other cells say {', '.join(others)}" if others else "other cells say no unit"
    if others and has_bare:
        while_ += " or none"
    return f"{shown}, while {while_}. Type all numbers in one unit and write it into the heading."


def _mixed(part: NumberText, agreed: Decimal) -> str:
    opposite: Decimal = "point" if agreed == "comma" else "comma"
    value = part.value(opposite)
    if value is None:
        return f'found "{_short(part.digits)}", expected a number.'
    better = f"{value:.15g}".replace(".", "," if agreed == "comma" else ".")
    words = remark("table.other_decimal", found=_short(part.digits), agreed=agreed)
    return f"{words} {advice('mixed', '--decimal', better=better, other=opposite)}"


def _not_a_number(text: str, unit: str) -> str:
    expected = f"expected a number{unit and f' in {unit}'}"
    if text.strip().casefold() in ("nan", "inf", "-inf", "n/a", "na", "-", "none", "null"):
        return f'found "{_short(text)}", {expected}. Leave the cell empty where there is none.'
    return f'found "{_short(text)}", {expected}. Type the number, or clear the cell.'


def _not_calculated(more: str = "") -> str:
    advice = "Open the file in the spreadsheet program, save it there, and try again."
    return f"{NOT_CALCULATED}{more}. {advice}"


def _wrong_type(value: Value, unit: str) -> str:
    expected = f"expected a number{unit and f' in {unit}'}"
    if isinstance(value, CellFault):
        return f"holds the error {value.text}. Mend its formula, or clear the cell."
    if isinstance(value, NotCalculated):
        return _not_calculated()
    if isinstance(value, CellDate):
        number = " or ".join(_before_the_date(value))
        if not number:
            return (
                f"holds a time of day, {expected}. Format the cell as a number and type it again."
            )
        return remark("table.holds_date", date=value.shown, expected=expected, number=number)
    return f"holds {str(value).upper()}, {expected}."


def _before_the_date(value: CellDate) -> Iterator[str]:
    """Yield the numbers that were probably typed before the spreadsheet made a date of them."""
    style = value.style.lower()
    if "h" in style and "d" not in style:
        return
    if style and "d" not in style:
        # "1.25" cannot be a day and a month, so it became January 2025, shown as Jan-25.
        yield f"{value.when.month}.{value.when:%y}"
    else:
        yield f"{value.when.day}.{value.when.month}"


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 40 else f"{text[:37]}..."
