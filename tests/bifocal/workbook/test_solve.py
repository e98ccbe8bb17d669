"""`solve` and `georeference` from Python, and the ideal pair as a pair like any other."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bifocal import Measuring, Pair, Taking, georeference, relief, solve
from bifocal.survey.basis import basis
from bifocal.workbook.reading.reader import column_map
from multimedia import GeometryError, InputError

LENSES = {"d1": 17.5, "d2": 9.5, "c1": 35.0, "c2": 19.0}


def seen(xyz, *, c, d):
    """Image coordinates [mm] of points in front of a camera at the nadir: similar triangles."""
    xyz = np.asarray(xyz, dtype=float)
    return c * xyz[:, :2] / (d - xyz[:, 2:])


def columns(xyz):
    first, second = seen(xyz, c=35, d=17.5), seen(xyz, c=19, d=9.5)
    return dict(zip(("x1", "y1", "x2", "y2"), np.hstack([first, second]).T, strict=True))


XYZ = np.array([[2.0, 0.0, 1.0], [-3.0, 2.0, 0.5], [4.0, -2.0, -0.4], [-4.0, -1.5, 0.0]])


def test_columns_of_coordinates_give_the_points_back():
    survey = solve({"id": ["A", "B", "C", "D"], **columns(XYZ)}, taking=Taking(**LENSES))
    assert survey.table.xyz == pytest.approx(XYZ, abs=1e-12)
    assert survey.table.ids == ("A", "B", "C", "D")
    assert survey.pair.d1 == 17.5


def test_columns_of_pixels_with_a_pair_give_the_points_back():
    nadirs = {"nadir1": (1536.25, 1023.75), "nadir2": (1530.0, 1020.5)}
    pair = Pair.ideal(**LENSES, pixel_size=0.0074, **nadirs)
    picks = dict(zip(("col1", "row1", "col2", "row2"), np.hstack(pair.project(XYZ)).T, strict=True))
    survey = solve(picks, pair=pair)
    assert survey.table.xyz == pytest.approx(XYZ, abs=1e-11)
    # By hand: 35 mm * 2 m / 16.5 m right of the nadir, in pixels of 0.0074 mm.
    assert picks["col1"][0] == pytest.approx(1536.25 + 35 * 2 / 16.5 / 0.0074)


def test_rows_of_every_kind_in_one_table_are_solved_with_a_pair():
    """By hand: s is the length of x, y, and theta runs clockwise from +y."""
    pair = Pair.ideal(
        **LENSES, pixel_size=0.0074, nadir1=(1536.25, 1023.75), nadir2=(1530.0, 1020.5)
    )
    picks = dict(zip(("col1", "row1", "col2", "row2"), np.hstack(pair.project(XYZ)).T, strict=True))
    table = picks | columns(XYZ)
    table["s1"], table["s2"] = (np.hypot(table[f"x{k}"], table[f"y{k}"]) for k in (1, 2))
    table["theta"] = np.degrees(np.arctan2(table["x1"], table["y1"]))
    for keys, row in ((picks, 0), (columns(XYZ), 1), (("s1", "s2", "theta"), 2)):
        for key in keys:
            table[key] = np.where(np.arange(4) == row, table[key], np.nan)
    for key in ("x1", "y1", "x2", "y2"):
        table[key][3] = columns(XYZ)[key][3]
    survey = solve({"id": list("ABCD"), **table}, pair=pair)
    assert survey.table.xyz == pytest.approx(XYZ, abs=1e-10)
    table["theta"][2] = np.nan
    with pytest.raises(InputError, match="theta is needed"):
        solve({"id": list("ABCD"), **table}, pair=pair)


def test_a_survey_says_whether_its_picks_are_given_found_or_assumed():
    pair = Pair.ideal(**LENSES, pixel_size=0.0074)
    rng = np.random.default_rng(1)
    xyz = np.column_stack([rng.uniform(-4, 4, 30), rng.uniform(-2, 2, 30), rng.uniform(0, 1, 30)])
    pixels = np.hstack(pair.project(xyz)) + rng.normal(0, 0.4, (30, 4))
    picks = dict(zip(("col1", "row1", "col2", "row2"), pixels.T, strict=True))
    few = {key: column[:4] for key, column in picks.items()}
    assert re.search(
        r"picks of 0\.[345]\d* px found from the misfits;", basis(solve(picks, pair=pair))
    )
    assert "picks of 0.7 px given;" in basis(
        solve(picks, pair=pair, measuring=Measuring(sigma_px=0.7))
    )
    assert "px assumed;" in basis(solve(few, pair=pair))
    # A remark is a text, which may be worded anew or translated.
    mute = replace(solve(picks, pair=pair), remarks=())
    assert "found from the misfits" in basis(mute)


@pytest.mark.parametrize("wrong", [0.0, 0.3])
def test_blunders_do_not_spoil_the_precision_found_for_the_other_picks(wrong):
    pair = Pair.ideal(**LENSES, pixel_size=0.0074)
    rng = np.random.default_rng(6)
    xyz = rng.uniform(-1, 1, (400, 3)) * [4, 2, 1]
    pixels = np.hstack(pair.project(xyz)) + rng.normal(0, 0.4, (400, 4))
    blunders = rng.random(400) < wrong
    pixels[blunders] += rng.uniform(-30, 30, (blunders.sum(), 4))
    picks = dict(zip(("col1", "row1", "col2", "row2"), pixels.T, strict=True))
    found = solve(picks, pair=pair).sigma_px
    assert found == pytest.approx(0.4, rel=0.08 if not wrong else 0.25)


def test_picks_of_long_tails_are_as_good_as_those_kept():
    # One in five is three times as bad: the root mean square of both is 0.4 sqrt(0.8 + 0.2 * 9).
    pair = Pair.ideal(**LENSES, pixel_size=0.0074)
    rng = np.random.default_rng(7)
    xyz = rng.uniform(-1, 1, (2000, 3)) * [4, 2, 1]
    worse = np.where(rng.random((2000, 1)) < 0.2, 3.0, 1.0)
    pixels = np.hstack(pair.project(xyz)) + 0.4 * worse * rng.normal(size=(2000, 4))
    picks = dict(zip(("col1", "row1", "col2", "row2"), pixels.T, strict=True))
    survey = solve(picks, pair=pair)
    assert 0.48 < survey.sigma_px < 0.4 * np.sqrt(2.6)
    z = np.abs(survey.table.xyz - xyz)[:, 2] / survey.table["sigma_r"]
    kept = np.array(survey.table.flags) != "OFF-RADIAL"
    assert np.mean(z[kept] < 2) > 0.92


def test_the_error_of_a_transformation_is_claimed_only_where_it_is_known():
    ids = ["A", "B", "C", "D"]
    survey = solve({"id": ids, **columns(XYZ)}, taking=Taking(**LENSES))
    wall = dict(zip(("id", "X", "Y", "Z"), (ids, *XYZ.T), strict=True))
    known = dict(zip(("id", "E", "N", "H"), (ids, *XYZ[:, [0, 2, 1]].T * [[1], [-1], [1]]),
                     strict=True))  # fmt: skip
    first = {key: column[:2] for key, column in known.items()}
    unknown = georeference({k: v[:2] for k, v in wall.items()}, first | {"H": [np.nan] * 2})
    assert unknown.precision is None
    said = basis(replace(survey, georeference=unknown))
    assert "without the transformation's own error, which is unknown" in said
    placed = georeference(survey.table, known)
    assert placed.precision is not None
    assert ", with the transformation's own error" in basis(replace(survey, georeference=placed))


def test_a_unit_that_is_none_is_refused_with_a_pair_too():
    with pytest.raises(InputError, match="'cm' is neither mm nor px"):
        solve(columns(XYZ), pair=Pair.ideal(**LENSES), measuring=Measuring(unit="cm"))


def test_plane_points_correct_the_orientation_from_python_too():
    wall = np.array([[4.0, 2.0, 0.0], [-4.0, 2.0, 0.0], [4.0, -2.0, 0.0], [-4.0, -2.0, 0.0]])
    picks = columns(np.vstack([XYZ, wall]))
    picks |= {"x2": picks["x2"] * 1.01, "y2": picks["y2"] * 1.01}
    picks |= {"code": [""] * 4 + ["PLANE"] * 4}
    survey = solve(picks, taking=Taking(**LENSES), adjust_setup=True)
    assert survey.table.xyz[:4] == pytest.approx(XYZ, abs=1e-6)
    assert any("scale: +1 %" in remark for remark in survey.remarks)


@given(
    st.floats(0.5, 6), st.floats(0, 2 * np.pi), st.floats(-3, 5), st.floats(2, 9), st.floats(1, 9)
)
def test_table_intersection_and_equation_agree(radius, direction, r, base, d2):
    d1 = d2 + base
    if r > 0.8 * d2:
        return
    xyz = np.array([[radius * np.sin(direction), radius * np.cos(direction), r]])
    c1, c2 = 2.0 * d1, 2.0 * d2
    first, second = seen(xyz, c=c1, d=d1), seen(xyz, c=c2, d=d2)
    pair = Pair.ideal(d1=d1, d2=d2, c1=c1, c2=c2)
    table = solve(
        dict(zip(("x1", "y1", "x2", "y2"), np.hstack([first, second])[0][:, None], strict=True)),
        taking=Taking(d1=d1, d2=d2, c1=c1, c2=c2),
    ).table  # fmt: skip
    closed = relief(np.hypot(*first.T), np.hypot(*second.T), d1=d1, d2=d2)
    assert table["r"] == pytest.approx(closed, rel=1e-12, abs=1e-12)
    assert pair.intersect(first, second).xyz == pytest.approx(table.xyz, rel=1e-9, abs=1e-9)


def test_an_exchanged_ideal_pair_keeps_the_order_it_was_given_in():
    pair = Pair.ideal(d1=9.5, d2=17.5, c1=19, c2=35)
    assert (pair.d1, pair.d2, pair.exchanged) == (17.5, 9.5, True)
    assert [photo.principal_distance for photo in pair.as_given] == [19, 35]
    assert [photo.scale_number for photo in pair.as_given] == pytest.approx([500, 500])


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        (
            {"taking": Taking(d1=17.5, d2=9.5, c1=35)},
            InputError,
            "both principal distances or none",
        ),
        ({"taking": Taking(d1=17.5, d2=17.5)}, GeometryError, "same"),
        ({"taking": Taking(d1=-1.0, d2=9.5)}, InputError, "above zero"),
        ({"rules": ["three miles"]}, InputError, "nor a length"),
    ],
)
def test_options_that_cannot_be_used_are_named(changes, error, message):
    with pytest.raises(error, match=message):
        solve(columns(XYZ), **({"taking": Taking(**LENSES)} | changes))


def test_a_column_that_is_none_is_named():
    with pytest.raises(InputError, match="no column"):
        column_map("id=A,q=B")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"x9": [1.0]}, "no column 'x9'"),
        ({"x1": [1.0, 2.0], "y1": [1.0]}, "y1: has 1 values, expected 2"),
        ({"x1": ["a"], "y1": [1.0], "x2": [1.0], "y2": [1.0]}, "x1: expected numbers"),
        ({}, "there is no point"),
        ({"x1": 3.0}, r"x1: expected a list of values, one for each point, found shape \(\)"),
        ({"x1": [1.0], "y1": [[1.0, 2.0]]}, r"y1: expected a list of values.*\(1, 2\)"),
    ],
)
def test_columns_that_cannot_be_used_are_named(table, message):
    with pytest.raises(InputError, match=message):
        solve(table, taking=Taking(**LENSES))


def test_solved_points_are_placed_by_columns_of_control_points():
    survey = solve({"id": ["A", "B", "C", "D"], **columns(XYZ)}, taking=Taking(**LENSES))
    control = {"id": ["A", "B", "C"], "E": 100 + XYZ[:3, 0], "N": 200 - XYZ[:3, 2],
               "H": 50 + XYZ[:3, 1]}  # fmt: skip
    placed = georeference(survey.table, control)
    assert placed.world_from_wall(survey.table.xyz)[3] == pytest.approx([96, 200, 48.5], abs=1e-9)
    with pytest.raises(InputError, match="N: expected 3 values"):
        georeference(survey.table, control | {"N": [1.0]})
