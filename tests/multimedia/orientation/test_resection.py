"""Resection: truth from perfect data, statistics from noisy data, and what it refuses."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from multimedia import (
    Brown,
    Camera,
    ConvergenceError,
    FlatInterface,
    GeometryError,
    InputError,
    Interfaces,
    Layers,
    Sphere,
    project,
    resect,
)
from multimedia.media.camera import EXTERIOR, INTERIOR
from multimedia.orientation import pose_starts
from photocore.camera.rotation import world_from_camera
from tests.builders.pinholes import rotation_from_vector
from tests.multimedia.tank import LAYERS, cameras, control, images

CALIBRATION = ("c", "xh", "yh", "k1", "p1", "p2", "scale")


def nothing_known(camera: Camera) -> Camera:
    """Return a camera of the same make that stands and looks anywhere."""
    return replace(
        camera, centre=np.array([500.0, -900.0, 2500.0]), rotation=world_from_camera(1.0, 0.4, 2.0)
    )


@pytest.mark.parametrize("number", range(4))
def test_a_camera_is_found_without_start_values(number):
    truth, points = cameras()[number], control()
    found = resect(nothing_known(truth), points, project(truth, points, LAYERS), LAYERS)
    assert np.abs(found.camera.centre - truth.centre).max() < 1e-9
    assert np.abs(found.camera.rotation - truth.rotation).max() < 1e-12
    assert found.sigma0 < 1e-12


def test_interior_orientation_and_distortion_come_back_through_the_water():
    truth, points = cameras(Brown(k1=2e-5, k2=3e-8, k3=-1e-11, p1=1e-5, p2=-2e-5, scale=1.0005,
                                  shear=0.0003))[1], control()  # fmt: skip
    start = replace(
        nothing_known(truth), principal_distance=24.0, principal_point=np.zeros(2),
        distortion=Brown(),
    )  # fmt: skip
    found = resect(start, points, project(truth, points, LAYERS), LAYERS, estimate=INTERIOR)
    for name in EXTERIOR + INTERIOR:
        value = truth.value(name)
        assert found.camera.value(name) == pytest.approx(value, abs=1e-9 * max(1, abs(value))), name


@pytest.mark.parametrize(
    ("name", "true_c"), [("the length that optv returns as 70.0003", 71.0), ("a short lens", 9.0)]
)
def test_the_principal_distance_is_found_from_a_start_one_millimetre_off(name, true_c):  # noqa: ARG001
    points = control(270)
    truth = Camera.looking_at((30, 40, 700), (0, 0, -80), principal_distance=true_c)
    layers = Layers(indices=(1.0, 1.46, 1.33), thicknesses=(6.0,))
    start = replace(truth, principal_distance=true_c - 1.0)
    found = resect(start, points, project(truth, points, layers), layers,
                   estimate=("c", "xh", "yh"))  # fmt: skip
    assert found.camera.principal_distance == pytest.approx(true_c, abs=1e-9)
    assert np.abs(found.camera.centre - truth.centre).max() < 1e-8


def test_a_flat_target_and_a_camera_in_water_suffice():
    truth = cameras(Brown())[2]
    flat = control(40) * (1, 1, 0) - (0, 0, 90)
    found = resect(nothing_known(truth), flat, project(truth, flat, LAYERS), LAYERS)
    assert np.abs(found.camera.centre - truth.centre).max() < 1e-8
    diver = Layers(indices=(1.337, 1.0), thicknesses=())
    found = resect(nothing_known(truth), flat, project(truth, flat, diver), diver)
    assert np.abs(found.camera.centre - truth.centre).max() < 1e-8


def test_a_camera_in_a_flat_port_housing_is_found():
    truth = Camera.from_angles((100, -50, -900), 0.1, 0.2, 0.3, principal_distance=25.0)
    port = FlatInterface(
        layers=LAYERS, point=(0, 0, -60), normal=(0.03, -0.02, 1), moves_with_camera=True
    )
    local = np.random.default_rng(1).uniform((-300, -200, -1500), (300, 200, -700), (30, 3))
    points = local @ truth.rotation.T + truth.centre
    found = resect(nothing_known(truth), points, project(truth, points, port), port)
    assert np.abs(found.camera.centre - truth.centre).max() < 1e-8


def test_a_camera_behind_a_dome_off_its_centre_is_found():
    truth = Camera.from_angles((100, -50, -900), 0.1, 0.2, 0.3, principal_distance=25.0)
    dome = Interfaces(
        surfaces=tuple(Sphere(centre=(2, -1, 5), radius=r) for r in (80, 85)),
        indices=(1.0, 1.5, 1.337), with_camera=(True, True),
    )  # fmt: skip
    local = np.random.default_rng(1).uniform((-300, -200, -1500), (300, 200, -700), (25, 3))
    points = local @ truth.rotation.T + truth.centre
    found = resect(nothing_known(truth), points, project(truth, points, dome), dome)
    assert np.abs(found.camera.centre - truth.centre).max() < 1e-7


def test_noisy_data_equal_scipys_least_squares_in_values_and_standard_deviations():
    truth, points = cameras()[0], control()
    image = images([truth], points, noise=0.002)[0]
    start = replace(truth, distortion=Brown())
    found = resect(start, points, image, LAYERS, estimate=CALIBRATION)
    names = EXTERIOR + CALIBRATION
    scale = np.array([1, 1, 1, 1e-3, 1e-3, 1e-3, 0.1, 0.1, 0.1, 1e-5, 1e-5, 1e-5, 1e-3])

    def residuals(step):
        # Angles themselves, not the rotation vector of the solver.
        values = {n: truth.value(n) + s for n, s in zip(names, step * scale, strict=True)}
        camera = Camera(
            centre=[values[n] for n in EXTERIOR[:3]],
            rotation=world_from_camera(*(values[n] for n in EXTERIOR[3:])),
            principal_distance=values["c"], principal_point=(values["xh"], values["yh"]),
            distortion=Brown(**{n: values[n] for n in CALIBRATION[3:]}),
        )  # fmt: skip
        return (project(camera, points, LAYERS) - image).ravel()

    want = least_squares(residuals, np.zeros(13), jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    cofactor = np.linalg.inv(want.jac.T @ want.jac)
    sigma0 = np.sqrt(2 * want.cost / (image.size - 13))
    sigma = sigma0 * np.sqrt(np.diag(cofactor)) * scale
    assert found.sigma0 == pytest.approx(sigma0, rel=1e-9)
    assert 0.0018 < found.sigma0 < 0.0022
    for name, step, s in zip(names, want.x * scale, sigma, strict=True):
        assert abs(found.camera.value(name) - truth.value(name) - step) < 1e-4 * s, name
        assert found.sigmas[name] == pytest.approx(s, rel=1e-6), name


def test_a_gross_error_is_suspected_where_it_is():
    truth, points = cameras()[3], control(60)
    image = images([truth], points, noise=0.001)[0]
    image[17] += (0.012, -0.004)
    found = resect(truth, points, image, LAYERS)
    assert np.flatnonzero(found.suspects).tolist() == [17]
    assert found.residuals[17] == pytest.approx([0.012, -0.004], abs=0.003)


def test_points_not_measured_are_left_out_and_a_uniform_sigma_changes_nothing():
    truth, points = cameras()[0], control(30)
    image = images([truth], points, noise=0.001)[0]
    image[4] = np.nan
    found = resect(truth, points, image, LAYERS)
    again = resect(truth, points, image, LAYERS, sigma=0.003)
    assert np.isnan(found.residuals[4]).all()
    assert found.redundancy == 2 * 29 - 6
    assert again.camera.centre == pytest.approx(found.camera.centre, abs=1e-10)
    assert again.sigma0 == pytest.approx(found.sigma0, rel=1e-9)


def test_the_scene_turned_and_moved_gives_the_camera_turned_and_moved():
    truth, points = cameras()[1], control(40)
    image = images([truth], points, noise=0.001)[0]
    turn, shift = rotation_from_vector([0.3, -0.5, 0.9]), np.array([1000.0, -2000.0, 300.0])
    wall = FlatInterface(layers=LAYERS, point=shift, normal=turn[:, 2])
    plain = resect(truth, points, image, LAYERS)
    moved = resect(nothing_known(truth), points @ turn.T + shift, image, wall)
    assert moved.camera.centre == pytest.approx(turn @ plain.camera.centre + shift, abs=1e-6)


def test_too_few_points_are_counted():
    truth, points = cameras()[0], control(3)
    with pytest.raises(InputError, match="camera cam1: 3 control points measured, but 7"):
        resect(truth, points, project(truth, points, LAYERS), LAYERS, estimate=("c",))


def test_points_on_a_line_are_named():
    truth = cameras()[0]
    points = np.outer(np.linspace(-1, 1, 8), (50, 20, 30)) - (0, 0, 90)
    with pytest.raises(GeometryError, match="on one line"):
        resect(truth, points, project(truth, points, LAYERS), LAYERS)


def test_what_a_flat_target_parallel_to_the_image_cannot_determine_is_named():
    truth = Camera.from_angles((0, 0, 500), 0, 0, 0, principal_distance=25.0)
    flat = control(30) * (1, 1, 0) - (0, 0, 90)
    image = project(truth, flat)
    with pytest.raises(GeometryError, match=r"cannot determine .*Z0.*c"):
        resect(truth, flat, image, estimate=("c",))


@pytest.mark.parametrize(
    "estimate", [("c",), pytest.param(("c", "k1"), marks=pytest.mark.acceptance), ("c", "xh", "yh")]
)
def test_noise_on_a_flat_target_parallel_to_the_image_determines_nothing_either(estimate):
    for seed in range(12):
        rng = np.random.default_rng(seed)
        plane = np.column_stack([rng.uniform(-0.3, 0.3, (9, 2)), np.full(9, -0.2)])
        camera = Camera.from_angles((0.02, 0.01, 1.0), 0, 0, 0.3, principal_distance=24.0)
        image = project(camera, plane) + 1e-3 * rng.standard_normal((9, 2))
        start = Camera.from_angles((0, 0, 1.2), 0, 0, 0.2, principal_distance=25.0)
        try:
            found = resect(start, plane, image, estimate=estimate)
        except (GeometryError, ConvergenceError) as error:
            told = str(error)
        else:
            away = abs(found.camera.principal_distance - 24.0)
            told = "c and Z0" if away < 4 * found.sigmas["c"] else "too precise"
        # A chance tilt may tell something of c: then its sigma says how little.
        assert re.search(r"Z0.*\bc\b|c and Z0", told)


def test_no_start_lies_beyond_reason(monkeypatch):
    """Pose solvers return camera positions of any size where points determine none."""
    points, truth = control(8), cameras()[0]
    real = pose_starts.cameras_seeing

    def with_a_wild_one(*given, **options):
        found = real(*given, **options)
        wild = SimpleNamespace(centre=np.full(3, 4e48), rotation=found[0].rotation)
        return [wild, *found]

    monkeypatch.setattr(pose_starts, "cameras_seeing", with_a_wild_one)
    seen = project(truth, points, LAYERS)
    start = truth.stepped(EXTERIOR, np.array([9.0, 9.0, 99.0, 0.5, 0.5, 2.0]))
    np.testing.assert_allclose(resect(start, points, seen, LAYERS).camera.centre, truth.centre)


def test_a_mirrored_coordinate_system_is_named():
    truth, points = cameras()[1], control(30)
    image = project(truth, points, LAYERS)
    with pytest.raises(GeometryError, match="left-handed"):
        resect(truth, points, image * (-1, 1), LAYERS)


def test_pixels_for_millimetres_are_named():
    truth, points = cameras()[1], control(30)
    pixels = truth.sensor.pixel_from_image(project(truth, points, LAYERS))
    with pytest.raises(InputError, match="Are these pixels"):
        resect(truth, points, pixels, LAYERS)


def test_where_no_sensor_is_known_no_lens_sees_farther_than_four_principal_distances():
    truth, points = replace(cameras()[1], sensor=None), control(30)
    seen = project(truth, points, LAYERS)
    seen[0, 0] = 4.1 * truth.principal_distance
    with pytest.raises(InputError, match="Are these pixels"):
        resect(truth, points, seen, LAYERS)


def test_an_unknown_parameter_is_named():
    with pytest.raises(InputError, match="focal"):
        resect(cameras()[0], control(9), np.zeros((9, 2)), LAYERS, estimate=("focal",))


def test_points_that_do_not_belong_together_do_not_pass_silently():
    truth, points = cameras()[1], control(30)
    image = project(truth, points, LAYERS)
    shuffled = np.random.default_rng(2).permutation(image)
    try:
        found = resect(truth, points, shuffled, LAYERS)
    except (ConvergenceError, GeometryError):
        return
    assert found.sigma0 > 0.5


@pytest.mark.parametrize("number", [2, 3])
def test_a_start_from_three_points_stays_with_its_own_pose(number):
    """Three points fit up to four poses; apparent points better the one that they come from."""
    truth = cameras(Brown())[number]
    points = np.array([(-60.0, -50.0, -100.0), (60.0, -40.0, -60.0), (10.0, 55.0, -150.0)])
    tank = FlatInterface(layers=LAYERS)
    seen = project(truth, points, tank)
    starts = pose_starts.pose_starts(nothing_known(truth), points, seen, tank)
    assert min(np.abs(start.rotation - truth.rotation).max() for start in starts) < 2e-3


def test_without_redundancy_sigmas_are_nan_and_the_resection_says_why():
    truth, points = cameras()[0], control()[[0, 7, 22]]
    found = resect(truth, points, project(truth, points, LAYERS), LAYERS)
    assert np.isnan(list(found.sigmas.values())).all()
    assert found.remarks == (
        "3 points just determine 6 parameters; nothing checks them, and no precision can be given.",
    )
    four = control()[[0, 7, 22, 13]]
    assert resect(truth, four, project(truth, four, LAYERS), LAYERS).remarks == ()
