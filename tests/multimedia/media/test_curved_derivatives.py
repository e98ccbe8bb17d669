"""Rays through domes, tubes and graded water against conserved quantities, and every derivative."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from multimedia import (
    Camera,
    Cylinder,
    InputError,
    Interfaces,
    Layers,
    Plane,
    Sphere,
    epipolar_curve,
    intersect,
    intersect_rays,
    project,
)
from multimedia.media.camera import EXTERIOR
from multimedia.media.projection import project_with_jacobian
from tests.multimedia.curved_world import (
    image_of,
    through_dome,
    through_graded_water,
    through_tube,
)

C, INDICES = 20.0, (1.0, 1.5, 1.337)
DOME, RADII = np.array([1.0, 2.0, -6.0]), (80.0, 86.0)
AXIS, TUBE, WALLS = np.array([0.1, 0.05, 1.0]), np.array([2.0, 3.0, 0.0]), (110.0, 105.0)
RNG = np.random.default_rng(1)
LOOKING = Camera.from_angles((3.0, -2.0, 4.0), 0.1, 0.05, 0.3, principal_distance=C)
BESIDE = Camera.looking_at((500.0, 20.0, 30.0), (0, 0, 0), principal_distance=C)
ABOVE = Camera.from_angles((10.0, 20.0, 500.0), 0.3, -0.2, 0.3, principal_distance=C)
FAR = RNG.uniform((-300, -300, -900), (300, 300, -400), (20, 3))
INSIDE = RNG.uniform((-50, -50, -100), (50, 50, 100), (20, 3))
BELOW = RNG.uniform((-150, -150, -400), (150, 150, -10), (20, 3))


def spheres(centre, **more) -> Interfaces:
    """Return a dome."""
    faces = tuple(Sphere(centre=centre, radius=r) for r in RADII)
    return Interfaces(surfaces=faces, indices=INDICES, **more)


TUBES = Interfaces(
    surfaces=tuple(Cylinder(point=TUBE, axis=AXIS, radius=r) for r in WALLS), indices=INDICES
)
PANE = Interfaces.parallel(Layers(indices=INDICES, thicknesses=(10.0,)))
SALT = replace(PANE, gradient=3e-5)
#: A dome that moves with its camera, under a surface that stands still, in graded water.
PORT = spheres((1.0, 2.0, -8.0), with_camera=(True, True), gradient=1e-5, level=-100.0)
MIXED = Interfaces(
    surfaces=(*PORT.surfaces, Plane(point=(0, 0, -150.0), normal=(0.1, 0, 1))),  # type: ignore[arg-type]
    indices=(*INDICES, 1.36), with_camera=(True, True, False),
)  # fmt: skip


def test_rays_through_domes_tubes_and_salt_keep_what_is_conserved():
    """Bouguer's invariant, that of the cylinder and that of level layers, by halving intervals."""
    for camera, points, media, seen in (
        (LOOKING, FAR, spheres(DOME), through_dome(LOOKING.centre, FAR, DOME, RADII, INDICES)),
        (BESIDE, INSIDE, TUBES,
         through_tube(BESIDE.centre, INSIDE, TUBE, AXIS, WALLS, INDICES)),
        (ABOVE, BELOW, SALT, through_graded_water(ABOVE.centre, BELOW, 1.337, 3e-5, 10.0)),
    ):  # fmt: skip
        expected = image_of(seen, camera.angles, C)
        np.testing.assert_allclose(project(camera, points, media), expected, rtol=0, atol=1e-12)


def test_a_ray_beside_a_gradient_obeys_the_ray_equation():
    """Through an upright wall, the gradient along it: d(n t)/ds = grad n, integrated by scipy."""
    wall = Interfaces.parallel(Layers(indices=(1.0, 1.337)), point=(0, 0, 0), normal=(1, 0, 0))
    water = replace(wall, gradient=2e-4, level=-20.0)
    camera = Camera.looking_at((300.0, 40, 60), (-200, 0, -80), principal_distance=C)
    points = RNG.uniform((-400, -100, -250), (-100, 100, 50), (6, 3))
    x, y = project(camera, points, water).T
    rays = np.column_stack([x, y, np.full(6, -C)]) @ camera.rotation.T
    for ray, point in zip(rays / np.linalg.norm(rays, axis=1)[:, None], points, strict=True):
        entry = camera.centre - camera.centre[0] / ray[0] * ray
        index = 1.337 + 2e-4 * (-20.0 - entry[2])
        start = np.append([0, *(ray[1:])], 0)[:3]
        start[0] = -np.sqrt(index**2 - ray[1] ** 2 - ray[2] ** 2)

        def turning(_, state):
            n = 1.337 + 2e-4 * (-20.0 - state[2])
            return np.append(state[3:], [0.0, 0.0, -2e-4 * n])

        def reached(_, state, point=point):
            return state[0] - point[0]

        reached.terminal = True
        path = solve_ivp(
            turning, (0, 1e4), np.append(entry, start), method="DOP853", rtol=1e-12, atol=1e-12,
            events=reached,
        )  # fmt: skip
        np.testing.assert_allclose(path.y_events[0][0][:3], point, rtol=0, atol=1e-8)


def test_the_dome_is_fermat_s_path_of_stationary_time_in_40_digits():
    with mp.workdps(40):
        point, centre = [mp.matrix([mp.mpf(v) for v in p]) for p in (FAR[0], LOOKING.centre)]
        middle = mp.matrix([mp.mpf(v) for v in DOME])

        def place(radius, a, b):
            return middle + radius * mp.matrix([mp.sin(a) * mp.cos(b), mp.sin(a) * mp.sin(b),
                                                -mp.cos(a)])  # fmt: skip

        def time(a1, b1, a2, b2):
            corners = [centre, place(RADII[0], a1, b1), place(RADII[1], a2, b2), point]
            legs = [mp.norm(q - p) for p, q in pairwise(corners)]
            return sum(mp.mpf(n) * leg for n, leg in zip(INDICES, legs, strict=True))

        def slopes(*where):
            return [mp.diff(time, where, tuple(int(i == k) for i in range(4))) for k in range(4)]

        away = FAR[0] - DOME
        a, b = np.arccos(-away[2] / np.linalg.norm(away)), np.arctan2(away[1], away[0])
        found = mp.findroot(slopes, (a, b, a, b), tol=1e-40, maxsteps=60)
        first = place(RADII[0], found[0], found[1]) - centre
    seen = np.array([[float(v) for v in first]])
    expected = image_of(seen, LOOKING.angles, C)
    np.testing.assert_allclose(project(LOOKING, FAR[:1], spheres(DOME)), expected, atol=1e-13)


SETUPS = {
    "dome": (LOOKING, FAR, spheres(DOME)),
    "port in salt water": (LOOKING, FAR, PORT),
    "tube": (BESIDE, INSIDE, TUBES),
    "pane before salt water": (ABOVE, BELOW, SALT),
    "port before a layer": (LOOKING, FAR, MIXED),
}
STEPS = {"gradient": 1e-7, "tilt": 1e-5, "index": 1e-5}


def difference(image, step: float, *, one_sided: bool) -> np.ndarray:
    """Return the derivative of an image by differences of fourth or second order."""
    if one_sided:
        return (4 * image(step) - 3 * image(0.0) - image(2 * step)) / (2 * step)
    near, far = ((image(k * step) - image(-k * step)) / (2 * k * step) for k in (1, 2))
    return (4 * near - far) / 3


@pytest.mark.parametrize(
    "setup",
    [
        name
        if name in ("tube", "port before a layer")
        else pytest.param(name, marks=pytest.mark.acceptance)
        for name in SETUPS
    ],
)
def test_every_derivative_is_the_difference_of_images(setup):
    camera, points, media = SETUPS[setup]
    names = media.parameter_names
    found = project_with_jacobian(
        camera, points, media, camera_names=EXTERIOR, interface_names=names
    )
    for k in range(6):
        step = 1e-2 if k < 3 else 1e-4
        slope = difference(
            lambda size, k=k: project(camera.stepped(EXTERIOR, size * np.eye(6)[k]), points, media),
            step, one_sided=False,
        )  # fmt: skip
        scale = np.abs(slope).max()
        np.testing.assert_allclose(found.by_camera[:, :, k], slope, atol=3e-9 * scale, rtol=0)
    for k, name in enumerate(names):
        step = next((s for start, s in STEPS.items() if name.startswith(start)), 1e-2)
        slope = difference(
            lambda size, name=name: project(camera, points, media.stepped([name], [size])),
            step, one_sided=name == "index1",
        )  # fmt: skip
        scale = np.abs(slope).max() + 1e-9
        worst = 3e-7 if name.startswith("index") else 3e-8
        np.testing.assert_allclose(
            found.by_interface[:, :, k], slope, atol=worst * scale, rtol=0, err_msg=name
        )


def test_names_of_bodies_farther_on_carry_their_number():
    assert MIXED.parameter_names == (
        "centreX", "centreY", "centreZ", "radius", "offset@3", "tilt1@3", "tilt2@3", "thickness1",
        "index1", "index2", "index3", "index4", "gradient",
    )  # fmt: skip
    thicker = MIXED.stepped(["thickness1", "offset@3"], [0.5, 1.0])
    assert [s.radius for s in thicker.surfaces[:2]] == [RADII[0] - 0.5, RADII[1]]
    assert thicker.value("thickness1") == pytest.approx(RADII[1] - RADII[0] + 0.5)
    grown = TUBES.stepped(["radius"], [2.0])
    assert [s.radius for s in grown.surfaces] == [WALLS[0] + 2.0, WALLS[1] + 2.0]


def test_faces_that_are_not_concentric_are_bodies_of_their_own():
    apart = replace(
        spheres(DOME), surfaces=tuple(
            Sphere(centre=DOME + k * np.array([0.1, 0, 0]), radius=r) for k, r in enumerate(RADII)
        ),
    )  # fmt: skip
    assert {"radius", "radius@2"} <= set(apart.parameter_names)
    assert "thickness1" not in apart.parameter_names
    through = Interfaces(
        surfaces=(*TUBES.surfaces, *TUBES.surfaces[::-1]), indices=(1, 1.5, 1.3, 1.5, 1)
    )
    moved = through.stepped(["radius", "shift1"], [1.0, 2.0])
    assert moved.surfaces[0] is moved.surfaces[3]
    with pytest.raises(InputError, match="not one of shift1"):
        through.stepped(["offset"], [1.0])


def test_points_in_salt_water_are_intersected_and_lines_refused():
    other = Camera.from_angles((-200.0, 30.0, 480.0), 0.1, -0.5, 0.2, principal_distance=C)
    seen = np.stack([
        image_of(through_graded_water(c.centre, BELOW, 1.337, 3e-5, 10.0), c.angles, C)
        for c in (ABOVE, other)
    ])  # fmt: skip
    found = intersect((ABOVE, other), seen, SALT)
    np.testing.assert_allclose(found.xyz, BELOW, atol=1e-9)
    with pytest.raises(InputError, match="rays are curves"):
        intersect_rays((ABOVE, other), seen, SALT)
    with pytest.raises(InputError, match="rays are curves"):
        epipolar_curve(ABOVE, seen[0], other, SALT, z_range=(-200, -10))


@pytest.mark.parametrize("wrong", [np.nan, np.inf, (1.0, 2.0)])
def test_an_impossible_gradient_is_refused(wrong):
    with pytest.raises(InputError, match="gradient"):
        replace(PANE, gradient=wrong)
