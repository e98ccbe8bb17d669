"""What the sheets say without the program: names, wide rays, a distance taped on site."""

from __future__ import annotations

import json
from dataclasses import replace

import openpyxl
import pytest

from bifocal import KnownPoints, PointObservations
from bifocal.survey.taped import TapedDistance
from bifocal.workbook.making.book import build
from tests.bifocal.workbook.filled_forms import SETUP, fill, rows, run
from tests.bifocal.workbook.test_alarms_without_us import WALL, typed, world
from tests.bifocal.workbook.test_survey_workbook import ideal_content, named, pair_content
from tests.recalculate import recalculated

TAPE = {"tape_from": "P1", "tape_to": "P2", "tape_typed": 5.4}


@pytest.mark.parametrize("make", [ideal_content, pair_content], ids=["ideal", "pair"])
def test_the_taped_distance_and_its_sigma_are_those_of_the_library(make):
    content = make()
    ends = (content.table.ids[4], content.table.ids[8])
    taped = TapedDistance(ends=ends, length=2.0).compared(content.table)
    built = build(replace(content, tape=taped.tape))
    assert built.value_of("tape_found") == pytest.approx(taped.solved, rel=1e-12)
    assert built.value_of("tape_sigma") == pytest.approx(taped.sigma, rel=1e-9)
    assert built.value_of("tape_scale") == pytest.approx(taped.scale, rel=1e-12)
    assert built.value_of("site_state").startswith(f"Taped {ends[0]} - {ends[1]}: 2 m, calculated")


def test_solve_reads_the_taped_distance_and_leaves_it_where_it_was_typed(tmp_path):
    # P1 and P2 lie at (2, 0, 1) and (-3, 2, 0.5): sqrt(25 + 4 + 0.25) = 5.4083 m.
    path = fill(tmp_path / "s.xlsx", setup={**SETUP, **TAPE})
    found = run("solve", path, "--out", path, "--overwrite", "--json")
    taped = json.loads(found.stdout)["taped"]
    assert taped["solved"] == pytest.approx(29.25**0.5, rel=1e-9)
    assert taped["scale"] == pytest.approx(29.25**0.5 / 5.4, rel=1e-9)
    assert "Taped P1 - P2: 5.4000 m, solved 5.4083 m" in run("solve", path).stdout
    book = openpyxl.load_workbook(path, data_only=True)
    assert [named(book, name).value for name in TAPE] == [*TAPE.values()]
    assert named(book, "tape_found").value == pytest.approx(taped["solved"], rel=1e-12)
    assert named(book, "title_world").value.startswith("Taped P1 - P2: 5.4 m, calculated 5.4083 m")


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ({"tape_typed": 3.6}, "solved as 5.408 m, scale 1.502 instead of 1"),
        ({"tape_to": "Q"}, "P1 or Q is no point with coordinates"),
        ({"tape_typed": -1.0}, "expected a length above zero"),
    ],
)
def test_a_taped_distance_that_says_something_is_said(cells, said, tmp_path):
    path = fill(tmp_path / "s.xlsx", setup={**SETUP, **TAPE, **cells})
    assert said in run("solve", path).stderr


def points_of(content, **changed):
    """Return the content with points that no library has solved, as somebody types them."""
    return replace(content, table=None, points=replace(content.points, **changed))


def test_a_name_that_stands_twice_is_named_and_names_that_differ_are_not():
    content = ideal_content()
    assert build(content).value_of("points_state").startswith("Give x1 y1 x2 y2")
    ids = (*content.points.ids[:-1], "P4")
    said = build(points_of(content, ids=ids)).value_of("points_state")
    assert said.startswith("P4 stands twice")


def test_names_that_no_point_has_are_counted_and_the_last_is_named():
    content = ideal_content()
    control = KnownPoints(ids=(*content.control.ids, "P99"), xyz=[*content.control.xyz, [1, 2, 3]])
    built = build(replace(content, table=None, georeference=None, control=control, language="de"))
    assert built.value_of("check_state") == "In Points unbekannt: 1 von 5 Namen (nowhere)."
    assert built.value_of("world_state").endswith("In Points unbekannt: 1 von 7 Namen (P99).")


def test_millimetres_that_no_lens_sees_are_doubted_above_the_points():
    picks = [[300.0, 20.0], [4.0, 2.0]]
    points = PointObservations(ids=("A", "B"), xy1=picks, xy2=picks)
    content = ideal_content()
    taking = replace(content.setup.taking, pitch=None, nadir1=None, nadir2=None)
    measuring = replace(content.setup.measuring, unit="mm")
    setup = replace(content.setup, taking=taking, measuring=measuring)
    said = build(points_of(replace(content, setup=setup, points=points))).value_of("points_state")
    # atan(300.7/19.01) = 86.4 degrees on the near photo, atan(300.7/35) = 83.4 on the far one.
    assert said.startswith("s is 300.7 mm on image 2 with c = 19.01 mm: 86 degrees off the axis")


def test_distances_typed_in_mm_are_doubted_above_the_points():
    content = ideal_content()
    taking = replace(content.setup.taking, d1=17500.0, d2=9500.0)
    setup = replace(content.setup, taking=taking)
    built = build(points_of(replace(content, setup=setup, pair=setup.pair(), georeference=None)))
    assert built.value_of("points_state").startswith("d_1 or d_2 is 17500 m. Distances are typed")


def test_results_say_that_nothing_on_site_checks_them_until_something_does():
    content = replace(ideal_content(), georeference=None, control=KnownPoints())
    said = "Nothing measured on site checks these results"
    assert build(replace(content, known=KnownPoints())).value_of("title_world").startswith(said)
    assert build(content).value_of("title_world") == ""
    assert pair_content().is_pair
    assert said not in build(pair_content()).value_of("title_world")


@pytest.mark.parametrize(
    ("name", "limits"), [("d_1", "0.1 500"), ("d_2", "0.1 500"), ("c_1", "1 3000")]
)
def test_cells_of_the_set_up_refuse_what_no_facade_is_taken_with(name, limits, tmp_path):
    book = openpyxl.load_workbook(fill(tmp_path / "s.xlsx"))
    cell = named(book, name).coordinate
    rules = book["Setup"].data_validations.dataValidation
    (rule,) = (rule for rule in rules if cell in rule.sqref)
    assert (rule.operator, f"{rule.formula1} {rule.formula2}") == ("between", limits)


@pytest.mark.office
@pytest.mark.acceptance
def test_another_program_says_the_same(tmp_path):
    picks = rows(WALL)
    picks[3] = (picks[0][0], *picks[3][1:])
    control = [*world(WALL[:3]), ("P99", 1, 2, 3)]
    path = typed(tmp_path / "s.xlsx", points=picks, control=control, known=[("Z", 1, 2, 3)])
    book = openpyxl.load_workbook(path)
    for name, value in (("tape_from", "A"), ("tape_to", "B"), ("tape_typed", 10.0)):
        named(book, name).value = value
    book.save(path)
    fresh = recalculated(path, tmp_path)
    assert named(fresh, "points_state").value.startswith("A stands twice")
    assert named(fresh, "check_state").value == "Unknown in Points: 1 of 1 names (Z)."
    assert "Unknown in Points: 1 of 4 names (P99)." in named(fresh, "world_state").value
    assert named(fresh, "tape_found").value == pytest.approx(10.0, abs=0.02)
    assert named(fresh, "title_world").value.endswith(named(fresh, "site_state").value)
