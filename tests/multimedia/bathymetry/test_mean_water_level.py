"""The mean water height from tie points."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import multimedia as mm
from multimedia import GeometryError, InputError
from multimedia.bathymetry import waterlevel_workflow
from multimedia.bathymetry.waterlevel_workflow import fit_water_level


def tie_points(seed: int, *, surface: int, bottom: int, spread: float = 0.002, slope: float = 0.0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-2, 2, (surface + bottom, 2))
    z = np.concatenate(
        [
            rng.normal(1.8, spread, surface) + slope * xy[:surface, 0],
            rng.uniform(1.3, 1.7, bottom),
        ]
    )
    return np.column_stack([xy, z])


@pytest.mark.parametrize(
    ("surface", "bottom"), [(50, 0), (50, 50), (40, 200), (200, 20), (30, 250)]
)
@pytest.mark.parametrize("seed", range(5))
def test_the_level_is_found_among_any_number_of_bottom_points(surface, bottom, seed) -> None:
    points = tie_points(seed, surface=surface, bottom=bottom)
    water = mm.mean_water_level(points)
    assert abs(water.level - 1.8) < 4.5 * 0.002 / np.sqrt(surface)
    assert not water.used[surface:].any()
    assert water.used[:surface].mean() > 0.9
    assert water.below >= bottom


def test_points_over_the_water_are_rejected_too() -> None:
    points = tie_points(3, surface=60, bottom=60)
    points = np.vstack([points, [[0, 0, 2.4], [1, 0, 1.95], [0, 1, 3.0]]])
    water = mm.mean_water_level(points)
    assert water.above >= 3
    assert abs(water.level - 1.8) < 0.001


@pytest.mark.acceptance
def test_sigma_is_that_of_the_mean() -> None:
    levels = [mm.mean_water_level(tie_points(s, surface=100, bottom=100)) for s in range(60)]
    scatter = np.std([water.level for water in levels])
    assert np.mean([water.sigma for water in levels]) == pytest.approx(scatter, rel=0.25)
    assert np.mean([water.spread for water in levels]) == pytest.approx(0.002, rel=0.05)


def test_a_tilted_surface_is_fitted_with_its_slope() -> None:
    points = tie_points(4, surface=200, bottom=100, slope=0.003)
    water = mm.mean_water_level(points, tilted=True, spread=0.005)
    assert water.slope[0] == pytest.approx(0.003, abs=4 * water.slope_sigma[0])
    assert abs(water.slope[1]) < 4 * water.slope_sigma[1]
    at_corner = 1.8 + 0.003 * 2
    corner = mm.correct_bathymetry([2.0, 0, 1.0], water_level=water.surface, refractive_index=1.34)
    assert corner.depth == pytest.approx(1.34 * (at_corner - 1.0), abs=0.003)


def test_shifting_heights_and_order_of_points_do_not_matter() -> None:
    points = tie_points(5, surface=40, bottom=60)
    water = mm.mean_water_level(points)
    lifted = mm.mean_water_level(points[::-1] + np.array([1000.0, 0, 412.0]))
    assert lifted.level - 412 == pytest.approx(water.level, abs=1e-9)
    assert lifted.used[::-1].tolist() == water.used.tolist()


def test_a_perfectly_flat_surface_has_no_spread() -> None:
    points = np.column_stack([np.arange(12.0), np.zeros(12), np.full(12, 1.5)])
    water = mm.mean_water_level(points)
    assert (water.level, water.used.sum()) == (pytest.approx(1.5), 12)
    assert water.spread < 1e-12


@pytest.mark.parametrize(
    ("points", "kind", "message"),
    [
        ([[0, 0, 1.0]] * 3, InputError, "3 tie points; at least 5"),
        (np.column_stack([np.zeros((8, 2)), 10.0 ** np.arange(8)]), GeometryError, "one height"),
    ],
)
def test_too_few_points_on_the_surface_are_refused(points, kind, message) -> None:
    with pytest.raises(kind, match=message):
        mm.mean_water_level(points, spread=0.001 if len(points) > 5 else None)


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.3, 0.7)])
def test_points_on_one_line_do_not_show_a_tilt(direction) -> None:
    along = np.arange(20.0)
    points = np.column_stack([np.outer(along, direction), 1.8 + 0.001 * np.sin(along)])
    with pytest.raises(GeometryError, match="lie on one line"):
        mm.mean_water_level(points, tilted=True)
    assert mm.mean_water_level(points).level == pytest.approx(1.8, abs=0.001)


#: Points on the water, on the bank above it and on the bottom below; spread, slope of the bank,
#: share of gross errors.
BANKS = {
    "open water": (80, 0, 0, 0.02, 0.1, 0.0),
    "bottom": (80, 0, 200, 0.02, 0.1, 0.02),
    "bank": (80, 100, 0, 0.02, 0.1, 0.02),
    "both": (80, 100, 200, 0.02, 0.1, 0.03),
    "few": (30, 60, 150, 0.01, 0.2, 0.05),
    "flat": (200, 100, 100, 0.03, 0.05, 0.02),
}


def bank(seed: int, counts, spread: float, slope: float, gross: float, tilt: float = 0.0):
    """Return tie points where land meets water at 102.4 m.

    The bank rises from the water line and the bottom falls from it, seen 1.34 times too shallow;
    gross errors reach 3 m to either side.
    """
    rng = np.random.default_rng(seed)
    water, above, below = counts
    x = np.concatenate(
        [rng.uniform(0, 30, water), rng.uniform(-15, 0, above), rng.uniform(0, 30, below)]
    )
    y = rng.uniform(-20, 20, len(x))
    z = 102.4 + np.where(np.arange(len(x)) < water, 0.0, -slope * x / np.where(x > 0, 1.34, 1.0))
    z += tilt * y + spread * rng.standard_normal(len(x))
    wrong = rng.choice(len(x), int(gross * len(x)), replace=False)
    z[wrong] += rng.uniform(-3, 3, len(wrong))
    return np.column_stack([x, y, z])


def assert_honest(pulls: np.ndarray) -> None:
    """Errors over their sigmas are as normal as they should be, in the middle and both tails."""
    low, left, middle, right, high = np.percentile(pulls, [2.5, 16, 50, 84, 97.5])
    tell = np.round([low, left, middle, right, high], 2)
    assert abs(middle) < 0.4, tell
    assert -1.45 < left < -0.6, tell
    assert 0.6 < right < 1.45, tell
    assert -2.9 < low < -1.2, tell
    assert 1.2 < high < 2.9, tell
    assert np.mean(np.abs(pulls) > 5) <= 0.02


@pytest.mark.acceptance
@pytest.mark.long
@pytest.mark.parametrize("scene", BANKS)
def test_the_sigma_of_a_level_between_banks_is_honest_in_both_tails(scene) -> None:
    *counts, spread, slope, gross = BANKS[scene]
    levels = [mm.mean_water_level(bank(5000 + k, counts, spread, slope, gross)) for k in range(150)]
    assert_honest(np.array([(water.level - 102.4) / water.sigma for water in levels]))


@pytest.mark.acceptance
def test_the_sigmas_of_a_tilted_surface_between_banks_are_honest() -> None:
    pulls = []
    for k in range(100):
        points = bank(7000 + k, (120, 60, 120), 0.02, 0.1, 0.02, tilt=5e-4)
        water = mm.mean_water_level(points, tilted=True)
        at = water.level + float(water.slope @ (np.array([15.0, 0.0]) - water.centre))
        assert abs(at - 102.4) < 0.05
        pulls.append((water.slope[1] - 5e-4) / water.slope_sigma[1])
    assert_honest(np.array(pulls))


def chance_bank(seed: int, crowded: float = 0.0) -> tuple[np.ndarray, float]:
    """Return tie points of a shore of chance shape, and the height of its water.

    Counts, slopes and gross errors lie in the ranges that docs/bathymetry.md names; bank and bottom
    have slopes of their own. A share of the points may crowd at chance places.
    """
    rng = np.random.default_rng(seed)
    water, beside = int(rng.integers(30, 201)), int(rng.integers(0, 501))
    above = int(rng.random() * beside)
    below = beside - above
    spread = 10 ** rng.uniform(np.log10(0.005), np.log10(0.04))
    bank_slope, bottom_slope = rng.uniform(0.05, 0.3, 2)
    gross = rng.uniform(0, 0.05)
    length, breadth = rng.uniform(8, 60), rng.uniform(4, 30)
    level = rng.uniform(-5, 400)

    def places(count, width):
        along = rng.uniform(0, width, count)
        many = int(crowded * count)
        if many:
            centres = rng.uniform(0, width, max(1, many // 15))
            at = rng.choice(centres, many) + rng.normal(0, 0.03 * width, many)
            along[:many] = np.clip(at, 0, width)
        return along

    on_water, on_bank, on_bottom = (
        places(water, length),
        places(above, breadth),
        places(below, length),
    )
    x = np.concatenate([on_water, -on_bank, on_bottom])
    y = rng.uniform(-20, 20, len(x))
    rise = np.concatenate([0 * on_water, bank_slope * on_bank, -bottom_slope * on_bottom / 1.34])
    z = level + rise + spread * rng.standard_normal(len(x))
    wrong = rng.choice(len(x), int(gross * len(x)), replace=False)
    z[wrong] += rng.uniform(-3, 3, len(wrong))
    return np.column_stack([x, y, z]), level


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "seeds",
    [range(312, 342), pytest.param(range(2000, 2400), marks=pytest.mark.long)],
    ids=["some", "many"],
)
def test_no_chance_bank_is_taken_for_the_water(seeds) -> None:
    pulls = []
    for seed in seeds:
        points, level = chance_bank(seed)
        water = mm.mean_water_level(points)
        pulls.append((water.level - level) / water.sigma)
    assert np.abs(pulls).max() < 4.0
    assert 0.75 < np.std(pulls) < 1.25


@pytest.mark.parametrize(
    ("seeds", "worst"),
    [
        (range(16, 22), 0),
        pytest.param(range(1000, 1300), 4, marks=[pytest.mark.acceptance, pytest.mark.long]),
    ],
)
def test_points_that_crowd_on_a_bank_are_not_the_water_or_a_remark_says_so(seeds, worst) -> None:
    wrong = []
    for seed in seeds:
        points, level = chance_bank(seed, crowded=0.4)
        water = mm.mean_water_level(points)
        if abs(water.level - level) > 4.5 * water.sigma:
            wrong.append(seed)
            # The larger group is told, or that points scatter by more than a metre.
            larger = water.larger or (0, np.inf)
            assert abs(larger[1] - level) < 0.1 or water.spread > 1.0
    assert len(wrong) <= worst


def test_a_larger_group_below_the_highest_is_told(tmp_path) -> None:
    rng = np.random.default_rng(4)
    xy = rng.uniform(-2, 2, (90, 2))
    z = np.concatenate([rng.normal(1.8, 0.002, 20), rng.normal(1.2, 0.002, 70)])
    points = np.column_stack([xy, z])
    water = mm.mean_water_level(points)
    assert water.level == pytest.approx(1.8, abs=0.003)
    assert water.larger == (pytest.approx(70, abs=8), pytest.approx(1.2, abs=0.002))
    np.savetxt(tmp_path / "ties.csv", points, delimiter=",", header="X,Y,Z", comments="")
    remarks = fit_water_level(tmp_path / "ties.csv").remarks
    assert "tie points at about 1.200 m are a larger group than the highest one" in remarks[-1]


@pytest.mark.parametrize(("spread", "count"), [(0.9, 0), (1.1, 1)])
def test_heights_that_scatter_by_more_than_a_metre_are_asked_for_their_unit(
    spread, count, tmp_path, monkeypatch
):
    np.savetxt(tmp_path / "ties.xyz", np.eye(3), header="X Y Z", comments="")
    level = SimpleNamespace(spread=spread, larger=None)
    monkeypatch.setattr(waterlevel_workflow, "mean_water_level", lambda *_, **__: level)
    words = fit_water_level(tmp_path / "ties.xyz").remarks
    assert len([line for line in words if "are the heights in millimetres?" in line]) == count
