"""``bifocal plan`` as a user runs it."""

from __future__ import annotations

import json

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from bifocal import PairMedia
from bifocal.planning.camera_plan import planned_pair, sigma_at
from tests.builders.commands import bifocal_command as main
from tests.office import recalculated, stored
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


@pytest.mark.acceptance
@pytest.mark.parametrize("language", ["en", "it", "de"])
@pytest.mark.office
def test_the_workbook_follows_what_is_changed_on_site(tmp_path, language):
    """Equal to the plan as written, and to the library after d1, c2, pixels and wall change."""
    out = tmp_path / "plan.xlsx"
    wishes = ["--object", "30x9", "--scale", "500", "--free-space", "15", "--language", language]
    assert run(*LENSES, *CANON, *wishes, "--out", str(out)).exit_code == 0
    shown, found = stored(out), recalculated(out, tmp_path / "office")
    for title, cells in shown.items():
        assert set(found[title]) >= {c for c, v in cells.items() if v != ""}
        for cell, value in cells.items():
            if value != "":
                wanted = value if isinstance(value, str) else pytest.approx(value, rel=1e-9)
                assert found[title][cell] == wanted, (title, cell)
    tabs = {"en": "Planning", "it": "Pianificazione", "de": "Planung"}
    assert list(shown) == [tabs[language], "Sigma r"]
    if language != "en":
        return
    book = openpyxl.load_workbook(out)
    sheet, places = book["Planning"], book.defined_names
    changed = {"pitch": 0.005, "px_across": 4000, "sigma_px": 0.8, "free_space": 12}
    for name, value in changed.items():
        sheet[places[name].attr_text.split("!")[1].replace("$", "")] = value
    sheet["B5"], sheet["C5"], sheet["E5"] = 13.2, 7.7, 18.5
    sheet["B6"] = 5.0
    book.save(tmp_path / "site.xlsx")
    found = recalculated(tmp_path / "site.xlsx", tmp_path / "office")
    heads = {value: cell[:-1] for cell, value in found["Planning"].items() if cell[1:] == "4"}
    row = {key: found["Planning"].get(f"{letter}5") for key, letter in heads.items()}
    c1 = row["c1"]
    pair = planned_pair(PairMedia.none(), (13.2, 7.7), (c1, 18.5), pitch=0.005, sigma_px=0.8)
    # What both photos show, by hand: columns x pitch x d/c of the smaller.
    width, height = (n * 0.005 * min(13.2 / c1, 7.7 / 18.5) for n in (4000, 2048))
    reach = np.hypot(width, height)
    wanted = sigma_at(pair, np.array([1.0, reach / np.sqrt(12), reach / 2])) * 1000
    assert [row[key] for key in ("width", "height")] == pytest.approx([width, height])
    names = ("sigma_1m", "sigma_rms", "sigma_corner")
    assert [row[key] for key in names] == pytest.approx(wanted, rel=1e-9)
    assert found["Sigma r"]["B4"] == pytest.approx(wanted[2], rel=1e-9)
    # 30 x 9 m, photos of 7.54 x 3.86 m that share a fifth: 1 + 22.46/6.03 and 1 + 5.14/3.09.
    assert (row["feasible"], row["photos"]) == ("no", "5 x 3")
    assert found["Planning"][f"{heads['sigma_1m']}6"] == "d1 > d2"
    assert not any(str(v).startswith("#") for cells in found.values() for v in cells.values())


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
