"""``bifocal demo``: what a newcomer sees first."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner

import bifocal
from bifocal.cli.main import main
from bifocal.demo import SAMPLE
from bifocal.demo.workflow import PICK_SIGMA
from bifocal.files.geotiff import read_relief
from tests.scenes import demo_scene
from tests.scenes.tracing import Tracer
from tests.scenes.truth import look_square_on


@pytest.mark.acceptance
def test_the_demo_finds_the_truth_and_says_where_the_results_lie(tmp_path):
    out = tmp_path / "demo"
    result = CliRunner().invoke(main, ["demo", "--out", str(out), "--json"])
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    assert {path.name for path in out.iterdir()} == set(data["files"])
    assert data["map_median"] < 0.003
    pulls = [(p["r"] - p["r_true"]) / p["sigma_r"] for p in data["points"] if p["flag"] == "OK"]
    assert np.abs(pulls).max() < 4.5
    again = CliRunner().invoke(main, ["demo", "--out", str(out)])
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "demo").write_text("mine")
    result = CliRunner().invoke(main, ["demo", "--out", str(tmp_path / "demo")])
    assert result.exit_code == 1
    assert "demo" in result.stderr
    assert (tmp_path / "demo").read_text() == "mine"


def test_the_sample_that_ships_is_what_the_scene_gives():
    # Exact pixels, not the picture: 0.2 px picks, rounded to 0.001 px, relief to 0.01 mm.
    pair = bifocal.Pair.read(SAMPLE / "facade.pair.json")
    with (SAMPLE / "targets.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 20
    scene = demo_scene(texel=0.2)
    places = {target.name: target.position for target in scene.targets}
    places = np.array([places[row["id"]] for row in rows])
    relief = look_square_on(Tracer(scene), places)[0]
    points = np.column_stack([places, relief])
    np.testing.assert_allclose([float(row["r measured [m]"]) for row in rows], relief, atol=6e-6)
    pixels = np.hstack(pair.project(points))
    names = ("col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]")
    picks = np.array([[float(row[name]) for name in names] for row in rows])
    assert np.std(picks - pixels) == pytest.approx(PICK_SIGMA, rel=0.25)
    truth = read_relief(SAMPLE / "truth.tif")
    known = np.abs(truth.sample(points[:, :2]) - points[:, 2])
    assert np.median(known) < 1e-4
