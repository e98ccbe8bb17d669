"""The look-up table: error, bound, axis, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import GeometryError, InputError, Layers, ShiftTable, radial_shift
from tests.rounding import EPS

TANK = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))


def table(**changes: object) -> ShiftTable:
    options = {"z0": 500.0, "layers": TANK, "max_radius": 215.0, "depths": (0.0, 200.0)}
    return ShiftTable(**(options | changes))  # type: ignore[arg-type]


def scene(n: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(20240601)
    return np.hypot(*rng.uniform(-150, 150, (2, n))), rng.uniform(0, 200, n)


@pytest.mark.parametrize(("degree", "best"), [(1, 1.2e-3), (3, 2.7e-7)])
def test_errors_stay_under_the_reported_bound(degree: int, best: float) -> None:
    radius, depth = scene()
    tabled = table(degree=degree)
    exact = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    error = np.abs(tabled(radius, zp=depth) - exact).max()
    assert error <= tabled.error_bound <= best
    assert tabled.error_bound < 3 * error
    assert tabled.entries < 2000


def test_bicubic_takes_a_quarter_of_the_nodes_for_a_micrometre() -> None:
    assert table(shape=(16, 16)).error_bound < 1e-3 / 50


@pytest.mark.parametrize("degree", [1, 3])
def test_the_axis_is_exact_at_the_nodes(degree: int) -> None:
    tabled = table(degree=degree)
    depth = np.linspace(0, 200, 44)
    limit = (510 + depth) / (500 + 10 / 1.5 + depth / 1.34)
    np.testing.assert_allclose(tabled.ratios[:, 0], limit, rtol=4 * EPS)
    np.testing.assert_allclose(tabled(1e-6, zp=depth) / 1e-6, limit, rtol=1e-9)
    assert (tabled(0.0, zp=depth) == 0).all()


@pytest.mark.parametrize("degree", [1, 3])
def test_near_the_axis_the_error_vanishes(degree: int) -> None:
    # The field's reference table is wrong here: its axis row says "no shift".
    radius = np.linspace(0, 2.0, 100)[:, None]
    depth = np.linspace(0, 200, 333)
    tabled = table(degree=degree)
    exact = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    assert np.abs(tabled(radius, zp=depth) - exact).max() < tabled.error_bound / 20


def test_it_is_called_as_the_exact_shift() -> None:
    call = {"z0": 500.0, "zp": [[10.0], [20.0]], "layers": TANK}
    found = table()([1.0, 2.0, 3.0], **call)
    np.testing.assert_allclose(found, radial_shift([1.0, 2.0, 3.0], **call), atol=1e-8)


def test_borders_belong_to_the_table_and_nan_stays_nan() -> None:
    found = table()([215.0, 0.0, np.nan], zp=[200.0, 0.0, 5.0])
    assert np.isfinite(found[:2]).all()
    assert np.isnan(found[2])


@pytest.mark.parametrize(
    ("radius", "depth", "message"),
    [
        ([1.0, 216.0], 10.0, "radius: 1 of 2 values lie outside.*first: 216"),
        (10.0, 201.0, "zp: 1 of 1 values lie outside"),
        (10.0, -1.0, "zp: 1 of 1"),
    ],
)
def test_points_outside_are_refused(radius: object, depth: float, message: str) -> None:
    with pytest.raises(GeometryError, match=message):
        table()(radius, zp=depth)  # type: ignore[arg-type]


def test_another_camera_or_other_media_are_refused() -> None:
    with pytest.raises(GeometryError, match="every camera needs its own table"):
        table()(1.0, zp=1.0, z0=501.0)
    with pytest.raises(GeometryError, match="other media"):
        table()(1.0, zp=1.0, layers=Layers(indices=(1.0, 1.34)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depths": (200.0, 0.0)}, "from the smaller to the larger depth"),
        ({"depths": (5.0, 5.0)}, "from the smaller to the larger depth"),
        ({"max_radius": 0.0}, "max_radius: must be above zero"),
        ({"degree": 2}, "degree: 1"),
        ({"shape": (3, 50)}, "at least 4 by 4"),
    ],
)
def test_impossible_tables_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        table(**change)


def test_a_table_over_unseen_ground_is_refused() -> None:
    with pytest.raises(GeometryError, match="max_radius: the camera cannot see"):
        table(z0=0.0)


def test_a_camera_in_water_has_a_table_too() -> None:
    back = Layers(indices=(1.34, 1.5, 1.0), thicknesses=(10.0,))
    tabled = table(layers=back, z0=200.0, depths=(300.0, 500.0))
    radius, depth = np.linspace(0, 215, 50)[:, None], np.linspace(300, 500, 40)
    exact = radial_shift(radius, z0=200.0, zp=depth, layers=back)
    assert np.abs(tabled(radius, zp=depth) - exact).max() <= tabled.error_bound < 1e-5
