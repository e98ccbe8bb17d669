"""A pinhole camera is a homography, a nadir and a distance."""

import cv2
import numpy as np
import pytest
from scipy.linalg import rq

import multimedia.media.projection
from bifocal import Pair, Photo, Pinhole
from photocore.camera.pinhole import (
    PARAMETERS,
    camera_matrix,
    cameras_seeing,
    central,
    central_with_jacobian,
    fundamental,
    fundamental_with_jacobian,
    pixel_from_plane,
    plane_from_pixel,
    plane_transfer,
    plane_transfer_with_jacobian,
    project,
    project_with_jacobian,
    triangulate,
)
from photocore.camera.rotation import rotation_from_vector
from tests.rounding import EPS

SQUARE_ON = np.diag([1.0, -1.0, -1.0])


def make(seed: int, distance: float) -> Pinhole:
    rng = np.random.default_rng(seed)
    turn = rotation_from_vector(rng.uniform(-0.5, 0.5, 3))
    return Pinhole(
        camera_matrix(2500.0 + 100 * seed, 1.001, 1510.0, 1000.0),
        turn @ SQUARE_ON,
        np.array([*rng.uniform(-2, 2, 2), distance]),
    )


def photo_of(camera: Pinhole) -> Photo:
    return Photo(
        plane_from_pixel=plane_from_pixel(camera),
        nadir=camera.centre[:2],
        distance=camera.centre[2],
    )


def pinhole_from_plane(matrix, nadir, distance) -> Pinhole:
    """Return the camera that a homography, a nadir and a distance are, by an RQ decomposition."""
    centre = np.array([nadir[0], nadir[1], distance])
    columns = np.eye(3)
    columns[:, 2] = -centre
    upper, rotation = rq(np.linalg.inv(matrix) @ np.linalg.inv(columns))
    signs = np.sign(np.diag(upper))
    upper, rotation = upper * signs, signs[:, None] * rotation
    if np.linalg.det(rotation) < 0:  # the homography's sign is free, the camera's is not
        rotation = -rotation
    return Pinhole(upper / upper[2, 2], rotation, centre)


@pytest.mark.parametrize("seed", range(5))
def test_homography_nadir_and_distance_give_the_camera_back(seed: int) -> None:
    camera = make(seed, 9.0)
    back = pinhole_from_plane(-3.0 * plane_from_pixel(camera), camera.centre[:2], 9.0)
    np.testing.assert_allclose(back.matrix, camera.matrix, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(back.rotation, camera.rotation, atol=1e-10)


def test_a_photo_projects_as_its_pinhole_does() -> None:
    camera = make(1, 12.0)
    xyz = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 3))
    np.testing.assert_allclose(photo_of(camera).project(xyz), project(camera, xyz), atol=1e-8)


def test_a_point_behind_the_camera_has_no_pixel() -> None:
    assert np.isnan(project(make(0, 5.0), np.array([[0.0, 0.0, 60.0]]))).all()


def test_square_on_camera_by_hand() -> None:
    # 2000 px, 10 m: a pixel is 5 mm; 1 m right and 0.5 m up are 200 px right and 100 px up.
    camera = Pinhole(camera_matrix(2000, 1, 100, 80), SQUARE_ON, np.array([0.0, 0.0, 10.0]))
    np.testing.assert_allclose(project(camera, np.array([[1.0, 0.5, 0.0]])), [[300.0, -20.0]])
    # 2 m of relief at 10 m: 10 / 8 times as far from the nadir.
    np.testing.assert_allclose(project(camera, np.array([[1.0, 0.0, 2.0]])), [[350.0, 80.0]])
    np.testing.assert_allclose(camera.tilt, [0.0, 0.0])
    np.testing.assert_allclose(
        pixel_from_plane(camera) @ [1.0, 0.5, 1.0] / -10.0, [-300.0, 20.0, -1.0]
    )


def test_a_camera_turned_to_the_right_has_positive_tilt() -> None:
    # Looking 3 degrees towards +X: its axis is (sin 3, 0, -cos 3).
    a = np.deg2rad(3.0)
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    camera = Pinhole(np.eye(3), SQUARE_ON @ turn, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(camera.rotation[2], [np.sin(a), 0, -np.cos(a)], atol=4 * EPS)
    np.testing.assert_allclose(camera.tilt, [np.tan(a), 0.0], atol=4 * EPS)


def test_projection_rows_are_the_derivative() -> None:
    camera = make(3, 8.0)
    xyz = np.array([[0.3, -0.4, 0.5], [-1.0, 0.2, -0.3]])
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-6
        slope = (project(camera, xyz + step) - project(camera, xyz - step)) / 2e-6
        np.testing.assert_allclose(
            project_with_jacobian(camera, xyz).by_point[:, :, axis], slope, rtol=1e-6
        )


def test_rays_meet_where_the_point_is_and_obey_the_fundamental_matrix() -> None:
    far, near = make(1, 14.0), make(2, 8.0)
    xyz = np.random.default_rng(4).uniform(-1, 1, (30, 3))
    x1, x2 = project(far, xyz), project(near, xyz)
    np.testing.assert_allclose(triangulate(far, near, x1, x2), xyz, atol=1e-9)
    h1, h2 = (np.column_stack([x, np.ones(30)]) for x in (x1, x2))
    line = h1 @ fundamental(far, near).T
    distance = (h2 * line).sum(1) / np.hypot(line[:, 0], line[:, 1])
    np.testing.assert_allclose(distance, 0.0, atol=1e-8)


def test_a_plane_is_carried_from_photo_to_photo_also_when_it_slopes() -> None:
    far, near = make(1, 14.0), make(2, 8.0)
    xy = np.random.default_rng(5).uniform(-1, 1, (20, 2))
    xyz = np.column_stack([xy, 0.1 + 0.02 * xy[:, 0] - 0.03 * xy[:, 1]])
    h1 = np.column_stack([project(far, xyz), np.ones(20)])
    mapped = h1 @ plane_transfer(far, near, np.array([0.1, 0.02, -0.03])).T
    np.testing.assert_allclose(mapped[:, :2] / mapped[:, 2:], project(near, xyz), atol=1e-8)


def test_rotation_of_nothing_is_exactly_nothing() -> None:
    assert (rotation_from_vector(np.zeros(3)) == np.eye(3)).all()


def test_pair_of_two_pinholes_intersects_their_points() -> None:
    far, near = make(1, 14.0), make(2, 8.0)
    pair = Pair(image1=photo_of(far), image2=photo_of(near))
    xyz = np.random.default_rng(6).uniform(-1, 1, (30, 3))
    found = pair.intersect(project(far, xyz), project(near, xyz))
    np.testing.assert_allclose(found.xyz, xyz, atol=1e-8)


@pytest.mark.parametrize("index", range(len(PARAMETERS)), ids=PARAMETERS)
def test_every_parameter_moves_pixels_lines_and_planes_as_its_derivative_says(index: int) -> None:
    far, near = make(3, 14.0), make(2, 8.0)
    plane = np.array([0.1, 0.02, -0.03])
    xyz = np.array([[0.3, -0.4, 0.5], [-1.0, 0.2, -0.3]])
    step = np.zeros(len(PARAMETERS))
    step[index] = h = 1e-3 if PARAMETERS[index] in ("column", "row", "X", "Y", "Z") else 1e-6
    ahead, behind = far.stepped(step), far.stepped(-step)
    for value, by in (
        (lambda cam: project(cam, xyz), project_with_jacobian(far, xyz).by_camera[..., index]),
        (lambda cam: fundamental(cam, near), fundamental_with_jacobian(far, near)[1][index]),
        (lambda cam: fundamental(near, cam), fundamental_with_jacobian(near, far)[1][10 + index]),
        (
            lambda cam: plane_transfer(cam, near, plane),
            plane_transfer_with_jacobian(far, near, plane)[1][index],
        ),
        (
            lambda cam: plane_transfer(near, cam, plane),
            plane_transfer_with_jacobian(near, far, plane)[1][10 + index],
        ),
    ):
        slope = (value(ahead) - value(behind)) / (2 * h)
        np.testing.assert_allclose(by, slope, atol=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("index", range(3))
def test_a_moved_plane_moves_its_transfer(index: int) -> None:
    far, near = make(1, 14.0), make(2, 8.0)
    plane, step = np.array([0.1, 0.02, -0.03]), 1e-6 * np.eye(3)[index]
    slope = plane_transfer(far, near, plane + step) - plane_transfer(far, near, plane - step)
    by = plane_transfer_with_jacobian(far, near, plane)[1][20 + index]
    np.testing.assert_allclose(by, slope / 2e-6, atol=2e-7 * np.abs(by).max())


def test_a_camera_of_millimetres_is_the_same_camera() -> None:
    """`multimedia` looks backwards along z, in mm, and turns itself; photocore turns the object."""
    seen_from = multimedia.Camera.looking_at((0.3, -0.2, 2.0), (0, 0, 0), principal_distance=20.0)
    pinhole = Pinhole(
        camera_matrix(20.0, 1.0, 0.0, 0.0),
        np.diag([1.0, 1.0, -1.0]) @ seen_from.rotation.T,
        seen_from.centre,
    )
    xyz = np.random.default_rng(5).uniform(-0.5, 0.5, (20, 3))
    one = project_with_jacobian(pinhole, xyz)
    other = multimedia.media.projection.project_with_jacobian(
        seen_from, xyz, camera_names=(*multimedia.media.camera.EXTERIOR, "c")
    )
    near = {"rtol": 1e-12, "atol": 200 * EPS}
    np.testing.assert_allclose(other.image, one.pixels, **near)
    np.testing.assert_allclose(other.image, multimedia.project(seen_from, xyz), **near)
    np.testing.assert_allclose(other.by_point, one.by_point, **near)
    np.testing.assert_allclose(other.by_camera[:, :, :3], one.by_camera[:, :, 7:], **near)
    np.testing.assert_allclose(other.by_camera[:, :, 3:6], -one.by_camera[:, :, 4:7], **near)
    np.testing.assert_allclose(other.by_camera[:, :, 6] * 20.0, one.by_camera[:, :, 0], **near)


@pytest.mark.parametrize("distance", [1.0, -20.0])
def test_points_level_with_the_camera_or_behind_it_have_no_image(distance: float) -> None:
    depths = np.sign(distance) * np.array([2.0, 0.0, -0.0, -2.0, np.nan])
    vectors = np.column_stack([np.full(5, 0.5), np.full(5, 0.25), depths])
    image, by_vectors = central_with_jacobian(vectors, distance)
    np.testing.assert_array_equal(central(vectors, distance), image)
    assert image[0].tolist() == [0.25 * abs(distance), 0.125 * abs(distance)]
    assert np.isnan(image[1:]).all()
    assert np.isnan(by_vectors[1:, [0, 1], [0, 1]]).all()


@pytest.mark.parametrize("size", [1.0, 400_000.0])
def test_the_camera_that_sees_the_points_is_among_those_found(size: float) -> None:
    truth = make(2, 9.0)
    xyz = np.random.default_rng(6).uniform(-1, 1, (7, 3))
    pixels = project(truth, xyz)
    # Map coordinates lose no digits: OpenCV is given points about their middle.
    moved = truth._replace(centre=truth.centre + size)
    found = cameras_seeing(xyz + size, pixels, truth.matrix, methods=[cv2.SOLVEPNP_SQPNP])
    gap = min(np.abs(c.centre - moved.centre).max() for c in found)
    assert gap < 1e-7 + 1e-9 * size
