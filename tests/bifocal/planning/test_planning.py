"""Stations and expected precision of the paper's camera and of wishes that cannot be met."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import GeometryError, InputError
from bifocal.planning.camera_plan import CameraSensor
from bifocal.planning.stations import plan_stations

CANON = CameraSensor(width=22.7, height=15.1, columns=3072, rows=2048)


def test_the_papers_stations_follow_from_its_lenses_and_scale():
    plan = plan_stations([19, 28, 35], CANON, scale_number=500, sigma_px=1.0)
    by_pair = {(s.c1, s.c2): s for s in plan.stations}
    assert plan.best is by_pair[35, 19]
    assert (plan.best.d1, plan.best.d2, plan.best.delta_d) == pytest.approx((17.5, 9.5, 8.0))
    assert plan.best.gsd == pytest.approx(0.003695, abs=1e-6)
    assert plan.best.sigma_r_rms == pytest.approx(0.0275, rel=0.01)
    assert by_pair[35, 28].sigma_r_rms == pytest.approx(0.093, rel=0.01)
    assert by_pair[35, 28].d2 == pytest.approx(14.0)


def test_a_wall_alone_sets_the_smallest_scale_that_covers_it():
    best = plan_stations([35, 19], CANON, object_size=(11.35, 5.0)).best
    assert best.scale_number == pytest.approx(500)
    assert best.photos == (1, 1)


def test_a_wanted_sigma_is_reached_exactly():
    best = plan_stations([35, 19], CANON, sigma_r=0.01, sigma_px=0.5).best
    assert best.sigma_r_rms == pytest.approx(0.01, rel=1e-12)


def test_a_wanted_gsd_sets_the_scale_and_counts_photos():
    best = plan_stations([35, 19], CANON, gsd=0.002, object_size=(12.0, 4.0)).best
    assert best.gsd == pytest.approx(0.002)
    # One photo covers 6.144 m; the second adds 80 % of it: 11.06 m, the third 15.97 m.
    assert best.photos == (3, 1)


def test_sigma_over_the_frame_has_its_maximum_near_the_nadir_and_none_on_it():
    plan = plan_stations([35, 19], CANON, scale_number=500)
    _, _, grid = plan.sigma_grid(plan.best)
    assert np.isnan(grid[3, 4])
    assert np.nanargmin(grid) in (0, 8, 54, 62)
    assert grid[0, 0] == pytest.approx(plan.best.sigma_r_corner, rel=1e-9)


def test_a_third_photo_a_step_aside_measures_the_nadir():
    plan = plan_stations([35, 19], CANON, scale_number=500)
    best, third = plan.best, plan.third_photo(plan.best)
    # Both rays of the pair go straight to the nadir, the third comes in by step / d.
    ray = 0.5 * best.gsd * best.d2 / third.step
    assert third.step == pytest.approx(best.d2 / 6)
    assert third.at_nadir == pytest.approx(np.sqrt(1 + 1 / 2) * ray, rel=1e-9)
    assert third.at_rms < best.sigma_r_rms
    assert plan.third_photo(best, step=3.0).at_nadir == pytest.approx(third.at_nadir * 9.5 / 18)


def test_the_area_of_uncertainty_is_where_sigma_reaches_the_bound():
    plan = plan_stations([35, 19], CANON, scale_number=500, sigma_r_max=0.05)
    best = plan.best
    noise = np.sqrt(2) * 0.5 * best.gsd * 17.5 * 9.5 / 8
    assert best.uncertain_radius == pytest.approx(noise / 0.05)


def test_of_pairs_made_equally_precise_the_one_that_covers_more_is_best():
    plan = plan_stations([35, 28, 19], CANON, sigma_r=0.005, object_size=(12, 8))
    assert [s.sigma_r_rms for s in plan.stations] == pytest.approx([0.005] * 3)
    widths = [station.footprint[0] for station in plan.stations]
    assert widths == sorted(widths, reverse=True)


def test_no_plan_is_made_where_nothing_fits():
    with pytest.raises(GeometryError, match=r"35/19 mm needs 17.50 m, only 5.00 m are free"):
        plan_stations([35, 19], CANON, scale_number=500, free_space=5.0)


def test_too_little_room_is_said_with_what_would_fit():
    plan = plan_stations([35, 28, 19], CANON, scale_number=500, free_space=15.0)
    by_pair = {(s.c1, s.c2): s for s in plan.stations}
    assert not by_pair[35, 19].feasible
    assert "1:429" in by_pair[35, 19].note
    assert plan.best.c1 == 28
    assert plan.best.feasible


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ({"focal_lengths": [35], "scale_number": 500}, "two different"),
        ({"focal_lengths": [35, 35], "scale_number": 500}, "two different"),
        ({"focal_lengths": [35, 34.5], "scale_number": 500}, "less than 5 %"),
        ({"focal_lengths": [35, 19]}, "size of the wall"),
        ({"focal_lengths": [35, 19], "scale_number": 500, "gsd": 0.002}, "only one of"),
        ({"focal_lengths": [35, -19], "scale_number": 500}, "above zero"),
        ({"focal_lengths": [35, 19], "gsd": 0.0}, "gsd"),
    ],
)
def test_wishes_that_cannot_be_met_are_named(call, message):
    with pytest.raises(InputError, match=message):
        plan_stations(sensor=CANON, **call)


def test_a_sensor_with_swapped_sides_is_noticed():
    with pytest.raises(InputError, match="not square"):
        CameraSensor(width=22.7, height=15.1, columns=2048, rows=3072)
