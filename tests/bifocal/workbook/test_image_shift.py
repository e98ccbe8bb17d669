"""The corrected image position, the shift to it, and files of shifts for programs that warp."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import griddata

from bifocal import Measuring, Pair, Photo, PointObservations, SurveySetup, Taking, solve
from bifocal.survey.image_shift import image_shift
from bifocal.survey.point_survey import solve_points
from bifocal.workbook.export_workflow import export
from bifocal.workbook.making.book import write_book
from bifocal.workbook.output import write_result
from bifocal.workbook.template_workflow import write_survey
from photocore.errors import InputError
from tests.bifocal.workbook.test_survey_workbook import ideal_content
from tests.recalculate import recalculated, rows_of

XYZ = np.array([[2.0, 0.0, 1.0], [-3.0, 2.0, -0.4], [1.0, -2.5, 0.3]])
NADIR1, NADIR2 = (1500, 1000), (1490, 990)


def general_pair(**more):
    first = [[4e-3, 2e-4, -6.0], [1e-4, -4e-3, 4.0], [5e-6, 2e-6, 1.0]]
    second = [[4e-3, -1e-4, -6.0], [3e-4, -4e-3, 4.0], [-3e-6, 2e-6, 1.0]]
    return Pair(
        image1=Photo(plane_from_pixel=first, nadir=[0.4, -0.3], distance=18.0, **more),
        image2=Photo(plane_from_pixel=second, nadir=[-0.2, 0.5], distance=9.0, **more),
    )


def shifts(pair, xyz):
    first, second = pair.project(xyz)
    points = PointObservations(ids=tuple("abc"), pixels1=first, pixels2=second)
    shift = image_shift(pair.image1, None, points, solve_points(pair, points))
    return first, np.stack([*shift.values()], axis=-1)


def test_the_shift_leads_to_where_the_foot_of_the_point_is_seen():
    pair = general_pair()
    picks, shift = shifts(pair, XYZ)
    feet, _ = pair.project(XYZ * [1, 1, 0])
    np.testing.assert_allclose(shift, np.hstack([feet, feet - picks]), atol=1e-8)


def test_no_relief_no_shift():
    _, shift = shifts(general_pair(), XYZ * [1, 1, 0])
    np.testing.assert_allclose(shift[:, 2:], 0, atol=1e-8)


def ideal(unit):
    """Return a set-up and exact picks of XYZ in its unit."""
    known = {"d1": 17.5, "d2": 9.5, "c1": 35, "c2": 19, "pitch": 0.01}
    setup = SurveySetup(
        taking=Taking(**known, nadir1=NADIR1, nadir2=NADIR2), measuring=Measuring(unit=unit)
    )
    xy1, xy2 = (c * XYZ[:, :2] / (d - XYZ[:, 2:]) for c, d in ((35, 17.5), (19, 9.5)))
    if unit == "px":
        xy1, xy2 = xy1 / [0.01, -0.01] + NADIR1, xy2 / [0.01, -0.01] + NADIR2
    return setup, PointObservations(ids=tuple("abc"), xy1=xy1, xy2=xy2)


@pytest.mark.parametrize("unit", ["mm", "px"])
def test_on_typed_coordinates_the_corrected_position_is_in_their_unit(unit):
    setup, points = ideal(unit)
    pair = setup.pair()
    table = solve_points(pair, setup.in_millimetres(points))
    shift = np.stack([*image_shift(pair.image1, setup, points, table).values()], axis=-1)
    feet = 2 * XYZ[:, :2]  # 1:500, in mm
    if unit == "px":
        feet = feet / [0.01, -0.01] + NADIR1
    np.testing.assert_allclose(shift, np.hstack([feet, feet - points.xy1]), rtol=1e-9, atol=1e-9)


def book(tmp_path, unit="px", use=(1, 1, 1), slip=0.0):
    setup, points = ideal(unit)
    columns = dict(zip(("x1", "y1", "x2", "y2"), [*points.xy1.T, *points.xy2.T], strict=True))
    columns["y2"] = columns["y2"] + [0, slip, 0]
    picks = {"id": list("abc"), "use": use, **columns}
    solved = solve(picks, taking=setup.taking, measuring=setup.measuring)
    write_result(tmp_path / "r.xlsx", solved)
    return tmp_path / "r.xlsx", points


def test_control_points_of_qgis_lie_on_the_wall_and_count_from_the_corner(tmp_path):
    path, points = book(tmp_path)
    export(path, tmp_path / "s.points")
    head, *lines = (tmp_path / "s.points").read_text().splitlines()
    assert head == "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual"
    rows = np.array([[float(v) for v in line.split(",")] for line in lines])
    np.testing.assert_allclose(rows[:, :2], XYZ[:, :2], atol=1e-5)
    np.testing.assert_allclose(rows[:, 2:4], (points.xy1 + 0.5) * [1, -1], atol=1e-3)
    assert (rows[:, 4] == 1).all()


def test_points_from_and_to_for_imagemagick(tmp_path):
    path, points = book(tmp_path, "mm")
    assert export(path, tmp_path / "s.txt") == ()
    lines = (tmp_path / "s.txt").read_text().splitlines()
    rows = np.array([[float(v) for v in line.replace(" ", ",").split(",")] for line in lines])
    picks, feet = (mm / [0.01, -0.01] + [1500.5, 1000.5] for mm in (points.xy1, 2 * XYZ[:, :2]))
    np.testing.assert_allclose(rows, np.hstack([picks, feet]), atol=1e-3)


def test_points_in_doubt_are_left_out_and_named(tmp_path):
    path, _ = book(tmp_path, use=(1, 1, 0), slip=90.0)
    (said,) = export(path, tmp_path / "s.txt")
    assert "2 point(s) in doubt or not used left out: b, c" in said
    assert len((tmp_path / "s.txt").read_text().splitlines()) == 1


def test_millimetres_without_a_pixel_size_are_refused_and_nothing_is_written(tmp_path):
    picks = {"id": ["P1"], "s1": [35 * 2 / 16.5], "s2": [19 * 2 / 8.5], "theta": [90]}
    write_result(tmp_path / "r.xlsx", solve(picks, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19)))
    with pytest.raises(InputError, match="pitch, nadir_1_col"):
        export(tmp_path / "r.xlsx", tmp_path / "s.points")
    assert not (tmp_path / "s.points").exists()


@pytest.mark.acceptance
@pytest.mark.office
def test_a_workbook_alone_moves_the_image_as_the_exact_relief_says(tmp_path):
    rng, pair = np.random.default_rng(3), general_pair(sigma_pixel=0.3)

    def wall(places):
        relief = 0.4 * np.sin(places[:, 0]) * np.cos(places[:, 1])
        return np.column_stack([places, relief])

    xyz = wall(rng.uniform([-4, -3], [4, 3], (60, 2)))
    first, second = pair.project(xyz)
    points = PointObservations(ids=tuple(map(str, range(60))), pixels1=first, pixels2=second)
    write_survey(tmp_path / "s.xlsx", points, pair=pair)
    rows = rows_of(recalculated(tmp_path / "s.xlsx", tmp_path), "Points", 4)[:60]
    moved = np.array([[row["x_c"], row["y_c"]] for row in rows])
    feet, _ = pair.project(xyz * [1, 1, 0])
    np.testing.assert_allclose(moved, feet, atol=1e-6)
    # Warped by these points alone a place between them is left within a fraction of its shift.
    true = wall(np.array([[1.0, 0.5], [-1.5, -0.5], [0.5, -1.0], [-1.0, 1.0]]))
    seen, foot = pair.project(true)[0], pair.project(true * [1, 1, 0])[0]
    left = seen - foot - griddata(feet, first - feet, foot, method="linear")
    assert np.hypot(*left.T).max() < 0.3 * np.hypot(*(seen - foot).T).max()


@pytest.mark.acceptance
@pytest.mark.office
def test_corrected_coordinates_are_carried_back_to_what_was_typed(tmp_path):
    first = np.array([[1.001, 2e-3, 0.05], [-1e-3, 0.999, -0.03], [1e-5, -2e-5, 1.0]])
    second = np.array([[1.002, -1e-3, 0.02], [1e-3, 1.001, 0.01], [-1e-5, 1e-5, 1.0]])
    write_book(tmp_path / "a.xlsx", content := ideal_content(adjusted=(first, second)))
    rows = rows_of(recalculated(tmp_path / "a.xlsx", tmp_path), "Points", 4)
    setup, table = content.setup, content.table
    assert setup is not None
    feet = image_shift(content.photos[0], setup, content.points, table)
    for key in ("x_c", "dy"):
        good = np.isfinite(feet[key])
        found = [row[key] for row, is_good in zip(rows, good, strict=False) if is_good]
        np.testing.assert_allclose(found, feet[key][good], rtol=1e-11, atol=1e-9)
    # By hand: the matrix takes the corrected position, in mm, to the foot of the point.
    mm = (np.stack([feet["x_c"], feet["y_c"]], -1) - setup.taking.nadir1) * [0.00739, -0.00739]
    below = mm @ first[2, :2] + 1.0
    foot = (mm @ first[:2, :2].T + first[:2, 2]) / below[:, None]
    np.testing.assert_allclose(np.hypot(*foot.T), np.abs(table["s_c"]), rtol=1e-9)
