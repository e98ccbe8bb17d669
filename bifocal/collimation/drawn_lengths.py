"""Lengths drawn on the page that check the scale: what the pair makes of them."""

from __future__ import annotations

import numpy as np

from bifocal.collimation.records import GIVES_SCALE, ScaleLength, SurveyState
from bifocal.model import LengthCheck, Pair, length_check
from bifocal.orientation import SiteMeasures
from photocore.errors import GeometryError
from photocore.jsonfile import plain


def check_lengths(state: SurveyState, pair: Pair) -> dict[str, LengthCheck]:
    """Return how taped lengths agree with a pair, by their names."""
    checks = {}
    for name, drawn in _checking(state).items():
        sigma = drawn.sigma or SiteMeasures().sigma_control
        try:
            checks[name] = length_check(
                pair, drawn.image, np.array(drawn.ends), drawn.length, sigma=sigma
            )
        except GeometryError:  # a picture so oblique that both ends fall together
            continue
    return checks


def lengths_shown(state: SurveyState, pair: Pair | None) -> list[dict[str, object]]:
    """Return the checking lengths as the page shows them; without a pair as drawn alone."""
    checks = {} if pair is None else check_lengths(state, pair)
    shown = []
    for name, drawn in _checking(state).items():
        entry: dict[str, object] = {
            "name": name, "image": drawn.image, "ends": drawn.ends, "length": drawn.length,
            "sigma": drawn.sigma,
        }  # fmt: skip
        if check := checks.get(name):
            entry |= {
                "measured": check.measured, "difference": check.difference,
                "sigma_difference": check.sigma, "agrees": check.agrees,
            }  # fmt: skip
        shown.append(plain(entry))
    return shown


def _checking(state: SurveyState) -> dict[str, ScaleLength]:
    return {name: one for name, one in state.scale.items() if name != GIVES_SCALE}
