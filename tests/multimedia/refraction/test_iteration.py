"""The papers' own iteration: result, counts, factor, failure."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import InputError, best_over_compensation, iterated_radius
from multimedia.refraction.shift import shift_derivatives, shifted_radius

INDICES = (1.0, 1.5, 1.34)


def scene(z0: float, glass: float, near: float, far: float) -> tuple[np.ndarray, list[object]]:
    rng = np.random.default_rng(20240601)
    radius = np.hypot(*rng.uniform(-300, 300, (2, 2000)))
    return radius, [z0, glass, rng.uniform(near, far, 2000)]


AIR = (500.0, 10.0, 0.0, 200.0)
WATER = (100.0, 10.0, 400.0, 600.0)
HOUSING = (20.0, 8.0, 1000.0, 3000.0)


@pytest.mark.parametrize("setup", [AIR, WATER, HOUSING])
@pytest.mark.parametrize("factor", [1.0, 1.1, None])
def test_iteration_ends_within_its_tolerance(
    setup: tuple[float, float, float, float], factor: float | None
) -> None:
    radius, heights = scene(*setup)
    found = iterated_radius(radius, heights, INDICES, tolerance=1e-7, over_compensation=factor)
    assert found.converged.all()
    np.testing.assert_allclose(
        found.radius_bar, shifted_radius(radius, heights, INDICES), rtol=0, atol=1e-6
    )


def test_first_step_by_hand() -> None:
    # R = 3, 4 above: tan b1 = 3/4 over 2 + 2, sin b1 = 0.6; n = 1.5: sin b2 = 0.4,
    # tan b2 = 0.4 / sqrt(0.84) = 0.436436; reached 1.5 + 0.872872; correction 0.627128.
    found = iterated_radius(3.0, [2.0, 2.0], [1.0, 1.5], tolerance=1e-9, max_iterations=1)
    assert float(found.radius_bar) == pytest.approx(3.627128, abs=1e-6)
    assert found.iterations == 1
    assert not found.converged


def test_equal_media_need_one_look() -> None:
    found = iterated_radius(0.7, [1.0, 2.0], [1.2, 1.2])
    assert (float(found.radius_bar), int(found.iterations)) == (pytest.approx(0.7), 1)


def test_automatic_factor_never_needs_more_than_the_plain_iteration() -> None:
    for setup in (AIR, WATER, HOUSING):
        radius, heights = scene(*setup)
        plain = iterated_radius(radius, heights, INDICES, tolerance=1e-4)
        chosen = iterated_radius(radius, heights, INDICES, tolerance=1e-4, over_compensation=None)
        assert chosen.iterations.mean() < 0.65 * plain.iterations.mean()


def test_automatic_factor_is_near_the_ideal_one() -> None:
    radius, heights = scene(*WATER)
    ideal = shift_derivatives(radius, heights, INDICES).d_radius
    np.testing.assert_allclose(best_over_compensation(radius, heights, INDICES), ideal, rtol=0.15)


def test_the_printed_stop_rule_would_end_at_once_for_a_camera_in_water() -> None:
    # Delta R is negative there: "until Delta R < epsilon" holds after the first look.
    found = iterated_radius(0.1, [1.0, 1.0], [1.337, 1.0], tolerance=1e-9)
    assert found.converged
    assert found.iterations > 5


def test_iteration_that_meets_total_reflection_is_not_converged() -> None:
    # The exact shift exists; the printed iteration starts beyond the critical angle.
    heights, indices = [1.0, 1.0], [1.337, 1.0]
    found = iterated_radius(3.0, heights, indices)
    assert np.isnan(found.radius_bar)
    assert not found.converged
    assert np.isfinite(shifted_radius(3.0, heights, indices))


@pytest.mark.parametrize("options", [{"tolerance": 0.0}, {"over_compensation": -1.0}])
def test_impossible_options_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        iterated_radius(1.0, [1.0, 1.0], [1.0, 1.3], **options)


def test_heights_without_index_are_refused() -> None:
    with pytest.raises(InputError, match="one refractive index per layer"):
        iterated_radius(1.0, [1.0, 1.0], [1.0])
