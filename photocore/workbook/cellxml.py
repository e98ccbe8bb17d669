"""Cells as XML text: numbers that read back to the last bit, text that stays text."""

from __future__ import annotations

import math
import re

import numpy as np

from photocore.errors import InputError

#: Most characters of a cell; Excel cuts or repairs longer ones.
LONGEST_TEXT = 32767

#: What a cell can be given. NaN stands for "no result" and is shown as #N/A.
CellInput = float | int | str | bool | None

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\ufffe\uffff\ud800-\udfff]|_(?=x[0-9A-Fa-f]{4}_)")
_MARKUP = re.compile(r"[&<>]")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def escape(text: str) -> str:
    """Return text for an XML element; characters XML cannot hold become ``_xHHHH_``."""
    if _CONTROL.search(text):
        text = _CONTROL.sub(lambda match: f"_x{ord(match[0]):04X}_", text)
    if _MARKUP.search(text):
        text = _MARKUP.sub(lambda match: _ENTITIES[match[0]], text)
    return text


def escape_attribute(text: str) -> str:
    """Return text for an XML attribute in double quotes."""
    plain = text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return plain.replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")


def number_text(value: float) -> str:
    """Return a finite number that reads back to the last bit.

    >>> number_text(5.0), number_text(0.1)
    ('5', '0.1')
    """
    return repr(value).removesuffix(".0")


def type_and_content(value: CellInput, prefix: str, *, formula: bool) -> tuple[str, str]:
    """Return a cell's ``t`` attribute (empty for numbers) and the XML of its value.

    Parameters
    ----------
    value : float, int, str, bool or None
        NaN becomes the error value #N/A, None no value.
    prefix : str
        Namespace prefix of the sheet with its colon, empty if it has none.
    formula : bool
        Whether the value is the result of a formula (its text is stored in another way).

    Raises
    ------
    InputError
        If a number is infinite or a text is longer than a cell can hold.
    """
    v = f"{prefix}v"
    if value is None:
        return "", ""
    if isinstance(value, bool | np.bool_):
        return "b", f"<{v}>{int(value)}</{v}>"
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            raise InputError(
                f"the text {value[:20]!r}... has {len(value)} characters, more than the "
                f"{LONGEST_TEXT} a cell can hold."
            )
        if formula:
            return "str", f"<{v}>{escape(value)}</{v}>"
        t, inline = f"{prefix}t", f"{prefix}is"
        return "inlineStr", f'<{inline}><{t} xml:space="preserve">{escape(value)}</{t}></{inline}>'
    number = float(value)
    if math.isnan(number):
        return "e", f"<{v}>#N/A</{v}>"
    if math.isinf(number):
        raise InputError("an infinite number cannot be written to a cell.")
    return "", f"<{v}>{number_text(number)}</{v}>"


def cell_xml(
    reference: str,
    value: CellInput,
    *,
    prefix: str = "",
    style: str = "",
    formula: str | None = None,
) -> str:
    """Return the XML of a new cell.

    Parameters
    ----------
    reference : str
        Its name, e.g. ``"B3"``.
    value : float, int, str, bool or None
        Its value, or the cached result of its formula.
    prefix : str
        Namespace prefix of the sheet with its colon, e.g. ``"x:"``.
    style : str
        Index of its cell format as text, empty for the default.
    formula : str, optional
        Formula without the equals sign, English names, comma as separator.

    >>> cell_xml("B3", 1.5, style="2", formula="A3*3")
    '<c r="B3" s="2"><f>A3*3</f><v>1.5</v></c>'
    """
    kind, content = type_and_content(value, prefix, formula=formula is not None)
    attributes = f' r="{reference}"' + (f' s="{style}"' if style else "")
    attributes += f' t="{kind}"' if kind else ""
    if formula is not None:
        content = f"<{prefix}f>{escape(formula)}</{prefix}f>{content}"
    if not content:
        return f"<{prefix}c{attributes}/>"
    return f"<{prefix}c{attributes}>{content}</{prefix}c>"
