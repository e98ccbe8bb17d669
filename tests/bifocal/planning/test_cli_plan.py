"""``bifocal plan`` as a user runs it."""

from __future__ import annotations

import json

import openpyxl
import pytest
from click.testing import CliRunner

from tests.builders.commands import bifocal_command as main
from tests.workbook_lint import lint

CANON = ["--sensor", "22.7x15.1", "--pixels", "3072x2048"]
LENSES = ["--focal", "35", "--focal", "28", "--focal", "19"]


def run(*arguments):
    return CliRunner().invoke(main, ["plan", *arguments])


def test_the_table_names_the_best_pair_and_its_stations():
    result = run(*LENSES, *CANON, "--scale", "1:500")
    assert result.exit_code == 0
    assert "Best: 35 mm from 17.50 m and 19 mm from 9.50 m." in result.stdout


def test_json_is_one_object_and_nothing_else():
    result = run(*LENSES, *CANON, "--scale", "1:500", "--sigma-px", "1", "--json")
    data = json.loads(result.stdout)
    assert data["stations"][0]["sigma_r_rms"] == pytest.approx(0.0275, rel=0.01)
    assert data["sigma_r_over_frame"]["sigma_r"][3][4] is None


def test_the_workbook_holds_the_stations_and_two_charts_of_precision(tmp_path):
    out = tmp_path / "plan.xlsx"
    assert run(*LENSES, *CANON, "--scale", "500", "--out", str(out)).exit_code == 0
    book = openpyxl.load_workbook(out)
    assert book["Planning"]["B5"].value == pytest.approx(17.5)
    assert len(book["Planning"]._charts) == 1
    assert book["Sigma r"]["I9"].value == "nadir"
    assert lint(out) == []
    again = run(*LENSES, *CANON, "--scale", "500", "--out", str(out))
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr
    assert run(*LENSES, *CANON, "--scale", "500", "--out", str(out), "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("equivalents", "wall", "stations", "pixel"),
    [
        # A phone. By hand: 4:3 on a diagonal of 43.267 mm is 34.613 mm wide; 77 x 6 / 34.613.
        ((77, 24), "6x4", (13.35, 4.16), 0.0015),
        # A drone over a quarry, as docs/planning.md has it: 48 x 60 / 34.613.
        ((48, 24), "60x40", (83.21, 41.60), 0.015),
    ],
)
def test_equivalents_plan_for_phones_and_drones(equivalents, wall, stations, pixel):
    lenses = [part for c in equivalents for part in ("--equivalent", str(c))]
    data = json.loads(run(*lenses, "--pixels", "4000x3000", "--object", wall, "--json").stdout)
    best = data["stations"][0]
    assert (best["d1"], best["d2"]) == pytest.approx(stations, abs=0.005)
    assert best["gsd"] == pytest.approx(pixel, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--focal", "35", *CANON, "--scale", "500"], 1, "two different focal lengths"),
        ([*LENSES, "--sensor", "22.7", "--pixels", "3072x2048"], 2, "WIDTHxHEIGHT"),
        ([*LENSES, *CANON], 1, "size of the wall"),
        ([*LENSES, *CANON, "--scale", "one"], 2, "not a scale"),
        ([*LENSES, *CANON, "--gsd", "-2"], 2, "above zero"),
        ([*LENSES, *CANON, "--scale", "500", "--free-space", "5"], 1, "no pair of lenses fits"),
    ],
)
def test_mistakes_get_one_message_and_the_right_status(arguments, status, message):
    result = run(*arguments)
    assert result.exit_code == status
    assert message in result.stderr
    assert "Traceback" not in result.stderr


def test_units_and_endings_that_cannot_be_meant_are_named(tmp_path):
    tiny = run(*LENSES, *CANON, "--gsd", "0.004")
    assert tiny.exit_code == 1
    assert "in mm" in tiny.stderr
    ending = run(*LENSES, *CANON, "--scale", "500", "--out", str(tmp_path / "plan.pdf"))
    assert ending.exit_code == 1
    assert ".xlsx" in ending.stderr


def test_numbers_take_a_decimal_comma_and_say_what_they_are_not():
    comma = run("--focal", "35,0", "--focal", "19", *CANON, "--scale", "500")
    assert comma.exit_code == 0
    unit = run("--focal", "35mm", "--focal", "19", *CANON, "--scale", "500")
    assert unit.exit_code == 2
    assert "'35mm' is not a number" in unit.stderr
