"""Bent, wedged and wavy faces: their cost against least time and least squares by scipy."""

from __future__ import annotations

import json

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner
from scipy.optimize import least_squares, root

from multimedia import Camera, FlatInterface, InputError, Interfaces, Layers, Placement
from multimedia.design import planarity
from multimedia.design.planarity import SAG, SLOPE, WEDGE, planarity_study
from multimedia.design.studies import best_placement
from tests.builders.commands import multimedia_command as main

C, N, GLASS = 24.0, (1.0, 1.5, 1.337), 0.01
TANK = FlatInterface(layers=Layers(indices=N, thicknesses=(GLASS,)))
EYES = np.array([[-0.2, 0.03, 0.5], [0.22, -0.02, 0.52]])
CAMERAS = [Camera.looking_at(eye, (0, 0, -0.1), principal_distance=C) for eye in EYES]
POINT = np.array([0.03, -0.02, -0.15])


def crossings(eye, point, upper, lower):
    """Return the points of least time on two height functions of (x, y), start straight."""

    def corners(q):
        a, b = q[:2], q[2:]
        return np.array([eye, [*a, upper(a)], [*b, lower(b)], point])

    def time(q):
        return (np.linalg.norm(np.diff(corners(q), axis=0), axis=1) * N).sum()

    def slope(q, step=1e-4):
        h = step * np.eye(4)
        near, far = (
            np.array([(time(q + k * d) - time(q - k * d)) / (2 * k * step) for d in h])
            for k in (1, 2)
        )
        return (4 * near - far) / 3

    share = eye[2] / (eye[2] - point[2])
    start = (eye + share * (point - eye))[:2]
    return corners(root(slope, np.tile(start, 2), tol=1e-13).x)


def displaced(upper, lower):
    """Return where the point is put that was seen through these faces, as if they were plane."""
    flat = (lambda _: GLASS), (lambda _: 0.0)

    def images(point, faces):
        seen = []
        for camera in CAMERAS:
            corners = crossings(camera.centre, point, *faces)
            x, y, z = (corners[1] - corners[0]) @ camera.rotation
            seen += [-C * x / z, -C * y / z]
        return np.array(seen)

    wanted = images(POINT, (upper, lower))
    found = least_squares(lambda p: images(p, flat) - wanted, POINT, xtol=1e-15, x_scale=0.01)
    return found.x - POINT


def study() -> dict:
    """Return the study at the one point, by kind."""
    found = planarity_study(CAMERAS, [TANK] * 2, POINT[None], expected=1e-5)
    assert [d.kind for d in found] == ["bend", "wedge", *["waves"] * 5]
    return {d.kind if d.kind != "waves" else i: d for i, d in enumerate(found)}


def footprint() -> tuple[np.ndarray, float]:
    """Return middle and width of what the rays cross of the last face."""
    met = np.array([crossings(eye, POINT, lambda _: GLASS, lambda _: 0.0)[2][:2] for eye in EYES])
    middle = (met.max(axis=0) + met.min(axis=0)) / 2
    return middle, 2 * np.linalg.norm(met - middle, axis=1).max()


def test_bend_and_wedge_cost_what_least_time_says():
    found, (middle, width) = study(), footprint()
    sag = SAG * 1e-3
    radius = width**2 / (8 * sag)

    def cap(height):
        return lambda xy: height - ((xy - middle) ** 2).sum() / (2 * radius)

    moved = displaced(cap(GLASS), cap(0.0))
    np.testing.assert_allclose(found["bend"].shift, np.abs(moved), rtol=2e-3, atol=2e-9)
    wedges = [displaced(lambda _: GLASS, lambda xy, k=k: -WEDGE * (xy - middle)[k]) for k in (0, 1)]
    expected = np.sqrt(np.mean(np.square(wedges), axis=0))
    np.testing.assert_allclose(found["wedge"].shift, expected, rtol=2e-3, atol=2e-9)
    total = np.linalg.norm(expected)
    assert found["wedge"].allowed == pytest.approx(WEDGE * 1e-5 / total, rel=2e-3)


@pytest.mark.acceptance
def test_waves_cost_what_least_time_says():
    found, (_, width) = study(), footprint()
    for k, share in ((2, 2.0), (3, 1.0), (4, 0.5)):
        number = 2 * np.pi / (share * width)
        moved = [
            displaced(
                lambda _: GLASS,
                lambda xy, a=axis, p=phase, n=number: SLOPE / n * np.cos(n * xy[a] + p),
            )
            for axis in (0, 1) for phase in (0.0, np.pi / 2)
        ]  # fmt: skip
        expected = np.sqrt(np.mean(np.square(moved), axis=0))
        np.testing.assert_allclose(found[k].shift, expected, rtol=5e-3, atol=5e-9)
        assert found[k].wavelength == pytest.approx(share * width, rel=1e-6)


def test_a_wall_and_a_port_cost_what_a_water_surface_does():
    """The same set-up turned into a wall, and with faces given in the frame of the cameras."""
    points = np.array([POINT, [-0.05, 0.04, -0.08]])
    level = planarity_study(CAMERAS, [TANK] * 2, points, expected=1e-5)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    wall = FlatInterface(layers=TANK.layers, point=(0, 0, 0), normal=turn @ (0, 0, 1))
    turned = [
        Camera(centre=turn @ c.centre, rotation=turn @ c.rotation, principal_distance=C)
        for c in CAMERAS
    ]
    upright = planarity_study(turned, [wall] * 2, points @ turn.T, expected=1e-5)
    for one, other in zip(level, upright, strict=True):
        np.testing.assert_allclose(turn @ one.shift, other.shift, rtol=1e-6, atol=1e-12)
    ports = [
        FlatInterface(
            layers=TANK.layers, point=c.rotation.T @ -c.centre, normal=c.rotation.T @ (0, 0, 1),
            moves_with_camera=True,
        )
        for c in CAMERAS
    ]  # fmt: skip
    housed = planarity_study(CAMERAS, ports, points, expected=1e-5)
    assert [d.kind for d in housed] == [d.kind for d in level]
    assert all(0 < d.allowed < 1 for d in housed)


def test_media_that_are_no_layers_are_refused():
    other = Interfaces.parallel(TANK.layers)
    with pytest.raises(InputError, match="plane-parallel"):
        planarity_study(CAMERAS, [other] * 2, POINT[None], expected=1e-5)


def test_faces_between_media_of_one_index_may_be_as_they_like():
    none = FlatInterface(layers=Layers(indices=(1.337,) * 3, thicknesses=(GLASS,)))
    study = planarity_study(CAMERAS, [none] * 2, POINT[None] + 0.01 * np.eye(3), expected=1e-5)
    assert [one.allowed for one in study] == [np.inf] * len(study)


def test_the_best_placement_says_when_better_ones_may_lie_beyond():
    def places(*sigmas):
        return [Placement(half_angle=0.1 * k, sigma=(s,) * 3, angle=0.2) for k, s in
                enumerate(sigmas)]  # fmt: skip

    assert best_placement(places(3.0, 1.0, 2.0))[1] is False
    assert best_placement(places(3.0, 2.0, 1.0))[1] is True


def test_the_command_studies_flatness_and_ends_its_search_within(tmp_path):
    plot, out = tmp_path / "d.png", tmp_path / "d.xlsx"
    arguments = [
        "design", "--cameras", "2", "--distance", "0.6", "--c", "25", "--extent", "0.3x0.2",
        "--depths", "0.02x0.2", "--indices", "1,1.5,1.337", "--thicknesses", "0.01", "--flatness",
    ]  # fmt: skip
    result = CliRunner().invoke(main, [*arguments, "--plot", str(plot), "--out", str(out)])
    assert result.exit_code == 0, result.stderr
    assert "mrad" in result.stdout
    assert "sag" in result.stdout
    assert "no optimum" not in result.stdout
    assert plot.stat().st_size > 10_000
    assert openpyxl.load_workbook(out)["Flatness"].max_row == 8


@pytest.mark.acceptance
def test_the_study_of_flatness_is_told_as_data():
    arguments = [
        "design", "--distance", "0.6", "--c", "25", "--extent", "0.3x0.2", "--depths", "0.02x0.2",
        "--flatness", "--json",
    ]  # fmt: skip
    data = json.loads(CliRunner().invoke(main, arguments).stdout)
    # One face alone has no wedge.
    assert [d["kind"] for d in data["planarity"]] == ["bend", *["waves"] * 5]


def test_sights_that_the_figures_leave_out_are_counted(monkeypatch):
    """Every ray of one camera through waves is lost: no point is seen by two."""
    whole = planarity_study(CAMERAS, [TANK] * 2, np.array([POINT, POINT + 0.01]), expected=1e-5)
    assert [one.left_out for one in whole] == [0] * len(whole)
    real = planarity.project

    def losing(camera, points, faces):
        pixels = np.array(real(camera, points, faces))
        if camera.centre[0] > 0:
            pixels[0] = np.nan
        return pixels

    monkeypatch.setattr(planarity, "project", losing)
    partly = planarity_study(CAMERAS, [TANK] * 2, np.array([POINT, POINT + 0.01]), expected=1e-5)
    assert [one.left_out for one in partly] == [1, 2, *[4] * 5]
