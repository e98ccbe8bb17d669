"""Tolerance rules of drawings as data: what accuracy a drawing scale asks for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from bifocal.remarks import remark
from photocore.arrays import positive
from photocore.errors import InputError

#: Fewer compared points prove no scale: the RMSE of three is off by 0.41 of itself (one sigma).
FEW = 4
#: Drawing scales a survey is judged against.
SCALES = (10, 20, 50, 100, 200, 500)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToleranceRule:
    """How far a point of a drawing may be wrong.

    Attributes
    ----------
    key, name : str
        Short and full name.
    line_mm : float or None
        Tolerance on the sheet; times the scale number it is the tolerance on the wall. [mm]
    fixed_cm : mapping of int to float
        Tolerance on the wall per scale number, where it is fixed. [cm]
    source : str
        Where the rule comes from.
    """

    key: str
    name: str
    line_mm: float | None = None
    fixed_cm: Mapping[int, float] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        if (self.line_mm is None) == (not self.fixed_cm):
            raise InputError(f"tolerance rule {self.key!r}: give line_mm or fixed_cm, one of them.")
        for value in [self.line_mm] if self.line_mm is not None else self.fixed_cm.values():
            positive(value, f"tolerance rule {self.key!r}")

    def tolerance(self, scale: int) -> float | None:
        """Return the tolerance on the wall at a scale, None where the rule says nothing. [m]"""
        if self.line_mm is not None:
            return self.line_mm * scale / 1000.0
        value = self.fixed_cm.get(scale)
        return None if value is None else value / 100.0


#: Rules that ship with the program; a project may add its own.
RULES: tuple[ToleranceRule, ...] = (
    ToleranceRule(
        key="line-0.18",
        name="0.18 mm",
        line_mm=0.18,
        source="width of a plotted line, as reported for English Heritage (CIPA 2003 Antalya)",
    ),
    ToleranceRule(
        key="print-0.25",
        name="0.25 mm",
        line_mm=0.25,
        source="print rule: 0.25 mm at scale (Pix4D support, article 203576115)",
    ),
    ToleranceRule(
        key="eckstein",
        name="Eckstein III/IV",
        fixed_cm={20: 1.0, 50: 2.5, 100: 10.0},
        source="German building survey, levels of accuracy II-IV (Eckstein 1999)",
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether an accuracy is good enough for one scale under one rule.

    Attributes
    ----------
    rule : ToleranceRule
        The rule.
    scale : int
        Scale number of the drawing.
    tolerance : float
        What the rule allows on the wall. [m]
    holds : bool
        Whether the accuracy is within it.
    """

    rule: ToleranceRule
    scale: int
    tolerance: float
    holds: bool


def judge(accuracy: float, rules: tuple[ToleranceRule, ...] = RULES) -> tuple[Verdict, ...]:
    """Return the verdict on an accuracy [m] for every rule and scale.

    Examples
    --------
    >>> [(v.scale, v.holds) for v in judge(0.008, RULES[:1]) if v.scale in (20, 50)]
    [(20, False), (50, True)]
    """
    return tuple(
        Verdict(rule=rule, scale=scale, tolerance=limit, holds=accuracy <= limit)
        for rule in rules
        for scale in SCALES
        if (limit := rule.tolerance(scale)) is not None
    )


def sentence(verdicts: tuple[Verdict, ...]) -> str:
    """Return one line on verdicts of one rule: the finest scale held and the next that fails.

    Examples
    --------
    >>> sentence(judge(0.008, RULES[:1]))
    '0.18 mm: holds 1:50 (9 mm), fails 1:20 (3.6 mm)'
    """
    parts = []
    held = [verdict for verdict in verdicts if verdict.holds]
    failed = [verdict for verdict in verdicts if not verdict.holds]
    for verb, verdict in (
        ("holds", min(held, key=lambda v: v.scale, default=None)),
        ("fails", max(failed, key=lambda v: v.scale, default=None)),
    ):
        if verdict is not None:
            parts.append(f"{verb} 1:{verdict.scale} ({verdict.tolerance * 1000:g} mm)")
    return f"{verdicts[0].rule.name}: " + ", ".join(parts)


def as_rule(rule: str | ToleranceRule) -> ToleranceRule:
    """Return a rule as it is, a named one, or one made of a number of mm at scale or of fixed cm.

    Examples
    --------
    >>> as_rule("0.2mm").tolerance(50)
    0.01
    >>> as_rule("2 cm").tolerance(50)
    0.02
    """
    if isinstance(rule, ToleranceRule):
        return rule
    text = str(rule)
    for known in RULES:
        if text.strip().casefold() in (known.key, known.name.casefold()):
            return known
    length = re.fullmatch(r"\s*(\d+(?:[.,]\d+)?)\s*(mm|cm)\s*", text, re.IGNORECASE)
    value = float(length[1].replace(",", ".")) if length else 0.0
    if length is None or value <= 0:
        names = ", ".join(known.key for known in RULES)
        raise InputError(remark("survey.no_rule", rule=repr(text), names=names))
    if length[2].lower() == "mm":
        return ToleranceRule(key=text, name=f"{value:g} mm", line_mm=value, source="user")
    return ToleranceRule(
        key=text, name=f"{value:g} cm", fixed_cm=dict.fromkeys(SCALES, value), source="user"
    )
