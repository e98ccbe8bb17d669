"""Accuracy studies: closed forms, Monte Carlo, the papers' claims, the command."""

from __future__ import annotations

import json
import math
from contextlib import nullcontext
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from multimedia import (
    Camera,
    FlatInterface,
    GeometryError,
    InputError,
    Interfaces,
    Layers,
    ObjectPoints,
    Project,
    Sphere,
    calibration_costs,
    compare_placements,
    intersect,
    object_grid,
    project,
    ring_of_cameras,
    study_setup,
    write_project,
)
from multimedia.cli.design import DesignCommand
from multimedia.design.design_files import write_design_plot
from tests.builders.commands import multimedia_command as main

TANK = FlatInterface(layers=Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,)))
POINTS = object_grid((0.3, 0.2), (0.02, 0.2), count=5)
RIG = ring_of_cameras(
    4, 0.6, np.radians(30), interface=TANK, target=POINTS.mean(axis=0), principal_distance=25.0
)


def test_the_target_is_seen_in_the_middle_of_every_photo():
    for camera in RIG:
        np.testing.assert_allclose(project(camera, POINTS.mean(axis=0), TANK), 0, atol=1e-9)


def test_expected_precision_agrees_with_monte_carlo():
    point = POINTS[[17]]
    study = study_setup(RIG, [TANK] * 4, point, sigma_image=0.002)
    rng = np.random.default_rng(3)
    image = np.stack([project(c, point, TANK) for c in RIG])
    noisy = image + rng.normal(0, 0.002, (4, 4000, 2))
    found = intersect(RIG, noisy, TANK).xyz
    np.testing.assert_allclose(found.std(axis=0) / study.sigma[0], 1.0, atol=0.05)


def test_without_media_two_cameras_follow_the_textbook():
    # Normal case, in the middle: sigma Z = Z^2 / (b c) sqrt(2) sigma.
    height, base, c, sigma = 2.0, 0.4, 50.0, 0.004
    cameras = [
        Camera.from_angles((x, 0, height), 0, 0, 0, principal_distance=c)
        for x in (-base / 2, base / 2)
    ]
    study = study_setup(cameras, [None, None], np.zeros((1, 3)), sigma_image=sigma)
    expected = height**2 / (base * c) * np.sqrt(2) * sigma
    assert study.sigma[0, 2] == pytest.approx(expected, rel=1e-9)
    angle = 2 * np.arctan(base / 2 / height)
    assert study.angle[0] == pytest.approx(angle, rel=1e-9)


def test_refraction_makes_the_intersection_angle_smaller():
    study = study_setup(RIG, [TANK] * 4, POINTS, sigma_image=0.001)
    assert (study.angle < study.angle_in_air).all()


def test_sensitivities_are_what_a_wrong_index_does():
    study = study_setup(RIG, [TANK] * 4, POINTS, sigma_image=0.001, names=("t",) * 4)
    image = np.stack([project(c, POINTS, TANK) for c in RIG])
    for name, parameter, step in (("t:index3", "index3", 0.001), ("t:offset", "offset", 0.001)):
        wrong = TANK.stepped([parameter], [step])
        moved = intersect(RIG, image, wrong).xyz - POINTS
        rms = np.sqrt(np.mean(moved**2, axis=0))
        np.testing.assert_allclose(study.sensitivity[name], rms, rtol=0.03)


def test_wider_placements_give_better_depth():
    found = compare_placements(
        4, 0.6, interface=TANK, points=POINTS, principal_distance=25.0, sigma_image=0.001,
        half_angles=np.radians(np.arange(5, 61, 5)).tolist(),
    )  # fmt: skip
    depth = [p.sigma[2] for p in found]
    assert depth == sorted(depth, reverse=True)


@pytest.mark.parametrize(("seen_by", "works"), [((4, 4), True), ((4, 3), False)])
def test_an_opening_from_which_a_camera_does_not_see_every_point_is_left_out(
    monkeypatch, seen_by, works
):
    study = SimpleNamespace(seen_by=np.array(seen_by), rms_sigma=np.ones(3), angle=[1.0])
    monkeypatch.setattr("multimedia.design.accuracy.study_setup", lambda *_, **__: study)
    settings = {"interface": TANK, "points": POINTS, "principal_distance": 25.0}
    with nullcontext() if works else pytest.raises(GeometryError):
        assert compare_placements(4, 0.6, **settings, sigma_image=0.001, half_angles=[0.5])


def test_an_air_calibration_costs_in_water_and_a_new_one_regains_half():
    costs = calibration_costs(
        RIG, TANK, object_grid((0.3, 0.2), (0.02, 0.2), count=6), rng=np.random.default_rng(1),
        sigma_image=0.0005,
    )  # fmt: skip
    first, second, third = (
        np.linalg.norm(v) for v in (costs.air, costs.air_calibration_in_water, costs.water)
    )
    # Table 1: II about 5 times I, III about 2 times I.
    assert second > 3 * first
    assert 1.3 * first < third < 0.8 * second


def test_what_cannot_be_studied_is_refused():
    with pytest.raises(InputError, match="two cameras"):
        study_setup(RIG[:1], [TANK], POINTS, sigma_image=0.001)
    away = ring_of_cameras(
        2, 0.6, 0.3, interface=TANK, target=np.array([0, 0, -0.1]), principal_distance=25.0
    )
    with pytest.raises(GeometryError, match="no point is seen"):
        study_setup(away, [TANK] * 2, POINTS + np.array([0, 0, 5.0]), sigma_image=0.001)


ARGUMENTS = [
    "design", "--cameras", "3", "--distance", "0.6", "--c", "25", "--extent", "0.3x0.2",
    "--depths", "0.02x0.2", "--indices", "1,1.5,1.337", "--thicknesses", "0.01",
]  # fmt: skip


def test_the_command_prints_tables_and_writes_workbook_and_picture(tmp_path):
    out, plot = tmp_path / "d.xlsx", tmp_path / "d.png"
    result = CliRunner().invoke(main, [*ARGUMENTS, "--out", str(out), "--plot", str(plot)])
    assert result.exit_code == 0, result.stderr
    assert "III water" in result.stdout
    assert result.stdout.count("to first order") == 3
    assert openpyxl.load_workbook(out).sheetnames[:2] == ["Precision", "Sensitivity"]
    assert plot.read_bytes()[:4] == b"\x89PNG"
    data = json.loads(CliRunner().invoke(main, [*ARGUMENTS, "--json"]).stdout)
    models = {m["model"].split(":")[0]: m["rms"] for m in data["simplified_models"]}
    # Agrafiotis knows the share of air and water, Telem is fitted: each better than f times n.
    assert models["Lavest"] > models["Agrafiotis"] > models["Telem"]
    assert 0.001 < data["colour_seam_mm"] < 0.1
    assert data["by_depth"][0]["angle_deg"] < data["by_depth"][0]["angle_in_air_deg"]
    again = CliRunner().invoke(main, [*ARGUMENTS, "--out", str(out)])
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr


def test_missing_options_and_wrong_indices_are_named():
    result = CliRunner().invoke(main, ["design", "--distance", "1"])
    assert result.exit_code == 2
    assert "--depths" in result.stderr
    wrong = [a if a != "1,1.5,1.337" else "1,0.5,1.337" for a in ARGUMENTS]
    result = CliRunner().invoke(main, wrong)
    assert result.exit_code == 1
    assert "index" in result.stderr.lower()


def test_a_ring_takes_its_target_as_any_three_numbers() -> None:
    interface = FlatInterface(layers=Layers(indices=(1.0, 1.33)))
    rings = [
        ring_of_cameras(3, 0.6, 0.4, interface=interface, target=target, principal_distance=25.0)
        for target in ((0, 0, -0.1), [0.0, 0.0, -0.1], np.array([0.0, 0.0, -0.1]))
    ]
    for ring in rings[1:]:
        np.testing.assert_array_equal([c.centre for c in ring], [c.centre for c in rings[0]])
    with pytest.raises(InputError, match="target"):
        ring_of_cameras(3, 0.6, 0.4, interface=interface, target=(0, 0), principal_distance=25.0)


def test_a_ring_stands_before_its_faces_wherever_they_are() -> None:
    """A wall at X = 2, looked through along X: turned, it is the ring above the water at Z = 0."""
    layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    wall = FlatInterface(layers=layers, point=(2.0, 0.5, -0.3), normal=(1.0, 0.0, 0.0))
    given = {"principal_distance": 25.0}
    ring = ring_of_cameras(3, 0.6, 0.4, interface=wall, target=(1.9, 0.2, 0.1), **given)
    level = ring_of_cameras(
        3, 0.6, 0.4, interface=FlatInterface(layers=layers), target=(0, 0, -0.1), **given
    )
    for camera, other in zip(ring, level, strict=True):
        assert camera.centre[0] - 2.0 == pytest.approx(other.centre[2], abs=1e-12)
        away = np.hypot(camera.centre[1] - 0.2, camera.centre[2] - 0.1)
        assert away == pytest.approx(0.6 * np.sin(0.4), abs=1e-12)
        np.testing.assert_allclose(project(camera, (1.9, 0.2, 0.1), wall), 0, atol=1e-9)
    raised = FlatInterface(layers=layers, point=(0.0, 0.0, 5.0))
    high = ring_of_cameras(3, 0.6, 0.4, interface=raised, target=(0, 0, 4.9), **given)
    np.testing.assert_allclose(
        [c.centre - (0, 0, 5.0) for c in high], [c.centre for c in level], atol=1e-12
    )
    port = FlatInterface(layers=layers, point=(0, 0, -0.03), moves_with_camera=True)
    with pytest.raises(InputError, match="moves with the camera"):
        ring_of_cameras(3, 0.6, 0.4, interface=port, target=(0, 0, -1), **given)


def test_domes_and_graded_water_are_studied_too(tmp_path) -> None:
    views = [
        Camera.looking_at(eye, (0, 0, -0.5), principal_distance=20.0, name=name)
        for name, eye in (("left", (-0.4, 0, 0.6)), ("right", (0.4, 0.1, 0.7)))
    ]
    dome = Interfaces(
        surfaces=tuple(Sphere(centre=(0, 0.001, 0.008), radius=r) for r in (0.05, 0.06)),
        indices=(1.0, 1.5, 1.337), with_camera=(True, True), gradient=0.002,
    )  # fmt: skip
    xyz = np.random.default_rng(3).uniform((-0.2, -0.2, -0.7), (0.2, 0.2, -0.3), (12, 3))
    study = study_setup(views, [dome] * 2, xyz, sigma_image=0.001, names=("port",) * 2)
    for name, step in (("radius", 1e-3), ("centreZ", 1e-3), ("gradient", 1e-3), ("index3", 1e-3)):
        small = 0.01 * step
        other = dome.stepped([name], [small])
        image = np.stack([project(view, xyz, other) for view in views])
        moved = (intersect(views, image, dome).xyz - xyz) / 0.01
        found = study.sensitivity[f"port:{name}"]
        np.testing.assert_allclose(found, np.sqrt((moved**2).mean(axis=0)), rtol=0.02)
    content = Project(
        cameras=tuple(views), media={"port": dome}, media_of=("port",) * 2,
        object_points=ObjectPoints(ids=tuple(map(str, range(12))), xyz=xyz), unit="m",
    )  # fmt: skip
    write_project(tmp_path / "dome.toml", content)
    done = CliRunner().invoke(main, ["design", str(tmp_path / "dome.toml")])
    assert done.exit_code == 0, done.output
    assert "port:centreX" in done.stdout
    assert "0.001 per m" in done.stdout
    assert "needs cameras that all look through the same plane-parallel layers" in done.stderr


def test_the_plot_holds_no_empty_panel_and_no_curve_beyond_its_rim(monkeypatch, tmp_path):
    """Angles near 180 degrees, no cone to place, sigmas of micrometres in their own unit."""
    figures = []
    monkeypatch.setattr(
        "multimedia.design.design_files.write_figure",
        lambda _, figure, **__: figures.append(figure),
    )
    depth = np.linspace(0.02, 0.2, 4)
    by_depth = np.column_stack([depth, *(np.full(4, s) for s in (2e-5, 2e-5, 6e-5, 173.0, 171.0))])
    design = SimpleNamespace(by_depth=by_depth, placements=(), planarity=(), unit="m")
    write_design_plot(tmp_path / "design.png", design)
    precision, angles = figures[0].axes
    for axes in (precision, angles):
        low, high = axes.get_ylim()
        values = np.concatenate([line.get_ydata() for line in axes.lines])
        assert low == 0
        assert values.max() < 0.9 * high
    assert precision.get_ylabel() == "[µm]"
    np.testing.assert_allclose(precision.lines[2].get_ydata(), 60.0)


def test_noise_in_water_is_a_multiple_of_that_in_air():
    costs = calibration_costs(
        RIG, TANK, object_grid((0.3, 0.2), (0.02, 0.2), count=6), rng=np.random.default_rng(1),
        sigma_image=0.0005, index_error=0.0, tilt_error=0.0, water_noise=3.0,
    )  # fmt: skip
    np.testing.assert_allclose(costs.sigma0, (0.0005, 0.0015, 0.0015), rtol=0.05)


@pytest.mark.parametrize(
    ("depths", "told"),
    [
        ([k // 2 for k in range(48)], [2 * k + 0.5 for k in range(12)]),  # 24 levels, by twos
        ([0] * 20 + [*range(12)], [*range(12)]),  # 12, most of the points in the first
        ([0] * 20 + [*range(13)], [1 / 22, 2.5, 5, 8, 11]),  # 13: equal counts, 32 k / 12 points
    ],
)
def test_precision_is_told_for_at_most_twelve_depths(tmp_path, depths, told):
    across = np.linspace(-0.05, 0.05, len(depths))
    xyz = np.column_stack([across, 0.4 * across, -0.02 - 0.01 * np.array(depths)])
    content = Project(
        cameras=tuple(replace(c, name=f"cam{k}") for k, c in enumerate(RIG)), media={"tank": TANK},
        media_of=("tank",) * len(RIG), unit="m",
        object_points=ObjectPoints(ids=tuple(map(str, range(len(xyz)))), xyz=xyz),
    )  # fmt: skip
    write_project(tmp_path / "tank.toml", content)
    done = CliRunner().invoke(main, ["design", str(tmp_path / "tank.toml"), "--json"])
    found = [100 * row["depth"] - 2 for row in json.loads(done.stdout)["by_depth"]]
    np.testing.assert_allclose(found, told, atol=1e-9)


def test_the_cone_opens_by_as_much_in_python_as_on_the_command_line():
    defaults = {field.name: field.default for field in fields(DesignCommand)}
    assert math.degrees(defaults["half_angle"]) == pytest.approx(30.0)
    help_text = CliRunner().invoke(main, ["design", "--help"]).output
    assert "[default: 30.0" in " ".join(help_text.split())
