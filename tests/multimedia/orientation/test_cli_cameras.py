"""The commands project, intersect, resect, epipolar and openptv, from file to file."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    FlatInterface,
    ImagePoints,
    InputError,
    ObjectPoints,
    Project,
    read_project,
    write_project,
)
from multimedia.cli.main import main
from multimedia.orientation.workflow import intersect_project
from tests.multimedia.tank import LAYERS, cameras, control, images

COMMANDS = ("project", "intersect", "resect", "epipolar", "openptv")
POINTS = control(30)
IDS = tuple(f"P{k}" for k in range(30))


@pytest.fixture
def tank(tmp_path: Path) -> Path:
    views = cameras()
    write_project(
        tmp_path / "tank.toml",
        Project(
            cameras=tuple(views), unit="mm", sigma_image=0.001,
            media={"tank": FlatInterface(layers=LAYERS)}, media_of=("tank",) * 4,
            object_points=ObjectPoints(ids=IDS, xyz=POINTS),
            image_points=ImagePoints(
                cameras=tuple(c.name for c in views for _ in IDS), ids=IDS * 4,
                image=images(views, POINTS).reshape(-1, 2),
            ),
        ),
    )  # fmt: skip
    return tmp_path / "tank.toml"


def run(*words: object, status: int = 0):
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == status, result.output
    return result


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_units_defaults_and_an_example(name):
    text = run(name, "--help").output
    assert "Example" in text
    assert f"multimedia {name}" in text
    from importlib import import_module

    assert import_module(f"multimedia.cli.{name}").command.short_help == main.summaries[name]


def test_project_prints_pixels_and_writes_a_table(tank, tmp_path):
    out = tmp_path / "images.csv"
    found = json.loads(run("project", tank, "--json", "--out", out).stdout)
    assert len(found["points"]) == 120
    seen = {(p["camera"], p["id"]): (p["x"], p["y"]) for p in found["points"]}
    want = images(cameras(), POINTS)
    assert seen["cam3", "P7"] == pytest.approx(want[2, 7], abs=1e-11)
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["camera"] == "cam1"
    assert float(rows[0]["x [mm]"]) == pytest.approx(want[0, 0, 0], abs=1e-11)


def test_what_project_writes_intersect_reads(tank, tmp_path):
    run("project", tank, "--out", tmp_path / "images.xlsx")
    again = run("intersect", tank, "--points", tmp_path / "images.xlsx", "--json")
    for point in json.loads(again.stdout)["points"]:
        want = POINTS[IDS.index(point["id"])]
        assert [point[a] for a in "XYZ"] == pytest.approx(want, abs=1e-9)
        assert point["status"] == "ok"


@pytest.mark.parametrize("method", ["rigorous", "rays", "pairs"])
def test_intersect_gives_the_points_by_every_method(tank, method):
    result = run("intersect", tank, "--method", method, "--json")
    found = json.loads(result.stdout)["points"]
    xyz = np.array([[p[a] for a in "XYZ"] for p in found])
    assert np.abs(xyz - POINTS).max() < 1e-9
    text = run("intersect", tank, "--method", method).output
    assert "against 30 known points" in text


@pytest.mark.parametrize("wrong", [0, 2])
def test_the_camera_of_a_wrong_match_is_named_in_the_table(tank, wrong):
    project = read_project(tank)
    points = project.image_points
    image = points.image.copy()
    image[wrong * 30 + 11] += (0.05, 0.03)
    write_project(tank, replace(project, image_points=replace(points, image=image)), overwrite=True)
    found = json.loads(run("intersect", tank, "--json").stdout)["points"]
    suspects = {row["id"]: row["suspect"] for row in found if row.get("suspect")}
    assert suspects == {"P11": project.cameras[wrong].name}


def test_resect_orients_calibrates_and_writes_the_project(tank, tmp_path):
    text = tank.read_text()
    poor = re.sub(r"kappa = [-\d.]+", "kappa = 100.0", re.sub(r"\nc = [\d.]+", "\nc = 24.0", text))
    tank.write_text(poor)
    out, residuals = tmp_path / "oriented.toml", tmp_path / "residuals.csv"
    result = run(
        "resect", tank, "--estimate", "c", "--out", out, "--residuals", residuals, "--json"
    )
    found = json.loads(result.stdout)
    assert [c["name"] for c in found["cameras"]] == ["cam1", "cam2", "cam3", "cam4"]
    for shown, truth, read in zip(
        found["cameras"], cameras(), read_project(out).cameras, strict=True
    ):
        assert shown["sigma0_um"] < 1e-6
        assert shown["omega"] == pytest.approx(np.degrees(truth.angles[0]), abs=1e-8)
        assert read.principal_distance == pytest.approx(truth.principal_distance, abs=1e-8)
    assert len(residuals.read_text().splitlines()) == 121
    assert "sigma0" in run("resect", out).output


def test_image_points_without_an_object_point_are_named(tank):
    table = tank.with_name("tank_image_points.csv")
    table.write_text(table.read_text().replace("cam2,P3,", "cam2,Q3,"))
    result = run("resect", tank, "--camera", "cam2")
    assert "1 image points have no object point of their name" in result.stderr
    assert "Q3" in result.stderr


def test_epipolar_lists_candidates_and_draws_them(tank, tmp_path):
    picture, table = tmp_path / "curves.png", tmp_path / "curves.csv"
    result = run(
        "epipolar", tank, "--camera", "cam1", "--to", "cam3", "--point", "P5", "--json",
        "--picture", picture, "--out", table,
    )  # fmt: skip
    found = json.loads(result.stdout)
    own = [c for c in found["candidates"] if c["target"] == "P5"]
    assert own[0]["distance"] < 5e-4
    assert own[0]["Z"] == pytest.approx(POINTS[5, 2], abs=1e-9)
    assert picture.read_bytes()[1:4] == b"PNG"
    assert len(table.read_text().splitlines()) == 1 + len(found["curves"][0]["image"])
    drawn = tmp_path / "curves.svg"
    run("epipolar", tank, "--camera", "cam1", "--to", "cam3", "--at", "640,512", "--picture", drawn)
    assert 'id="depth-marks"' in drawn.read_text()


def test_openptv_goes_there_and_back(tmp_path):
    # OpenPTV measures the glass from the origin: move the origin into the water.
    views = [
        type(c)(
            centre=c.centre + np.array([0, 0, 100.0]), rotation=c.rotation, sensor=c.sensor,
            principal_distance=c.principal_distance, name=c.name,
        )
        for c in cameras()
    ]  # fmt: skip
    wall = FlatInterface(layers=LAYERS, point=(0, 0, 100))
    body = ObjectPoints(ids=tuple(map(str, range(1, 31))), xyz=POINTS + np.array([0, 0, 100.0]))
    from multimedia import project

    image = np.concatenate([project(c, body.xyz, wall) for c in views])
    write_project(
        tmp_path / "high.toml",
        Project(
            cameras=tuple(views), unit="mm", media={"t": wall}, media_of=("t",) * 4,
            object_points=body,
            image_points=ImagePoints(
                cameras=tuple(c.name for c in views for _ in body.ids), ids=body.ids * 4,
                image=image,
            ),
        ),
    )  # fmt: skip
    run("openptv", tmp_path / "high.toml", "--export", tmp_path / "exp")
    result = run("openptv", tmp_path / "exp", "--out", tmp_path / "back.toml", "--json")
    found = json.loads(result.stdout)
    assert [c["control_points"] for c in found["cameras"]] == [30] * 4
    again = run("resect", tmp_path / "back.toml", "--json")
    assert max(c["sigma0_um"] for c in json.loads(again.stdout)["cameras"]) < 1e-4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("intersect", "none.toml"), "none.toml: no such project file"),
        (("openptv", "none"), "none: is no folder"),
        (("resect", "{tank}", "--estimate", "focal"), "focal is no camera parameter"),
        (("resect", "{tank}", "--camera", "cam9"), "no camera is called cam9"),
        (("epipolar", "{tank}", "--camera", "cam1", "--to", "cam1"), "name the same camera"),
        (
            ("epipolar", "{tank}", "--camera", "cam1", "--to", "cam2", "--point", "X"),
            "no image point called X",
        ),
        (("project", "{tank}", "--out", "{tank}"), "one of the files that are read"),
        (("project", "{tank}", "--out", "{folder}/a.txt"), "written as .csv or .xlsx"),
    ],
)
def test_bad_input_is_one_message_and_status_1(tank, words, message):
    filled = [str(w).format(tank=tank, folder=tank.parent) for w in words]
    result = run(*filled, status=1)
    assert message in result.stderr
    assert "Traceback" not in result.output
    assert not result.stdout


def test_wrong_usage_is_status_2(tank):
    run("epipolar", tank, "--camera", "cam1", "--to", "cam2", "--at", "middle", status=2)
    run("intersect", tank, "--method", "guess", status=2)
    with pytest.raises(InputError, match="method: 'guess' is not one of rigorous, rays, pairs"):
        intersect_project(Path(tank), points=None, out=None, method="guess")


def test_as_many_parameters_as_coordinates_leave_no_precision_and_that_is_said(tank):
    table = tank.with_name("tank_image_points.csv")
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0], *lines[1:4]]) + "\n")
    result = run("resect", tank, "--camera", "cam1")
    assert "nothing checks them" in result.stderr
    assert "sigma0 unknown" in result.stdout
    assert "nan" not in result.stdout


def test_radians_in_a_project_file_are_suspected(tank):
    text = tank.read_text()
    for name in ("omega", "phi", "kappa"):
        text = re.sub(
            rf"{name} = ([-\d.e]+)", lambda m, n=name: f"{n} = {np.radians(float(m[1]))!r}", text
        )
    tank.write_text(text.replace("np.float64(", "").replace(")", ""))
    result = run("intersect", tank)
    assert "in radians?" in result.stderr
