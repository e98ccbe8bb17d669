"""The sentences `align` prints: directions are named, noise is not, the whole error is."""

import numpy as np
import pytest

from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import at
from bifocal.orientation.alignment import standard_deviations
from bifocal.orientation.orientation_report import orientation_in_words
from tests.bifocal.orientation.layered_wall import camera

SURE = {"distance1": 0.01, "distance2": 0.01, "scale": 1e-5, "relief_scale": 0.0}


def words(far=None, near=None, **deviations: float) -> str:
    cameras = (far or camera(16.0), near or camera(8.0))
    return "\n".join(orientation_in_words(cameras, {**SURE, **deviations}, sigma_px=0.1))


@pytest.mark.parametrize("turn", [(0.04, 0.04, 0.0), (0.1, 0.0, 0.0), (0.0, -0.3, 0.0)])
def test_a_tilt_always_comes_with_its_direction(turn) -> None:
    text = words(near=camera(8.0, turn_deg=turn))
    assert "it looks 0." in text
    assert "looks  (" not in text


def test_a_difference_of_scale_within_its_uncertainty_is_not_mentioned() -> None:
    near = camera(8.0, focal=8.0 / 0.013 * 1.002)
    assert "The scales differ by +0.20 % (would read as 32 mm" in words(near=near)
    assert "scales" not in words(near=near, scale=0.0015)
    assert "scales" not in words()


def test_uncertain_distances_are_part_of_the_precision_of_relief() -> None:
    assert "plus 22 mm for every metre of relief (2.2 %" in words(relief_scale=0.022)
    assert "for every metre" not in words()


def test_relief_scale_is_the_spread_of_relief_under_the_distances_own() -> None:
    covariance = np.zeros((24, 24))
    rows = [at("Z", 1), at("Z", 2)]
    covariance[np.ix_(rows, rows)] = [[0.3**2, 0.2 * 0.3 * 0.05], [0.2 * 0.3 * 0.05, 0.05**2]]
    none = np.zeros(0)
    adjusted = AdjustedPair(
        cameras=(camera(16.0), camera(8.0)), covariance=covariance, sigma0=1.0,
        control_residuals=none, control_test=none, tie_misfit=none, wall_misfit=none,
    )  # fmt: skip
    found = standard_deviations(adjusted)["relief_scale"]
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal([16, 8], covariance[np.ix_(rows, rows)], 200_000)
    spread = np.std(1 / (1 / drawn[:, 1] - 1 / drawn[:, 0])) / 16.0
    assert found == pytest.approx(spread, rel=0.02)


def test_small_turns_have_the_digits_that_show_their_greater_part() -> None:
    assert "0.3" in words(near=camera(8.0, turn_deg=(0.0, -0.3, 0.0)))
    assert "0.30" not in words(near=camera(8.0, turn_deg=(0.0, -0.3, 0.0)))
    assert "0.15" in words(near=camera(8.0, turn_deg=(0.0, -0.15, 0.0)))
