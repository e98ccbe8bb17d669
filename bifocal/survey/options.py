"""From what a user typed to the options of `bifocal solve`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bifocal.model.pair import Pair
from bifocal.survey.tolerances import RULES, SCALES, ToleranceRule
from bifocal.survey.workbook.reader import ReadOptions, point_columns
from photocore.errors import InputError
from photocore.tables import parse_column_map


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveOptions:
    """What the user may choose.

    Attributes
    ----------
    read : ReadOptions
        How to read the table.
    pair : Pair, Path or None
        Pair or pair file, for raw pixels.
    setup : mapping
        Values in place of those of `Setup`: ``d1 d2 c1 c2 pitch sigma_s sigma_r_max unit``.
    sigma_px : float or None
        Measuring precision of raw pixels; default the pair's, else found from the misfits. [px]
    adjust_setup : bool
        Correct the orientation by points of the reference plane.
    model : str or None
        Georeference model in place of the workbook's.
    scale_tolerance : float
        Share by which the scales of both photos may differ.
    rules : tuple of ToleranceRule
        For the verdict.
    """

    read: ReadOptions
    pair: Pair | Path | None
    setup: Mapping[str, Any]
    sigma_px: float | None
    adjust_setup: bool
    model: str | None
    scale_tolerance: float
    rules: tuple[ToleranceRule, ...]


def solve_options(
    *,
    pair: Pair | Path | str | None,
    setup: Mapping[str, Any],
    sigma_px: float | None,
    scale_tolerance: float,
    rules: Sequence[str | ToleranceRule],
    columns: str | None,
    sheet: str | None,
    decimal: Any,
    visible_only: bool,
    **more: Any,
) -> SolveOptions:
    """Return checked options; see `bifocal.survey.workflow.solve`.

    Raises
    ------
    InputError
        If an option's value cannot be used.
    """
    given = {key: value for key, value in setup.items() if value is not None}
    checked = {**given, "sigma_px": sigma_px, "scale_tolerance": scale_tolerance}
    for name, value in checked.items():
        if isinstance(value, float | int) and not value > 0:
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
        pair=Path(pair) if isinstance(pair, str) else pair,
        setup=given,
        sigma_px=sigma_px,
        scale_tolerance=scale_tolerance,
        rules=tuple(
            rule if isinstance(rule, ToleranceRule) else tolerance_rule(rule) for rule in rules
        )
        or RULES,
        **more,
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
    length = re.fullmatch(r"\s*(\d+(?:[.,]\d+)?)\s*(mm|cm)\s*", text, re.IGNORECASE)
    value = float(length[1].replace(",", ".")) if length else 0.0
    if length is None or value <= 0:
        names = ", ".join(rule.key for rule in RULES)
        raise InputError(
            f"--tolerance-rule: {text!r} is none of {names}, nor a length like 0.2mm (at drawing "
            "scale) or 2cm (on the wall)."
        )
    if length[2].lower() == "mm":
        return ToleranceRule(key=text, name=f"{value:g} mm", line_mm=value, source="user")
    return ToleranceRule(
        key=text, name=f"{value:g} cm", fixed_cm=dict.fromkeys(SCALES, value), source="user"
    )
