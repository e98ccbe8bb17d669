"""`bifocal solve` with a pair that looks through glass and water."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import Measuring, Pair, solve
from bifocal.workbook.formulas.setup_cells import formulas
from tests.bifocal.model.test_pair_through_media import PAIRS, POINTS, content
from tests.builders.commands import bifocal_command as main
from tests.scenes.refracted import pixels_of

NAMES = ("port", "tank", "surface", "oblique", "leaning port")


def measured(name, points=POINTS):
    """Return a table of the pixels that shot rays give."""
    one, two = (pixels_of(side, points, PAIRS[name][0]) for side in PAIRS[name][1:])
    return {
        "id": [f"P{i}" for i in range(len(points))],
        "col1": one[:, 0],
        "row1": one[:, 1],
        "col2": two[:, 0],
        "row2": two[:, 1],
    }


@pytest.mark.parametrize("name", NAMES)
def test_points_come_out_where_they_are(name):
    pair = Pair.from_dict(content(name))
    table = solve(measured(name), pair=pair, measuring=Measuring(sigma_px=0.3)).table
    np.testing.assert_allclose(table.xyz, POINTS, atol=1e-9)
    # At the reference plane relief moves nothing, whatever the water does.
    assert abs(table["e1"][0]) < 1e-8
    assert set(table.flags) <= {"OK", "ON-PLANE", "WEAK", "UNCERTAIN"}


@pytest.mark.parametrize("name", NAMES)
def test_the_table_is_the_intersection_of_the_pair(name):
    """Picks of 0.4 px of noise: columns, sigmas and tests are those of `Pair.intersect`."""
    pair, rng = Pair.from_dict(content(name)), np.random.default_rng(8)
    picks = measured(name)
    for key in ("col1", "row1", "col2", "row2"):
        picks[key] = picks[key] + rng.normal(0, 0.4, len(POINTS))
    table = solve(picks, pair=pair, measuring=Measuring(sigma_px=0.4)).table
    pixels = [np.stack([picks[f"col{i}"], picks[f"row{i}"]], axis=-1) for i in (1, 2)]
    found = pair.intersect(*pixels, sigma_px=0.4)
    np.testing.assert_allclose(table.xyz, found.xyz, atol=1e-12)
    np.testing.assert_allclose(table["sigma_r"], found.sigma[:, 2], rtol=1e-9)
    np.testing.assert_allclose(table.covariance, found.covariance, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(table.standardised, found.standardised, rtol=1e-9)
    np.testing.assert_allclose(table["ds"] / table["den"], table["r"], rtol=1e-12, atol=1e-14)
    assert table.flags == found.flags


def test_the_command_solves_a_text_table(tmp_path):
    pair_file, points, out = (tmp_path / n for n in ("tank.pair.json", "p.csv", "solved.csv"))
    pair_file.write_text(json.dumps(content("tank")))
    picks = measured("tank")
    rows = zip(*picks.values(), strict=True)
    head = "id,col1 [px],row1 [px],col2 [px],row2 [px]\n"
    points.write_text(head + "".join(",".join(map(str, row)) + "\n" for row in rows))
    given = ["solve", str(points), "--pair", str(pair_file), "--json", "--out", str(out)]
    done = CliRunner().invoke(main, given)
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)["points"]
    np.testing.assert_allclose([[p["X"], p["Y"], p["r"]] for p in found], POINTS, atol=1e-9)
    assert out.read_text().count("\n") >= len(POINTS)


def test_millimetres_are_carried_to_pixels_without_bending_them():
    data = content("tank")
    for side in ("image1", "image2"):
        data[side]["principal_distance"] = 1000 * data[side]["distance"] / 100
    pair, table = Pair.from_dict(data), measured("tank")
    xy = [
        photo.apparent_from_pixels(np.stack([table[f"col{i}"], table[f"row{i}"]], axis=-1)) * 10
        for i, photo in ((1, pair.image1), (2, pair.image2))
    ]
    picks = {"id": table["id"], "x1": xy[0][:, 0], "y1": xy[0][:, 1]}
    picks |= {"x2": xy[1][:, 0], "y2": xy[1][:, 1]}
    np.testing.assert_allclose(solve(picks, pair=pair).table.xyz, POINTS, atol=1e-9)


def test_what_neglecting_refraction_costs_is_said():
    """The points as a pair in air makes them, from the same pixels."""
    data, picks = content("tank"), measured("tank")
    dry = {key: value for key, value in data.items() if key != "layers"}
    off = solve(picks, pair=Pair.from_dict(dry)).table.xyz - POINTS
    said = solve(picks, pair=Pair.from_dict(data)).remarks[-1]
    assert f"up to {np.abs(off[:, 2]).max():.3f} m" in said
    assert f"places by up to {np.hypot(*off[:, :2].T).max():.3f} m" in said
    assert np.abs(off[:, 2]).max() > 0.05


@pytest.mark.parametrize("media", [2, 3, 5])
def test_the_least_index_of_the_set_up_is_that_of_all_its_media(media):
    """The last one may be the thinnest: air behind a pane, seen from under water."""
    used = re.findall(r"n_used_(\d)", formulas(media=media)["n_least"])
    assert used == [str(number) for number in range(1, media + 1)]
