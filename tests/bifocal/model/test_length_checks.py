"""Lengths taped on site beside those of a pair, and how sure their difference is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import SAMPLE, GeometryError, Pair
from bifocal.model.length_checks import LengthCheck, agreement, length_check, length_on_wall
from bifocal.model.orientation_precision import NAMES
from bifocal.orientation.rescaling import scaled_by_length

ENDS = np.array([[300.0, 250.0], [1200.0, 700.0]])


def oriented(sigma_distance: float) -> Pair:
    """The sample's pair, its far distance known to a sigma alone. [m]"""
    covariance = np.zeros((len(NAMES), len(NAMES)))
    covariance[NAMES.index("Z 1"), NAMES.index("Z 1")] = sigma_distance**2
    return replace(Pair.read(SAMPLE / "facade.pair.json"), orientation=covariance)


@pytest.mark.parametrize("number", [1, 2])
def test_a_length_is_that_between_both_places_on_the_wall(number: int) -> None:
    pair = oriented(0.0)
    places = pair.photo(number).plane_from_pixels(ENDS)
    check = length_check(pair, number, ENDS, 3.0, sigma=0.003)
    assert check.measured == pytest.approx(np.hypot(*(places[1] - places[0])), rel=1e-12)
    assert check.difference == check.measured - 3.0
    # Two clicks of a pixel each, and the tape.
    aside = ENDS + np.array([[1.0, 0.0], [0.0, 0.0]])
    apart = np.linalg.norm(pair.photo(number).plane_from_pixels(aside) - places)
    assert check.sigma == pytest.approx(np.hypot(np.sqrt(2) * apart, 0.003), rel=0.01)


def test_what_the_orientation_is_unsure_of_is_in_the_sigma() -> None:
    """A camera's distance moves a length of its own photo as it moves all others of it."""
    measured, by_orientation, _ = length_on_wall(oriented(0.0), 1, ENDS)
    assert by_orientation[NAMES.index("Z 1")] == pytest.approx(1 / oriented(0.0).d1, rel=0.01)
    sure, unsure = (length_check(oriented(s), 1, ENDS, measured, sigma=0.003) for s in (0.0, 0.35))
    assert np.sqrt(unsure.sigma**2 - sure.sigma**2) == pytest.approx(
        measured * 0.35 / oriented(0.0).d1, rel=0.01
    )


def test_the_length_that_gave_the_scale_agrees_and_a_wrong_one_does_not() -> None:
    pair = scaled_by_length(oriented(0.02), 1, ENDS, 7.0, sigma=0.003)
    assert length_check(pair, 1, ENDS, 7.0, sigma=0.003).difference == pytest.approx(0, abs=1e-12)
    assert length_check(pair, 1, ENDS, 7.01, sigma=0.003).agrees
    assert not length_check(pair, 1, ENDS, 7.3, sigma=0.003).agrees


def test_a_pair_without_covariance_is_taken_as_exact() -> None:
    typed, exact = (
        length_check(pair, 1, ENDS, 7.0, sigma=0.003)
        for pair in (replace(oriented(0), orientation=None), oriented(0.0))
    )
    assert typed == exact


def test_ends_that_fall_together_are_refused() -> None:
    with pytest.raises(GeometryError, match="coincide"):
        length_check(oriented(0), 1, ENDS[[0, 0]], 1.0, sigma=0.003)


def test_agreement_counts_and_names_the_largest_difference() -> None:
    checks = [LengthCheck(taped=1, measured=m, sigma=0.01) for m in (1.002, 0.98, 1.2)]
    assert agreement(checks) == pytest.approx({"agree": 2, "count": 3, "most": 200.0})
