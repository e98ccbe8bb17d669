"""Ray tracing: hand cases, round trips, limits, agreement with the radial shift, refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

import multimedia as mm
from multimedia import GeometryError, InputError
from tests.cases import few_by_default
from tests.rounding import EPS

WATER = 1.337
#: Lengths of the scenes below are millimetres.
TANK = mm.Layers(indices=(1.0, 1.5, WATER), thicknesses=(10.0,))


def grid_points(seed: int, count: int, low, high) -> np.ndarray:
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def wave() -> mm.WaveSurface:
    return mm.WaveSurface.sinusoid(0.0, amplitude=2.0, wavelength=100.0, direction=0.3, phase=1.0)


def wave_raster(step: float = 5.0) -> mm.RasterSurface:
    axis = np.arange(-400.0, 400.0 + step, step)
    x, y = np.meshgrid(axis, axis[::-1])
    heights = wave().height_at(np.stack([x, y], axis=-1))
    return mm.RasterSurface(raster=heights, xy_from_cell=[[step, 0, axis[0]], [0, -step, axis[-1]]])


def wave_mesh() -> mm.MeshSurface:
    axis = np.arange(-400.0, 401.0, 10.0)
    xy = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    xy += np.random.default_rng(5).uniform(-2, 2, xy.shape)
    vertices = np.column_stack([xy, wave().height_at(xy)])
    return mm.MeshSurface(vertices=vertices, triangles=Delaunay(xy).simplices)


def dome() -> mm.Interfaces:
    inner = mm.Sphere(centre=[1.0, 2.0, 3.0], radius=50.0)
    outer = mm.Sphere(centre=[1.0, 2.0, 3.0], radius=57.0)
    return mm.Interfaces(surfaces=(inner, outer), indices=(1.0, 1.49, WATER))


def glass_engine() -> mm.Interfaces:
    """A flat window, then a glass cylinder around air: plane + cylinder."""
    window = mm.Plane.level(100.0)
    tube = [mm.Cylinder(point=[0, 0, 0], axis=[0, 1, 0], radius=r) for r in (60.0, 50.0)]
    return mm.Interfaces(
        surfaces=(window, window.shifted([0, 0, -10]), *tube), indices=(1.0, 1.5, WATER, 1.5, 1.0)
    )


SCENES = {
    "parallel": (mm.Interfaces.parallel(TANK), [0, 0, 500], [-150, -150, -200], [150, 150, 0]),
    "tilted": (
        mm.Interfaces.parallel(TANK, normal=[0.2, 0.1, 1]),
        [0, 0, 500],
        [-150, -150, -300],
        [150, 150, -50],
    ),
    "camera in water": (
        mm.Interfaces.parallel(mm.Layers(indices=(WATER, 1.5, 1.0), thicknesses=(10.0,))),
        [0, 0, 500],
        [-300, -300, -200],
        [300, 300, -1],
    ),
    "dome": (dome(), [0, 0, 0], [100, 100, 100], [900, 900, 900]),
    "glass engine": (glass_engine(), [0, 0, 500], [-30, -30, -30], [30, 30, 30]),
    "waves": (
        mm.Interfaces(surfaces=(wave(),), indices=(1.0, WATER)),
        [0, 0, 500],
        [-150, -150, -200],
        [150, 150, -3],
    ),
    "raster": (
        mm.Interfaces(surfaces=(wave_raster(),), indices=(1.0, WATER)),
        [0, 0, 500],
        [-150, -150, -200],
        [150, 150, -3],
    ),
    "mesh": (
        mm.Interfaces(surfaces=(wave_mesh(),), indices=(1.0, WATER)),
        [0, 0, 500],
        [-150, -150, -100],
        [150, 150, -3],
    ),
}


def miss(path: mm.RayPaths, points: np.ndarray) -> np.ndarray:
    """Return the distance of points from the last leg of traced rays."""
    return np.linalg.norm(
        np.cross(points - path.vertices[..., -1, :], path.directions[..., -1, :]), axis=-1
    )


@pytest.mark.parametrize("name", SCENES)
def test_the_ray_found_for_a_point_leads_back_to_it_within_1e_10_mm(name: str) -> None:
    interfaces, centre, low, high = SCENES[name]
    points = grid_points(3, 2000, low, high)
    found = mm.aim_rays(centre, points, interfaces)
    assert (found.status == mm.RayStatus.OK).mean() > (0.998 if name == "mesh" else 0.9999)
    good = found.status == mm.RayStatus.OK
    traced = mm.trace_rays(centre, found.directions[good, 0], interfaces)
    assert miss(traced, points[good]).max() < 1e-10


@pytest.mark.parametrize("name", SCENES)
def test_every_vertex_obeys_snells_law_and_lies_on_its_surface(name: str) -> None:
    interfaces, centre, low, high = SCENES[name]
    path = mm.aim_rays(centre, grid_points(4, 300, low, high), interfaces)
    good = path.status == 0
    for k, surface in enumerate(interfaces.surfaces):
        vertex = path.vertices[good, k]
        np.testing.assert_allclose(surface.side(vertex), 0, atol=1e-10)
        normal = surface.normals(vertex)
        before = interfaces.indices[k] * np.cross(path.directions[good, k], normal)
        after = interfaces.indices[k + 1] * np.cross(path.directions[good, k + 1], normal)
        np.testing.assert_allclose(before, after, atol=1e-12)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    z0=st.floats(0.5, 5000),
    glass=st.one_of(st.just(0.0), st.floats(0.1, 50)),
    depth=st.floats(0.1, 3000),
    slope=st.floats(0.0, 8.0),
    azimuth=st.floats(0, 6.28),
    indices=st.sampled_from([(1.0, 1.5, 1.337), (1.337, 1.5, 1.0), (1.0003, 1.46, 1.33)]),
)
def test_ray_trace_and_radial_shift_agree_to_1e_12(
    z0, glass, depth, slope, azimuth, indices
) -> None:
    layers = mm.Layers(indices=indices, thicknesses=(glass,))
    # A reachable radius: the widest ray the slowest-varying leg allows.
    radius = slope * (z0 + glass + depth)
    point = np.array([radius * np.sin(azimuth), radius * np.cos(azimuth), -depth])
    path = mm.aim_rays([0, 0, z0 + glass], point, mm.Interfaces.parallel(layers))
    shifted = mm.radial_shift(radius, z0=z0, zp=depth, layers=layers)
    assert path.status == mm.RayStatus.OK
    assert np.isfinite(shifted)
    if indices[0] < indices[-1]:
        # R_bar: where the straight continuation of the ray in the camera's medium is level with P.
        heading = path.directions[0]
        radius_bar = (z0 + glass + depth) * np.hypot(*heading[:2]) / -heading[2]
        assert radius_bar == pytest.approx(shifted, rel=1e-12)
    else:
        # From water into air R_bar runs to infinity at the critical angle, and with it its
        # sensitivity: compare the direction instead.
        expected = np.arctan2(shifted, z0 + glass + depth)
        actual = np.arctan2(np.hypot(*path.directions[0, :2]), -path.directions[0, 2])
        assert actual == pytest.approx(expected, rel=1e-12, abs=4 * EPS)


def test_what_a_camera_sees_of_a_point_leads_back_to_it() -> None:
    glass = mm.Interfaces.parallel(TANK)
    camera = mm.Camera.from_angles((10.0, 20.0, 300.0), 0.1, -0.2, 0.3, principal_distance=20.0)
    points = grid_points(7, 20, [-100, -100, -200], [100, 100, -20])
    vectors, labels = glass.seen(camera, points)
    assert set(labels) == {""}
    starts, ways = glass.object_rays(camera, vectors)
    assert np.linalg.norm(np.cross(points - starts, ways), axis=-1).max() < 1e-9


def test_a_ray_at_45_degrees_is_bent_as_computed_by_hand() -> None:
    # asin(sin 45 / 1.5) = 28.1255 degrees in glass: 10 mm thick, so 10 tan 28.1255 = 5.3452 mm on.
    glass = mm.Interfaces.parallel(mm.Layers(indices=(1.0, 1.5, 1.0), thicknesses=(10.0,)))
    path = mm.trace_rays([0, 0, 110.0], [1, 0, -1], glass)
    np.testing.assert_allclose(path.vertices[:, 0], [100.0, 105.345225], atol=1e-6)
    np.testing.assert_allclose(path.directions[2], path.directions[0], atol=4 * EPS)


def test_a_camera_at_the_centre_of_a_dome_sees_straight() -> None:
    centre = np.array([1.0, 2.0, 3.0])
    points = grid_points(1, 50, [100] * 3, [500] * 3)
    path = mm.aim_rays(centre, points, dome())
    straight = (points - centre) / np.linalg.norm(points - centre, axis=-1, keepdims=True)
    np.testing.assert_allclose(path.directions[:, 0], straight, atol=1e-14)


def test_equal_indices_leave_the_ray_straight_through_any_surface() -> None:
    for name in ("dome", "glass engine", "waves", "raster", "mesh"):
        interfaces, centre, low, high = SCENES[name]
        air = interfaces.with_indices([1.2] * len(interfaces.indices))
        points = grid_points(7, 50, low, high)
        path = mm.aim_rays(centre, points, air)
        straight = points - np.array(centre, float)
        straight /= np.linalg.norm(straight, axis=-1, keepdims=True)
        np.testing.assert_allclose(path.directions[:, 0], straight, atol=1e-13)


def test_a_small_piece_of_a_huge_sphere_is_a_plane() -> None:
    radius = 1e8
    sphere = mm.Sphere(centre=[0, 0, -radius], radius=radius)
    curved = mm.Interfaces(surfaces=(sphere,), indices=(1.0, WATER))
    point = [80.0, 30.0, -100.0]
    flat = mm.aim_rays([0, 0, 300], point, mm.Interfaces.flat_water(0.0, refractive_index=WATER))
    near = mm.aim_rays([0, 0, 300], point, curved)
    np.testing.assert_allclose(near.directions[0], flat.directions[0], atol=1e-6)


def test_a_raster_reproduces_a_tilted_plane_exactly() -> None:
    plane = mm.Plane.tilted(1.0, slope_x=0.02, slope_y=-0.03)
    x, y = np.meshgrid(np.arange(5) * 10.0, np.arange(4)[::-1] * 10.0)
    raster = mm.RasterSurface(
        raster=1.0 + 0.02 * x - 0.03 * y, xy_from_cell=[[10, 0, 0], [0, -10, 30]]
    )
    point, centre = [22.0, 11.0, -4.0], [3.0, 20.0, 30.0]
    by_plane = mm.aim_rays(centre, point, mm.Interfaces(surfaces=(plane,), indices=(1, WATER)))
    by_raster = mm.aim_rays(centre, point, mm.Interfaces(surfaces=(raster,), indices=(1, WATER)))
    np.testing.assert_allclose(by_raster.vertices, by_plane.vertices, atol=1e-11)
    np.testing.assert_allclose(by_raster.directions, by_plane.directions, atol=1e-12)


def test_raster_and_mesh_approach_the_wave_they_sample() -> None:
    xy = np.random.default_rng(2).uniform(-300, 300, (500, 2))
    true = wave().height_at(xy)
    assert np.abs(wave_raster(5.0).height_at(xy) - true).max() < 2e-3
    assert np.abs(wave_mesh().height_at(xy) - true).max() < 0.25
    slope = wave().slopes(xy)[0]
    assert np.abs(wave_raster(5.0).slopes(xy)[0] - slope).max() < 2e-3
    assert np.abs(wave_mesh().slopes(xy)[0] - slope).max() < 0.03


def test_a_hole_in_the_raster_spoils_only_its_surroundings() -> None:
    surface = wave_raster(50.0)
    raster = np.array(surface.raster)
    raster[8, 8] = np.nan  # at X = 0, Y = 0
    holed = mm.RasterSurface(raster=raster, xy_from_cell=surface.xy_from_cell)
    assert np.isnan(holed.height_at([20.0, 20.0]))
    assert holed.height_at([110.0, 20.0]) == surface.height_at([110.0, 20.0])
    assert np.isnan(holed.height_at([500.0, 0.0]))


def test_the_jacobian_is_the_derivative_of_the_direction() -> None:
    for name in ("parallel", "tilted", "dome", "glass engine", "waves", "raster"):
        interfaces, centre, low, high = SCENES[name]
        points = grid_points(9, 20, low, high)
        jacobian = mm.aim_rays(centre, points, interfaces, jacobian=True).jacobian
        step = 1e-3
        for axis in range(3):
            move = np.zeros(3)
            move[axis] = step
            ahead = mm.aim_rays(centre, points + move, interfaces).directions[:, 0]
            behind = mm.aim_rays(centre, points - move, interfaces).directions[:, 0]
            np.testing.assert_allclose(
                jacobian[:, :, axis], (ahead - behind) / (2 * step), rtol=1e-5, atol=2e-9
            )


def test_rotating_the_whole_scene_rotates_the_rays() -> None:
    angle = 0.7
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    move = np.array([10.0, -20.0, 5.0])
    still = mm.Interfaces.parallel(TANK)
    moving = mm.Interfaces.parallel(TANK, with_camera=True).seen_from(move, turn)
    points = grid_points(11, 100, [-100, -100, -200], [100, 100, -1])
    plain = mm.aim_rays([0, 0, 500], points, still)
    turned = mm.aim_rays(turn @ [0, 0, 500] + move, points @ turn.T + move, moving)
    np.testing.assert_allclose(turned.directions, plain.directions @ turn.T, atol=1e-12)


def test_an_interface_fixed_to_the_object_stays_when_the_camera_moves() -> None:
    sea = mm.Plane.level(0.0)
    port = mm.Plane(point=[0, 0, -0.1])
    both = mm.Interfaces(
        surfaces=(port, sea), indices=(1.0, 1.0003, WATER), with_camera=(True, False)
    )
    seen = both.seen_from([0, 0, 5.0], np.eye(3))
    assert seen.surfaces[1] is sea
    assert seen.surfaces[0].point[2] == pytest.approx(4.9)


def test_shapes_broadcast_and_one_point_is_an_array_of_one() -> None:
    interfaces, centre, low, high = SCENES["tilted"]
    points = grid_points(13, 6, low, high).reshape(2, 3, 3)
    centres = np.array([centre, [50.0, 0, 480]])[:, None, None, :]
    path = mm.aim_rays(centres, points, interfaces, jacobian=True)
    assert path.vertices.shape == (2, 2, 3, 2, 3)
    assert path.jacobian.shape == (2, 2, 3, 3, 3)
    one = mm.aim_rays(centre, points[1, 2], interfaces)
    np.testing.assert_array_equal(one.directions, path.directions[0, 1, 2])


def test_a_camera_in_water_cannot_look_out_beyond_the_critical_angle() -> None:
    outward = mm.Interfaces.flat_water(0.0, refractive_index=1.0, air=4 / 3)
    beyond = np.arcsin(0.75) + 1e-6
    inside = np.arcsin(0.75) - 1e-6
    rays = [[np.sin(a), 0, -np.cos(a)] for a in (beyond, inside)]
    path = mm.trace_rays([0, 0, 1.0], rays, outward)
    assert path.status.tolist() == [mm.RayStatus.TOTAL_REFLECTION, mm.RayStatus.OK]
    assert np.isnan(path.directions[0]).all()
    assert mm.RayStatus(path.status[0]).label == "total reflection"


def test_points_on_the_wrong_side_are_named_not_guessed() -> None:
    water = mm.Interfaces.flat_water(0.0, refractive_index=WATER)
    path = mm.aim_rays([0, 0, 1.0], [[0.1, 0, 0.5], [0.1, 0, -0.5]], water)
    assert path.status.tolist() == [mm.RayStatus.WRONG_SIDE, mm.RayStatus.OK]
    under = mm.aim_rays([0, 0, -1.0], [0.1, 0, -0.5], water)
    assert under.status == mm.RayStatus.WRONG_SIDE


def test_a_point_on_the_interface_is_seen_along_the_straight_line() -> None:
    path = mm.aim_rays(
        [0, 0, 1.0], [0.5, 0.2, 0.0], mm.Interfaces.flat_water(0.0, refractive_index=WATER)
    )
    straight = np.array([0.5, 0.2, -1.0]) / np.linalg.norm([0.5, 0.2, -1.0])
    np.testing.assert_allclose(path.directions[0], straight, atol=1e-14)


def test_rays_that_miss_a_surface_say_so() -> None:
    path = mm.trace_rays([0, 0, 9.0], [[0, 0, 1], [1, 0, 0], [0, 0, -1]], SCENES["waves"][0])
    assert path.status.tolist() == [1, 1, 0]
    over = mm.trace_rays([0, 0, 500.0], [10, 0, -1], SCENES["raster"][0])
    assert mm.RayStatus(int(over.status)).label == "misses an interface"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: mm.Interfaces(surfaces=(wave(),), indices=(1.0,)), "1 surfaces lie between 2"),
        (
            lambda: mm.Interfaces.flat_water(0, refractive_index=0.75),
            "medium 2 has refractive index 0.75",
        ),
        (
            lambda: mm.Interfaces.flat_water(0, refractive_index=133.5),
            "medium 2 has refractive index 133.5",
        ),
        (
            lambda: mm.Interfaces(surfaces=(wave(),), indices=(1, 1.3), with_camera=(True,)),
            "WaveSurface stands still",
        ),
        (lambda: mm.Plane(point=[0, 0, 0], normal=[0, 0, 0]), "has no direction"),
        (lambda: mm.Sphere(centre=[0, 0, 0], radius=-1), "radius: must be above zero"),
        (lambda: mm.RasterSurface(raster=[[1, 2]], xy_from_cell=np.eye(2, 3)), "at least 3 x 3"),
        (
            lambda: mm.RasterSurface(raster=np.full((4, 4), np.nan), xy_from_cell=np.eye(2, 3)),
            "holds no height",
        ),
        (
            lambda: mm.MeshSurface(
                vertices=[[0, 0, 0], [1, 0, 0], [0, 0, 1]], triangles=[[0, 1, 2]]
            ),
            "no vertical faces",
        ),
        (
            lambda: mm.MeshSurface(
                vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[[1, 2, 3]]
            ),
            "vertex numbers",
        ),
        (
            lambda: mm.Interfaces.parallel(TANK).seen_from([0, 0, 0], np.diag([1, 1, -1])),
            "not a rotation",
        ),
        (lambda: mm.WaveSurface.sinusoid(0, amplitude=1, wavelength=0), "wavelength"),
    ],
)
def test_impossible_surfaces_are_refused_in_plain_words(make, message) -> None:
    with pytest.raises((InputError, GeometryError), match=message):
        make()


def test_a_flat_ray_stops_at_the_first_crest_it_meets() -> None:
    steep = mm.WaveSurface.sinusoid(0.0, amplitude=2.0, wavelength=10.0, direction=np.pi / 2)
    rng = np.random.default_rng(6)
    starts = np.column_stack([rng.uniform(-5, 5, 200), np.zeros(200), np.full(200, 4.0)])
    angles = np.radians(rng.uniform(8, 60, 200))
    headings = np.column_stack([np.cos(angles), np.zeros(200), -np.sin(angles)])
    path = mm.trace_rays(starts, headings, mm.Interfaces(surfaces=(steep,), indices=(1.0, 1.0)))
    # Dense sampling along each ray: the first sample under the surface.
    distance = np.arange(0, 45, 0.002)
    for start, heading, vertex in zip(starts, headings, path.vertices[:, 0], strict=True):
        along = start + distance[:, None] * heading
        under = np.flatnonzero(along[:, 2] < steep.height_at(along[:, :2]))[0]
        assert np.linalg.norm(vertex - start) == pytest.approx(distance[under], abs=0.0021)


def golden_shifts() -> list[dict]:
    """Return the 50-digit radial shifts: housings, thin gaps, critical angles, grazing rays."""
    path = Path(__file__).parents[2] / "golden" / "radial_shift.json"
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("step", few_by_default([1, 7], 7))
def test_rays_through_parallel_planes_equal_the_50_digit_shifts(step: int) -> None:
    cases = golden_shifts()[::step]
    limits = 0
    for case in cases:
        layers = mm.Layers(indices=case["indices"], thicknesses=case["heights"][1:-1])
        height, depth = sum(case["heights"][:-1]), case["heights"][-1]
        path = mm.aim_rays(
            [0, 0, height], [case["radius"], 0, -depth], mm.Interfaces.parallel(layers)
        )
        if path.status != mm.RayStatus.OK:
            # No ray: a camera that touches the glass sees only a circle, and light that reaches a
            # point of the interface beyond the critical angle never leaves the denser medium.
            assert case["heights"][0] == 0 or depth == 0, case
            limits += 1
            continue
        heading = path.directions[0]
        expected = float(case["radius_bar"]) / (height + depth)
        angle = np.arctan2(heading[0], -heading[2])
        assert angle == pytest.approx(np.arctan(expected), rel=1e-12, abs=1e-300), case
        if expected < 1e3:  # beyond, R_bar magnifies the rounding of a unit vector
            assert heading[0] / -heading[2] == pytest.approx(expected, rel=1e-12), case
    assert limits <= max(2, 0.03 * len(cases))


def test_least_time_finds_the_ray_that_shooting_loses() -> None:
    # Double glazing under water: the air gap between the panes, hit beside the critical angle.
    layers = mm.Layers(indices=(1.337, 1.5, 1.0, 1.5, 1.337), thicknesses=(0.006, 1e-5, 0.006))
    points = np.array([[-r, 0.0, -1.0] for r in (1.0, 2.0, 5.0, 20.0)])
    interfaces = mm.Interfaces.parallel(layers, normal=[0.1, 0.05, 1.0])
    path = mm.aim_rays([0, 0, 1.0], points, interfaces)
    assert (path.status == mm.RayStatus.OK).all()
    for k, surface in enumerate(interfaces.surfaces):
        before = layers.indices[k] * np.cross(path.directions[:, k], surface.normal)
        after = layers.indices[k + 1] * np.cross(path.directions[:, k + 1], surface.normal)
        np.testing.assert_allclose(before, after, atol=1e-9)


@pytest.mark.parametrize(
    "surface",
    [
        mm.Plane(point=[1, 2, 3], normal=[0.2, 0.1, 1]),
        mm.Sphere(centre=[1, 2, 3], radius=50.0),
        mm.Cylinder(point=[1, 2, 3], axis=[0.3, 1, -0.2], radius=50.0),
    ],
    ids=["plane", "sphere", "cylinder"],
)
def test_a_surface_moved_with_its_points_stays_the_same_to_them(surface) -> None:
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
    shift, points = np.array([20.0, -30.0, 5.0]), grid_points(4, 50, -80, 80)
    moved, there = surface.moved(turn, shift), points @ turn.T + shift
    np.testing.assert_allclose(moved.side(there), surface.side(points), atol=1e-12)
    np.testing.assert_allclose(moved.normals(there), surface.normals(points) @ turn.T, atol=1e-13)


@pytest.mark.parametrize("level", [0.0, 0.3, -120.0])
def test_rays_that_meet_a_crest_or_trough_exactly_are_found(level) -> None:
    rng = np.random.default_rng(11)
    for _ in range(40):
        amplitude, length = 10 ** rng.uniform(-6, 0), 10 ** rng.uniform(-2, 2)
        wave = mm.WaveSurface.sinusoid(
            level, amplitude=amplitude, wavelength=length, direction=rng.uniform(0, 2 * np.pi)
        )
        along = wave.wave_vector[0] / np.linalg.norm(wave.wave_vector[0])
        half_turns = rng.integers(-6, 7, 20)
        at = np.outer(half_turns * length / 2, along)
        at += np.outer(rng.uniform(-5, 5, 20) * length, [-along[1], along[0]])
        top = level + np.where(half_turns % 2, -amplitude, amplitude)
        target = np.column_stack([at, top])
        # From above, steeper than the waves: each ray meets them once.
        flow = 0.5 * min(1.0, 1 / wave.steepest) * rng.uniform(-0.7, 0.7, (20, 2))
        reach = rng.uniform(2, 20) + 2 * amplitude
        origin = target + reach * np.column_stack([flow, np.ones(20)])
        away = np.linalg.norm(target - origin, axis=1)
        hop = wave.hop(origin, (target - origin) / away[:, None], np.zeros(20))
        np.testing.assert_allclose(hop, away, rtol=1e-9)
