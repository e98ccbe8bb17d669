"""From what a user typed to the options of `bifocal solve`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bifocal.survey.tolerances import RULES, SCALES, ToleranceRule
from bifocal.survey.workbook.reader import ReadOptions, point_columns
from bifocal.survey.workflow import SolveOptions
from photocore.errors import InputError
from photocore.tables import parse_column_map


def solve_options(
    *,
    columns: str | None = None,
    sheet: str | None = None,
    decimal: Any = None,
    visible_only: bool = False,
    pair: Path | None = None,
    sigma_px: float | None = None,
    adjust_setup: bool = False,
    model: str | None = None,
    scale_tolerance: float,
    rules: Sequence[str] = (),
    **setup: Any,
) -> SolveOptions:
    """Return checked options; ``setup`` are values in place of those of the sheet `Setup`.

    Raises
    ------
    InputError
        If an option's value cannot be used.
    """
    given = {key: value for key, value in setup.items() if value is not None}
    for name, value in (
        *given.items(),
        ("sigma_px", sigma_px),
        ("scale_tolerance", scale_tolerance),
    ):
        if isinstance(value, float) and not value > 0:
            option = f"--{name.replace('_', '-')}"
            raise InputError(f"{option}: must be a number above zero, got {value:g}.")
    keys = [column.key for column in point_columns()]
    return SolveOptions(
        read=ReadOptions(
            columns=parse_column_map(columns, keys) if columns else {},
            sheet=sheet,
            decimal=decimal,
            visible_only=visible_only,
        ),
        pair=pair,
        setup=given,
        sigma_px=sigma_px,
        adjust_setup=adjust_setup,
        model=model,
        scale_tolerance=scale_tolerance,
        rules=tuple(tolerance_rule(text) for text in rules) or RULES,
    )


def tolerance_rule(text: str) -> ToleranceRule:
    """Return a named rule, or one made of a number of mm at scale or of fixed cm.

    Examples
    --------
    >>> tolerance_rule("0.2mm").tolerance(50)
    0.01
    >>> tolerance_rule("2 cm").tolerance(50)
    0.02
    """
    for rule in RULES:
        if text.strip().casefold() in (rule.key, rule.name.casefold()):
            return rule
    found = re.fullmatch(r"\s*(\d+(?:[.,]\d+)?)\s*(mm|cm)\s*", text, re.IGNORECASE)
    value = float(found[1].replace(",", ".")) if found else 0.0
    if found is None or value <= 0:
        names = ", ".join(rule.key for rule in RULES)
        raise InputError(
            f"--tolerance-rule: {text!r} is none of {names}, nor a length like 0.2mm (at drawing "
            "scale) or 2cm (on the wall)."
        )
    if found[2].lower() == "mm":
        return ToleranceRule(key=text, name=f"{value:g} mm", line_mm=value, source="user")
    return ToleranceRule(
        key=text, name=f"{value:g} cm", fixed_cm=dict.fromkeys(SCALES, value), source="user"
    )
