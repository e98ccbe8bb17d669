"""``bifocal demo``: what a newcomer sees first."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import bifocal
from bifocal import SAMPLE, WATER_SAMPLE, ReliefMap
from bifocal.demo.samples import FACADE, PICK_SIGMA, WATER
from bifocal.demo.workflow import run_demo
from tests.builders.commands import bifocal_command as main
from tests.scenes import demo_scene
from tests.scenes.refracted import pixels_of
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


@pytest.mark.acceptance
def test_the_demo_under_water_finds_the_truth_and_tells_what_neglect_costs(tmp_path):
    """3.5 and 1.9 m through flat ports, hazy; the RMS pull of 20 targets is 1 +- 0.16."""
    out = tmp_path / "demo"
    result = CliRunner().invoke(main, ["demo", "--water", "--out", str(out), "--json"])
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    assert {path.name for path in out.iterdir()} == set(data["files"])
    assert data["map_median"] < 0.0025
    assert data["map_known"] > 0.99
    assert 0.07 < data["median_neglecting_refraction"] < 0.09
    pulls = [(p["r"] - p["r_true"]) / p["sigma_r"] for p in data["points"]]
    assert len(pulls) >= 20
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.5
    # What it says neglect costs, from the files that it left: rays shot independently, no media.
    pair = bifocal.Pair.read(out / "facade.pair.json")
    truth, rng = ReliefMap.read(out / "truth.tif"), np.random.default_rng(8)
    places = rng.uniform(WATER.bounds[:2], WATER.bounds[2:], (40, 2))
    points = np.column_stack([places, truth.sample(places)])
    seen = [pixels_of(side.to_dict(), points, pair.layers.as_dict())
            for side in (pair.image1, pair.image2)]  # fmt: skip
    off = np.abs(pair.in_air().intersect(*seen).xyz[:, 2] - points[:, 2])
    assert np.median(off) == pytest.approx(data["median_neglecting_refraction"], rel=0.4)


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "demo").write_text("mine")
    result = CliRunner().invoke(main, ["demo", "--out", str(tmp_path / "demo")])
    assert result.exit_code == 1
    assert "demo" in result.stderr
    assert (tmp_path / "demo").read_text() == "mine"


def test_the_sample_under_water_is_what_bent_rays_show():
    """Exact pixels by rays shot in 50 digits; places and relief of the façade, a fifth as large."""
    pair = bifocal.Pair.read(WATER_SAMPLE / "facade.pair.json")
    with (WATER_SAMPLE / "targets.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))[::4]
    scene = demo_scene(texel=0.2)
    places = {target.name: target.position for target in scene.targets}
    places = np.array([places[row["id"]] for row in rows])
    relief = look_square_on(Tracer(scene), places)[0]
    points = np.column_stack([places, relief]) / 5
    stated = [float(row["r measured [m]"]) for row in rows]
    np.testing.assert_allclose(stated, points[:, 2], atol=6e-6)
    layers = pair.layers.as_dict()
    sides = (pair.image1.to_dict(), pair.image2.to_dict())
    pixels = np.hstack([pixels_of(side, points, layers) for side in sides])
    names = ("col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]")
    picks = np.array([[float(row[name]) for name in names] for row in rows])
    assert 0.5 * PICK_SIGMA < np.std(picks - pixels) < 1.6 * PICK_SIGMA
    truth = ReliefMap.read(WATER_SAMPLE / "truth.tif")
    known = np.abs(truth.sample(points[:, :2]) - points[:, 2])
    assert np.median(known) < 1e-4


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
    truth = ReliefMap.read(SAMPLE / "truth.tif")
    known = np.abs(truth.sample(points[:, :2]) - points[:, 2])
    assert np.median(known) < 1e-4


def test_the_demo_ends_with_its_figures_where_the_relief_is_the_truth(tmp_path, monkeypatch):
    """All but the dense matching, which takes most of its time."""

    def truth(pair_file, job, **_):
        shutil.copyfile(pair_file.with_name("truth.tif"), job.out)

    monkeypatch.setattr("bifocal.demo.workflow.relief_of_pair", truth)
    part = replace(FACADE, bounds=(-1.0, -1.0, 0.0, 0.0))
    result = run_demo(tmp_path / "demo", sample=part)
    assert (result.map_median, result.map_share, result.map_known) == (0.0, 0.0, 1.0)
    assert result.rmse < 0.02
    assert result.neglect is None
    assert {"result.xlsx", "ortho.tif", "ortho.png"} <= {p.name for p in result.folder.iterdir()}
