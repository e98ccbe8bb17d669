"""The radial shift against 50 digits, limits, invariance, ray geometry, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from multimedia import (
    GeometryError,
    InputError,
    Layers,
    radial_shift,
    radial_shift_derivatives,
    radial_shift_ratio,
)
from multimedia.refraction.shift import shift_derivatives, shift_ratio, shifted_radius
from tests.rounding import EPS
from tests.tables import each

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "golden" / "radial_shift.json").read_text(encoding="utf-8")
)
TANK = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))

indices = st.lists(
    st.one_of(st.floats(1.0, 2.0), st.sampled_from([1.0, 1.0003, 1.337, 1.5])),
    min_size=2,
    max_size=5,
)


def relative_error(value: float, digits: str) -> float:
    with mp.workdps(50):
        truth = mp.mpf(digits)
        return float(abs(mp.mpf(float(value)) - truth) / abs(truth)) if truth else abs(value)


@each("case", GOLDEN, ids=lambda case: f"{case['name']}, R={case['radius']:g}")
def test_shift_equals_fifty_digits(case: dict[str, Any]) -> None:
    value = shifted_radius(case["radius"], case["heights"], case["indices"])
    if case["radius_bar"] is None:
        assert np.isnan(value)
    else:
        assert relative_error(float(value), case["radius_bar"]) <= 8 * EPS


@pytest.mark.parametrize(
    ("radius", "heights", "indices", "digits"),
    [
        (792.8031188221366, [6.463068387908665e-08, 717.1471617700691],
         [1.297791886352206, 1.7499755231406378], "7047153.17571120995104"),
        (1445.769535524978, [4.762620572760927e-06, 687.689091503706],
         [1.5664012663078761, 1.7345718941107], "640804.924148501881130"),
        (0.1758208247674193, [3.1652054571859194e-07, 0.06457677622800193, 0.06056637343937393],
         [1.1308448538163847, 1.3458967453152002, 1.4478061329250513], "11.836165469981758035"),
    ],
)  # fmt: skip
def test_a_gap_beyond_the_critical_angle_keeps_all_digits(
    radius: float, heights: list[float], indices: list[float], digits: str
) -> None:
    # By tests/golden/make_radial_shift.py; float64 alone is wrong by up to 3e-11 here.
    assert relative_error(float(shifted_radius(radius, heights, indices)), digits) <= 8 * EPS


@each(
    "case",
    [case for case in GOLDEN if "d_radius" in case],
    ids=lambda case: f"{case['name']}, R={case['radius']:g}",
)
def test_derivatives_equal_fifty_digit_differences(case: dict[str, Any]) -> None:
    found = shift_derivatives(case["radius"], case["heights"], case["indices"])
    assert relative_error(float(found.d_radius), case["d_radius"]) <= 1e-13
    for name in ("d_heights", "d_indices"):
        for value, digits in zip(getattr(found, name), case[name], strict=True):
            assert relative_error(float(value), digits) <= 1e-13


def test_golden_file_holds_every_kind_of_set_up() -> None:
    assert len(GOLDEN) > 300
    assert sum(case["radius_bar"] is None for case in GOLDEN) == 4


@given(
    indices=indices,
    logs=st.lists(st.floats(-4, 3), min_size=5, max_size=5),
    ratio=st.floats(-6, 2),
)
@settings(max_examples=200, deadline=None)
def test_the_ray_to_the_shifted_point_meets_the_point(
    indices: list[float], logs: list[float], ratio: float
) -> None:
    # Forward: the angle the shifted point asks for, refracted by Snell, must come out at R.
    heights = [10**log for log in logs[: len(indices)]]
    radius = sum(heights) * 10**ratio
    bar = shifted_radius(radius, heights, indices)
    with mp.workdps(40):
        total = sum(map(mp.mpf, heights))
        sine = mp.mpf(float(bar)) / mp.sqrt(mp.mpf(float(bar)) ** 2 + total**2)
        out, slope = mp.mpf(0), mp.mpf(0)
        for height, index in zip(heights, indices, strict=True):
            inner = mp.mpf(indices[0]) * sine / mp.mpf(index)
            if inner >= 1:  # the last digit of R bar decides about total reflection
                return
            out += mp.mpf(height) * inner / mp.sqrt(1 - inner**2)
            slope += mp.mpf(height) / mp.mpf(index) / mp.sqrt(1 - inner**2) ** 3
        first = total / indices[0] / mp.sqrt(1 - sine**2) ** 3
        # miss in R, carried over to R bar
        assert abs(out - radius) * first / slope <= 8 * EPS * float(bar)


@given(indices=indices, ratio=st.floats(0, 30))
@settings(max_examples=100, deadline=None)
def test_derivative_with_respect_to_radius_is_positive_and_finite(
    indices: list[float], ratio: float
) -> None:
    heights = np.linspace(1.0, 2.0, len(indices))
    found = shift_derivatives(ratio, list(heights), indices)
    assert np.isfinite(found.d_radius)
    assert found.d_radius > 0


@given(indices=indices, ratio=st.floats(0.01, 30), scale=st.sampled_from([1e-3, 0.3048, 1e3]))
@settings(max_examples=100, deadline=None)
def test_shift_does_not_depend_on_the_unit(
    indices: list[float], ratio: float, scale: float
) -> None:
    heights = np.linspace(1.0, 2.0, len(indices))
    bar = shifted_radius(ratio, list(heights), indices)
    scaled = shifted_radius(ratio * scale, list(heights * scale), indices)
    assert scaled == pytest.approx(float(bar) * scale, rel=1e-14)


def test_two_layers_of_one_medium_are_one_layer() -> None:
    together = shifted_radius(0.7, [0.5, 0.01, 0.4], [1.0, 1.5, 1.337])
    apart = shifted_radius(0.7, [0.5, 0.004, 0.006, 0.1, 0.3], [1.0, 1.5, 1.5, 1.337, 1.337])
    assert apart == pytest.approx(float(together), rel=8 * EPS)


def test_order_of_the_media_does_not_matter_but_for_the_first() -> None:
    one = shifted_radius(0.7, [0.5, 0.01, 0.02, 0.4], [1.0, 1.5, 1.2, 1.337])
    other = shifted_radius(0.7, [0.5, 0.4, 0.01, 0.02], [1.0, 1.337, 1.5, 1.2])
    assert one == pytest.approx(float(other), rel=8 * EPS)


def test_equal_indices_shift_nothing() -> None:
    radius = np.linspace(0, 100, 50)
    np.testing.assert_allclose(
        shifted_radius(radius, [1.0, 0.1, 2.0], [1.337] * 3), radius, rtol=4 * EPS, atol=0
    )


def test_a_point_on_the_interface_is_not_shifted() -> None:
    assert radial_shift(3.0, z0=5.0, zp=0.0, layers=Layers(indices=(1.0, 1.337))) == 3.0


def test_the_axis_ratio_is_the_closed_limit() -> None:
    ratio = radial_shift_ratio([0.0, 1e-200, 1e-9], z0=500.0, zp=200.0, layers=TANK)
    np.testing.assert_allclose(ratio, 710 / (500 + 10 / 1.5 + 200 / 1.34), rtol=4 * EPS)


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
def test_the_ratio_is_continuous_towards_the_axis_in_any_unit(scale: float) -> None:
    heights = [0.001 * scale, 1.0 * scale]
    ratios = shift_ratio(np.logspace(-14, 1, 40) * scale, heights, [1.0, 1.34])
    exact = shift_ratio(np.logspace(-14, 1, 40), [0.001, 1.0], [1.0, 1.34])
    np.testing.assert_allclose(ratios, exact, rtol=8 * EPS)
    assert (np.diff(ratios) >= -4 * EPS).all()


def test_ratio_of_a_camera_that_touches_the_point_is_one() -> None:
    assert shift_ratio(0.0, [0.0, 0.0], [1.0, 1.337]) == 1.0


def test_camera_on_the_glass_sees_no_farther_than_the_critical_angle() -> None:
    # z0 = 0: a diver's window seen from inside; grazing light enters at asin(1 / 1.337).
    layers = Layers(indices=(1.0, 1.337))
    limit = 1.0 / np.sqrt(1.337**2 - 1)
    seen = radial_shift([0.999 * limit, 1.001 * limit], z0=0.0, zp=1.0, layers=layers)
    assert np.isfinite(seen[0])
    assert np.isnan(seen[1])


def test_an_absent_thin_layer_among_present_ones_does_not_limit() -> None:
    # Seen from the water, points at the air side of the glass (zp = 0) and in the air (zp > 0).
    layers = Layers(indices=(1.337, 1.5, 1.0), thicknesses=(0.01,))
    mixed = radial_shift(0.5, z0=0.2, zp=[0.0, 0.3, 0.0], layers=layers)
    alone = [float(radial_shift(0.5, z0=0.2, zp=zp, layers=layers)) for zp in (0.0, 0.3, 0.0)]
    np.testing.assert_array_equal(mixed, alone)
    found = radial_shift_derivatives(0.5, z0=0.2, zp=[0.0, 0.3], layers=layers)
    assert np.isfinite(found.d_radius).all()
    assert np.isfinite(found.d_indices).all()


def test_shift_is_outwards_when_the_camera_is_in_the_thinner_medium() -> None:
    # Maas 2015: delta R > 0 if n2 > n1 and n3 > n1; and inwards the other way round.
    radius = np.linspace(1, 400, 20)
    assert (radial_shift(radius, z0=500.0, zp=200.0, layers=TANK) > radius).all()
    back = Layers(indices=(1.34, 1.5, 1.0), thicknesses=(10.0,))
    assert (radial_shift(radius, z0=500.0, zp=200.0, layers=back) < radius).all()


def test_any_shape_broadcasts_and_scalars_equal_arrays_of_one() -> None:
    radius, depth = np.linspace(0, 300, 7)[:, None], np.linspace(0, 200, 5)
    grid = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    assert grid.shape == (7, 5)
    for i, j in ((0, 0), (3, 4), (6, 2)):
        one = radial_shift(radius[i, 0], z0=500.0, zp=depth[j], layers=TANK)
        assert one.shape == ()
        assert float(one) == pytest.approx(grid[i, j], rel=4 * EPS)
    assert radial_shift([], z0=1.0, zp=1.0, layers=TANK).shape == (0,)
    assert radial_shift(np.ones((2, 0)), z0=1.0, zp=np.ones(0), layers=TANK).shape == (2, 0)


def test_results_do_not_depend_on_the_neighbours_in_a_block() -> None:
    rng = np.random.default_rng(5)
    radius, depth = rng.uniform(0, 3000, 10_000), rng.uniform(0, 200, 10_000)
    whole = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    order = rng.permutation(10_000)
    shuffled = radial_shift(radius[order], z0=500.0, zp=depth[order], layers=TANK)
    np.testing.assert_allclose(shuffled, whole[order], rtol=4 * EPS)


def test_transposed_and_strided_inputs_keep_their_order() -> None:
    rng = np.random.default_rng(6)
    radius, depth = rng.uniform(0, 300, (40, 30)), rng.uniform(0, 200, (40, 30))
    straight = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    np.testing.assert_array_equal(
        radial_shift(radius.T, z0=500.0, zp=depth.T, layers=TANK), straight.T
    )
    np.testing.assert_array_equal(
        radial_shift(radius[::2, ::-3], z0=500.0, zp=depth[::2, ::-3], layers=TANK),
        straight[::2, ::-3],
    )


def test_nan_stays_with_its_own_point() -> None:
    found = radial_shift([1.0, np.nan, 2.0], z0=1.0, zp=[1.0, 1.0, np.nan], layers=TANK)
    np.testing.assert_array_equal(np.isnan(found), [False, True, True])


@pytest.mark.acceptance
def test_memory_stays_constant_beyond_input_and_output() -> None:
    import tracemalloc

    radius, depth = np.full(400_000, 100.0), np.full(400_000, 50.0)
    radial_shift(radius[:10], z0=500.0, zp=depth[:10], layers=TANK)
    tracemalloc.start()
    radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < radius.nbytes + 1.5e6  # the output and a fixed amount of scratch


def test_a_negative_radius_is_refused() -> None:
    with pytest.raises(InputError, match="radius: a distance cannot be negative"):
        radial_shift(-1.0, z0=1.0, zp=1.0, layers=TANK)


def test_a_camera_in_the_water_is_refused() -> None:
    with pytest.raises(GeometryError, match="z0: the camera is on the object's side"):
        radial_shift(1.0, z0=-1.0, zp=1.0, layers=TANK)


def test_a_dry_point_is_refused() -> None:
    with pytest.raises(GeometryError, match="zp: the point is on the camera's side"):
        radial_shift(1.0, z0=1.0, zp=-1.0, layers=TANK)


def test_heights_and_indices_of_different_number_are_refused() -> None:
    with pytest.raises(InputError, match="one refractive index per layer"):
        shifted_radius(1.0, [1.0, 2.0], [1.0])
