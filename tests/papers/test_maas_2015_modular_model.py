"""Maas, "A modular geometric model for underwater photogrammetry" (2015): shift and table."""

from __future__ import annotations

import math

import numpy as np
import pytest

from multimedia import (
    Layers,
    ShiftTable,
    iterated_radius,
    radial_shift,
    radial_shift_ratio,
    water_refractive_index,
)
from tests.rounding import EPS

#: A laboratory tank, in mm.
TANK = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))
Z0, T = 500.0, 10.0


def scene(n: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2015)
    return np.hypot(*rng.uniform(-150, 150, (2, n))), rng.uniform(0, 200, n)


def test_equations_of_figure_1_hold() -> None:
    radius, depth = scene()
    bar = radial_shift(radius, z0=Z0, zp=depth, layers=TANK)
    beta1 = np.arctan(bar / (Z0 + T + depth))  # R bar = (Z0 + t + ZP) tan b1
    beta2, beta3 = np.arcsin(np.sin(beta1) / 1.5), np.arcsin(np.sin(beta1) / 1.34)  # Snell
    reached = Z0 * np.tan(beta1) + T * np.tan(beta2) + depth * np.tan(beta3)
    np.testing.assert_allclose(reached, radius, rtol=16 * EPS)


@pytest.mark.parametrize(("indices", "sign"), [((1.0, 1.5, 1.34), 1), ((1.34, 1.33, 1.0), -1)])
def test_shift_is_outwards_if_glass_and_water_are_denser_than_air(
    indices: tuple[float, ...], sign: int
) -> None:
    layers = Layers(indices=indices, thicknesses=(10.0,))
    shift = radial_shift(100.0, z0=Z0, zp=150.0, layers=layers) - 100.0
    assert np.sign(shift) == sign


def test_formula_of_the_refractive_index() -> None:
    # n_w = 1.338 + 4e-5 (486 + 0.003 d + 50 S - lambda - T) for 2 m, 3.5 %, 550 nm, 15 degrees:
    # 486 + 0.006 + 175 - 550 - 15 = 96.006
    value = water_refractive_index(
        wavelength_nm=550, temperature_c=15, salinity_percent=3.5, depth=2
    )
    assert value == pytest.approx(1.338 + 4e-5 * 96.006, rel=4 * EPS)


def test_one_iteration_as_printed() -> None:
    radius, depth = 120.0, 150.0
    beta1 = math.atan(radius / (Z0 + T + depth))
    beta2, beta3 = math.asin(math.sin(beta1) / 1.5), math.asin(math.sin(beta1) / 1.34)
    correction = radius - (Z0 * math.tan(beta1) + T * math.tan(beta2) + depth * math.tan(beta3))
    found = iterated_radius(radius, (Z0, T, depth), TANK.indices, tolerance=1e-9, max_iterations=1)
    assert float(found.radius_bar) == pytest.approx(radius + correction, rel=8 * EPS)


def test_the_iteration_stops_at_a_tenth_of_a_micrometre() -> None:
    radius, depth = scene()
    found = iterated_radius(radius, (Z0, T, depth), TANK.indices, tolerance=1e-4)
    exact = radial_shift(radius, z0=Z0, zp=depth, layers=TANK)
    assert found.converged.all()
    assert np.abs(found.radius_bar - exact).max() < 1e-4


def test_back_to_cartesian_coordinates() -> None:
    # X bar = X0 + (X - X0) R bar / R, the same for Y: the direction from the nadir stays.
    point, nadir = np.array([130.0, -70.0]), np.array([20.0, 40.0])
    radius = np.hypot(*(point - nadir))
    ratio = radial_shift_ratio(radius, z0=Z0, zp=150.0, layers=TANK)
    shifted = nadir + (point - nadir) * ratio
    assert np.hypot(*(shifted - nadir)) == pytest.approx(
        float(radial_shift(radius, z0=Z0, zp=150.0, layers=TANK)), rel=8 * EPS
    )


def test_the_shifted_point_lies_on_the_straight_ray_of_the_image_point() -> None:
    # The purpose of it all: collinearity holds again for P bar.
    radius, depth = scene(50)
    bar = radial_shift(radius, z0=Z0, zp=depth, layers=TANK)
    sine = bar / np.hypot(bar, Z0 + T + depth)
    tangent_in_air = sine / np.sqrt(1 - sine**2)
    np.testing.assert_allclose(tangent_in_air * (Z0 + T + depth), bar, rtol=1e-14)


def test_any_number_of_parallel_interfaces() -> None:
    # A pane of 10 mm is two panes of 4 and 6 mm.
    split = Layers(indices=(1.0, 1.5, 1.5, 1.34), thicknesses=(4.0, 6.0))
    radius, depth = scene(100)
    np.testing.assert_allclose(
        radial_shift(radius, z0=Z0, zp=depth, layers=split),
        radial_shift(radius, z0=Z0, zp=depth, layers=TANK),
        rtol=8 * EPS,
    )


def test_over_compensation_saves_half_of_the_iterations_where_water_dominates() -> None:
    rng = np.random.default_rng(20240601)
    radius, depth = np.hypot(*rng.uniform(-250, 250, (2, 5000))), rng.uniform(400, 600, 5000)
    heights = (100.0, 10.0, depth)
    counts = {
        factor: iterated_radius(
            radius, heights, TANK.indices, tolerance=1e-4, over_compensation=factor
        ).iterations.mean()
        for factor in (1.0, 1.4, None)
    }
    assert counts[1.0] == pytest.approx(11.8, abs=0.5)
    assert counts[1.4] == pytest.approx(counts[1.0] / 2, abs=0.6)
    assert counts[None] < 0.45 * counts[1.0]


def test_over_compensation_does_harm_where_air_dominates() -> None:
    radius, depth = scene()
    plain, factor = (
        iterated_radius(
            radius, (Z0, T, depth), TANK.indices, tolerance=1e-4, over_compensation=f
        ).iterations.mean()
        for f in (1.0, 1.4)
    )
    assert factor > 1.8 * plain


@pytest.mark.parametrize("degree", [1, 3])
def test_fewer_than_2000_entries_lose_no_significant_accuracy(degree: int) -> None:
    # c = 25 mm over 700 mm: the bundle adjustment of Maas' experiment had a sigma of 0.49 um.
    table = ShiftTable(z0=Z0, layers=TANK, max_radius=215.0, depths=(0.0, 200.0), degree=degree)
    in_image_um = 1000 * table.error_bound * 25.0 / 510.0
    assert table.entries < 2000
    assert in_image_um < 0.49 / 5


def test_a_table_belongs_to_one_camera() -> None:
    near, far = (
        ShiftTable(z0=z0, layers=TANK, max_radius=200.0, depths=(0.0, 200.0)) for z0 in (300, 600)
    )
    assert abs(float(near(100.0, zp=100.0) - far(100.0, zp=100.0))) > 1.0
