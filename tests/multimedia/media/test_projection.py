"""Projection through plane-parallel media against 40 digits, its derivatives, and its refusals."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from multimedia import (
    Camera,
    Convention,
    FlatInterface,
    GeometryError,
    InputError,
    Interfaces,
    Layers,
    Sphere,
    project,
    projection_status,
    radial_shift,
)
from multimedia.media.camera import EXTERIOR, INTERIOR
from multimedia.media.projection import project_with_jacobian
from photocore.camera.distortion import NAMES, Brown
from tests.cases import few_by_default
from tests.multimedia.mp_camera import derivative, image
from tests.rounding import EPS

PLAIN = {
    "X0": 0.05, "Y0": -0.03, "Z0": 0.5, "omega": 0.2, "phi": -0.15, "kappa": 0.7,
    "c": 25.0, "xh": 0.1, "yh": -0.2, "k1": 1e-5, "k2": -2e-8, "k3": 1e-11,
    "p1": 2e-5, "p2": -1e-5, "scale": 1.001, "shear": 0.002, "convention": "brown",
    "indices": [1.0003, 1.5, 1.337], "thicknesses": [0.01],
    "face": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0], "moves": "no",
}  # fmt: skip
SCENES = {
    "tank": {},
    "certificate distortion": {"convention": "photogrammetric"},
    "openptv distortion": {"convention": "openptv"},
    "tilted wall": {"face": [0.01, 0.02, -0.01], "normal": [0.1, -0.05, 1.0]},
    "five media": {"indices": [1.0, 1.5, 1.1, 1.6, 1.337], "thicknesses": [0.01, 0.02, 0.005]},
    "two media": {"indices": [1.0, 1.337], "thicknesses": []},
    "camera in water": {"indices": [1.337, 1.5, 1.0], "thicknesses": [0.01]},
    "housing": {
        "face": [0.002, 0.001, -0.05], "normal": [0.05, -0.02, 1.0], "moves": "yes",
        "thicknesses": [0.008],
    },
}  # fmt: skip
POINTS = [(-0.1, 0.05, -0.2), (0.12, -0.08, -0.05), (0.0, 0.1, -0.3)]


def camera_of(q):
    terms = {name: q[name] for name in NAMES}
    return Camera.from_angles(
        (q["X0"], q["Y0"], q["Z0"]), q["omega"], q["phi"], q["kappa"],
        principal_distance=q["c"], principal_point=(q["xh"], q["yh"]),
        distortion=Brown(**terms, convention=Convention(q["convention"])),
    )  # fmt: skip


def interface_of(q):
    return FlatInterface(
        layers=Layers(indices=tuple(q["indices"]), thicknesses=tuple(q["thicknesses"])),
        point=q["face"],
        normal=q["normal"],
        moves_with_camera=q["moves"] == "yes",
    )


@pytest.mark.parametrize("scene", SCENES)
def test_projection_equals_40_digits_to_1e_11_mm(scene):
    q = PLAIN | SCENES[scene]
    got = project(camera_of(q), POINTS, interface_of(q))
    want = np.array([[float(v) for v in image(q, p)] for p in POINTS])
    assert np.abs(got - want).max() < 1e-11
    assert np.abs(want).max() > 1.0


@pytest.mark.parametrize("scene", few_by_default(SCENES, "certificate distortion", "housing"))
def test_every_derivative_equals_differences_in_40_digits(scene):
    q = PLAIN | SCENES[scene]
    interface = interface_of(q)
    result = project_with_jacobian(
        camera_of(q), np.array(POINTS[:1]), interface,
        camera_names=EXTERIOR + INTERIOR, interface_names=interface.parameter_names,
    )  # fmt: skip
    point = POINTS[0]

    def close(got, function):
        want = np.array(derivative(function))
        assert np.abs(got - want).max() < 1e-10 * max(1.0, np.abs(want).max())

    for k in range(3):
        moved = lambda h, k=k: image(q, [mp.mpf(v) + h * (i == k) for i, v in enumerate(point)])  # noqa: E731
        close(result.by_point[0, :, k], moved)
    rates = np.linalg.inv(camera_of(q).angle_rates())
    by_angles = result.by_camera[0, :, 3:6] @ rates
    for k, name in enumerate(EXTERIOR + INTERIOR):
        got = by_angles[:, k - 3] if 3 <= k < 6 else result.by_camera[0, :, k]
        close(got, lambda h, name=name: image(q | {name: mp.mpf(q[name]) + h}, point))
    for k, name in enumerate(interface.parameter_names):
        close(result.by_interface[0, :, k], interface_change(q, interface, name, point))


def interface_change(q, interface, name, point):
    """Return the function of a change of one interface parameter, in mpmath."""
    tangents = interface.tangents

    def changed(h):
        if name == "offset":
            face = [mp.mpf(v) + h * n for v, n in zip(q["face"], interface.normal, strict=True)]
            return image(q | {"face": face}, point)
        if name.startswith("tilt"):
            turn = np.cross(tangents[int(name[-1]) - 1], interface.normal)
            normal = [mp.mpf(n) + h * t for n, t in zip(interface.normal, turn, strict=True)]
            return image(q | {"normal": normal}, point)
        key = "thicknesses" if name.startswith("thickness") else "indices"
        values = [mp.mpf(v) for v in q[key]]
        values[int(name[-1]) - 1] += h
        return image(q | {key: values}, point)

    return changed


def test_the_image_of_the_nadir_point_and_its_derivative_are_exact():
    camera = Camera.from_angles((0, 0, 0.5), 0, 0, 0, principal_distance=25.0)
    layers = Layers(indices=(1.0, 1.337), thicknesses=())
    result = project_with_jacobian(camera, np.array([[0.0, 0.0, -0.2]]), layers)
    # Limit on the axis: the point seems at depth 0.2 / 1.337, so dx/dX = c / (0.5 + 0.2 / 1.337).
    assert result.image.tolist() == [[0.0, 0.0]]
    assert result.by_point[0, 0, 0] == pytest.approx(25 / (0.5 + 0.2 / 1.337), rel=1e-14)


def test_equal_indices_are_a_straight_ray():
    camera = Camera.from_angles((0.1, 0, 0.5), 0.1, 0.2, 0.3, principal_distance=25.0)
    layers = Layers(indices=(1.2, 1.2, 1.2), thicknesses=(0.05,))
    assert project(camera, POINTS, layers) == pytest.approx(project(camera, POINTS), abs=1e-13)


def test_a_turn_of_the_whole_scene_about_the_normal_changes_nothing():
    q = dict(PLAIN)
    before = project(camera_of(q), POINTS, interface_of(q))
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    camera = camera_of(q)
    turned = Camera(
        centre=turn @ camera.centre, rotation=turn @ camera.rotation,
        principal_distance=camera.principal_distance, principal_point=camera.principal_point,
        distortion=camera.distortion,
    )  # fmt: skip
    after = project(turned, np.array(POINTS) @ turn.T, interface_of(q))
    assert np.abs(after - before).max() < 1e-13


def test_the_unit_of_length_does_not_matter():
    q = dict(PLAIN)
    metres = project(camera_of(q), POINTS, interface_of(q))
    mm = q | {"X0": 50.0, "Y0": -30.0, "Z0": 500.0, "thicknesses": [10.0]}
    assert (
        np.abs(project(camera_of(mm), np.array(POINTS) * 1e3, interface_of(mm)) - metres).max()
        < 1e-12
    )


def test_shape_is_kept_and_a_scalar_point_equals_an_array_of_one():
    camera = camera_of(PLAIN)
    grid = np.broadcast_to(np.array(POINTS[0]), (2, 3, 3))
    assert project(camera, grid, interface_of(PLAIN)).shape == (2, 3, 2)
    assert project(camera, POINTS[0]).tolist() == project(camera, [POINTS[0]])[0].tolist()


def test_points_before_the_interface_or_behind_the_camera_are_nan_with_a_reason():
    camera = Camera.from_angles((0, 0, 0.5), 0, 0, 0, principal_distance=25.0)
    points = [(0, 0, -0.1), (0, 0, 0.2), (0, 0, np.nan)]
    layers = Layers(indices=(1.0, 1.337), thicknesses=())
    assert np.isnan(project(camera, points, layers)).any(axis=1).tolist() == [False, True, True]
    assert projection_status(camera, points, layers) == [
        "ok", "before the interface", "not a number",
    ]  # fmt: skip
    away = Camera.from_angles((0, 0, 0.5), np.pi, 0, 0, principal_distance=25.0)
    assert np.isnan(project(away, points[0], layers)).all()
    assert projection_status(away, points[:1], layers) == ["behind the camera"]


def test_a_camera_inside_or_behind_the_glass_is_named():
    layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    inside = Camera.from_angles((0, 0, 0.004), 0, 0, 0, principal_distance=25.0, name="left")
    with pytest.raises(GeometryError, match="camera left is inside the layers"):
        project(inside, POINTS, layers)
    below = Camera.from_angles((0, 0, -0.4), 0, 0, 0, principal_distance=25.0)
    with pytest.raises(GeometryError, match="object's side"):
        project(below, POINTS, layers)


def test_degrees_for_radians_are_named():
    with pytest.raises(InputError, match="Are these degrees"):
        Camera.from_angles((0, 0, 1), 30.0, 0.0, 0.0, principal_distance=25.0)


def test_a_mirrored_rotation_is_named():
    with pytest.raises(GeometryError, match="left-handed"):
        Camera(centre=[0, 0, 1], rotation=np.diag([1.0, 1.0, -1.0]), principal_distance=25.0)


def test_a_step_turns_the_camera_by_the_rotation_vector():
    camera = camera_of(PLAIN)
    names = ("omega", "phi", "kappa")
    step = np.array([1e-6, -2e-6, 3e-6])
    derivative_ = project_with_jacobian(camera, np.array(POINTS), camera_names=names).by_camera
    moved = project(camera.stepped(names, step), POINTS) - project(camera, POINTS)
    assert np.abs(moved - derivative_ @ step).max() < 1e-9
    angles = np.array(camera.stepped(names, step).angles) - camera.angles
    assert angles == pytest.approx(camera.angle_rates() @ step, abs=1e-10)


def as_surfaces(q):
    """Return the same layers as surfaces for the ray tracer."""
    flat = interface_of(q)
    return Interfaces.parallel(
        flat.layers, point=flat.point, normal=flat.normal, with_camera=flat.moves_with_camera
    )


@pytest.mark.parametrize("scene", ["tank", "tilted wall", "camera in water", "housing"])
def test_shift_and_ray_tracing_give_the_same_image_and_derivatives(scene):
    q = PLAIN | SCENES[scene]
    camera, points = camera_of(q), np.array(POINTS)
    names = [f"index{k}" for k in range(1, len(q["indices"]) + 1)]
    flat, traced = (
        project_with_jacobian(
            camera, points, media, camera_names=EXTERIOR + INTERIOR, interface_names=names
        )
        for media in (interface_of(q), as_surfaces(q))
    )
    assert np.abs(traced.image - flat.image).max() < 1e-11
    assert np.abs(traced.by_point - flat.by_point).max() < 1e-9
    size = np.abs(flat.by_camera).max(axis=(0, 1))
    assert (np.abs(traced.by_camera - flat.by_camera).max(axis=(0, 1)) < 1e-10 * size + 1e-9).all()
    assert np.abs(traced.by_interface - flat.by_interface).max() < 1e-9


def test_a_camera_at_the_centre_of_a_dome_sees_as_without_it():
    dome = tuple(Sphere(centre=(0, 0, 0), radius=r) for r in (0.08, 0.085))
    port = Interfaces(surfaces=dome, indices=(1.0, 1.5, 1.337), with_camera=(True, True))
    camera = Camera.from_angles((1.0, 2.0, -3.0), 0.3, 0.2, 0.1, principal_distance=25.0)
    points = np.array([(1.1, 1.9, -4.0), (0.8, 2.4, -5.0)])
    assert project(camera, points, port) == pytest.approx(project(camera, points), abs=1e-11)


def test_a_point_beyond_the_critical_angle_of_a_dome_or_off_it_has_a_reason():
    q = PLAIN
    status = projection_status(camera_of(q), [POINTS[0], (0, 0, 0.3)], as_surfaces(q))
    assert status[0] == "ok"
    assert "sides" in status[1]


def test_the_radial_shift_makes_collinearity_a_multimedia_model():
    """Maas 2015: move the point by R_bar / R from the nadir, then project as in one medium."""
    camera, layers = camera_of(PLAIN), interface_of(PLAIN).layers
    points = np.array(POINTS)
    offset = points[:, :2] - camera.centre[:2]
    radius = np.hypot(*offset.T)
    z0 = camera.centre[2] - layers.thicknesses[0]
    shifted = radial_shift(radius, z0=z0, zp=-points[:, 2], layers=layers)
    moved = points.copy()
    moved[:, :2] = camera.centre[:2] + offset * (shifted / radius)[:, None]
    assert np.abs(project(camera, moved) - project(camera, points, layers)).max() < 1e-11


def test_points_at_infinity_have_no_image_and_no_warning():
    """Warnings are errors here."""
    camera, layers = camera_of(PLAIN), interface_of(PLAIN).layers
    far = [(0.1, 0.0, -np.inf), (np.inf, 0.0, -0.2), POINTS[0]]
    image = project(camera, far, layers)
    assert np.isnan(image[:2]).all()
    # Three points and one take other roads through linear algebra: 1 ulp apart on some processors.
    np.testing.assert_allclose(image[2], project(camera, POINTS[0], layers), rtol=16 * EPS)
    assert projection_status(camera, far, layers) == ["not a number", "not a number", "ok"]


def test_a_point_seen_from_afar_is_where_a_far_camera_sees_it():
    normal = np.array([0.2, -0.1, 1.0])
    layers = Layers(indices=(1.0, 1.5, 1.1, 1.337), thicknesses=(0.3, 0.2))
    wall = FlatInterface(layers=layers, point=(0.1, 0.2, -0.3), normal=normal)
    points = np.array([(-0.1, 0.05, -1.2), (0.12, -0.08, -0.9), (0.0, 0.1, -2.3)])
    away = 1e5 * wall.normal
    far = Camera.looking_at(away, (0, 0, 0), principal_distance=25.0)
    apparent = far.centre + wall.apparent_vectors(far, points) @ far.rotation.T
    np.testing.assert_allclose(wall.seen_from_afar(points), apparent, atol=1e-8)


def test_equal_indices_are_one_medium_on_either_side_of_the_wall():
    camera = camera_of(PLAIN)
    air = Layers(indices=(1.0, 1.0, 1.0), thicknesses=(0.01,))
    points = np.array([POINTS[0], (0.02, 0.01, 0.5 * camera.centre[2])])
    for media in (air, FlatInterface(layers=air, point=(0, 0, 1e-4))):
        np.testing.assert_array_equal(project(camera, points, media), project(camera, points))
        assert projection_status(camera, points, media) == ["ok", "ok"]
    water = Layers(indices=(1.0, 1.0, 1.337), thicknesses=(0.01,))
    assert projection_status(camera, points, water)[1] == "before the interface"
