"""Ties without support, the wall's own face, and walls bent by lens or refraction."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from bifocal import Control, GeometryError, Interior, Pair, Pinhole, RadialDivision, SiteMeasures
from bifocal.matching.features import Features, match_features
from bifocal.orientation.alignment import make_alignment
from bifocal.orientation.starts.relative_orientation import Ties, supported
from bifocal.orientation.walls.reference_plane import narrow_face
from bifocal.orientation.walls.wall_shape import (
    WallShape,
    shape_in_words,
    shape_of_wall,
    wall_shape,
)
from tests.bifocal.orientation.layered_wall import SIZE as WALL_SIZE
from tests.bifocal.orientation.layered_wall import camera as wall_camera
from tests.bifocal.orientation.layered_wall import take
from tests.builders.orientation import PhotoInput, orient_pair
from tests.cases import few_by_default
from tests.scenes import SetupErrors, bifocal_cameras

SIZE = (3072, 2048)


def wall_ties(k: float, *, seed: int = 1, relief: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Return ties of a wall with a third of its points off it, through lenses of distortion k."""
    rng = np.random.default_rng(seed)
    cameras = bifocal_cameras(size=SIZE, errors=SetupErrors(tilt_deg=3.0), rng=rng)
    xyz = np.column_stack([rng.uniform(-5, 5, 900), rng.uniform(-3, 3, 900), np.zeros(900)])
    xyz[600:, 2] = rng.uniform(-relief, relief, 300)
    out = []
    for camera in (cameras.far, cameras.near):
        seen = camera.view_of(xyz) + rng.normal(0, 0.1, (900, 2))
        lens = RadialDivision(k, camera.matrix[:2, 2], float(camera.matrix[0, 0]))
        out.append(lens.distort(seen))
    return out[0], out[1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_flat_wall_is_not_bent_and_a_distorted_one_is(seed: int) -> None:
    assert wall_shape(*wall_ties(0.0, seed=seed), SIZE)[0].px < 0.1
    bent = wall_shape(*wall_ties(-0.15, seed=seed), SIZE)[0]
    assert bent.is_certain
    assert bent.sigma < 0.1 * bent.px
    assert "calibrate" in shape_in_words(bent, with_lens=False)
    assert "glass or water" in shape_in_words(bent, with_lens=True)


@pytest.mark.parametrize(("px", "sigma"), [(0.1, 0.0), (0.23, 0.02), (np.nan, np.nan)])
def test_a_bend_no_greater_than_its_own_uncertainty_is_not_told(px: float, sigma: float) -> None:
    assert shape_in_words(WallShape(px, sigma), with_lens=False) == ""
    assert shape_in_words(WallShape(px + 0.2, sigma), with_lens=False) != "" or np.isnan(px)


def test_the_bend_counts_at_one_size_of_photo() -> None:
    first, second = wall_ties(-0.15)
    half = wall_shape(first / 2 - 0.25, second / 2 - 0.25, (SIZE[0] // 2, SIZE[1] // 2))[0]
    assert half.px == pytest.approx(wall_shape(first, second, SIZE)[0].px, rel=0.15)


def seen_in_both(heights: Callable[[np.ndarray], np.ndarray], *, seed: int = 2, k: float = 0.0):
    """Return the ties of a wall of given heights, and these as shares of the far distance."""
    rng = np.random.default_rng(seed)
    cameras = bifocal_cameras(size=SIZE, errors=SetupErrors(tilt_deg=1.0), rng=rng)
    xyz = np.column_stack([rng.uniform(-5, 5, 3000), rng.uniform(-3, 3, 3000), np.zeros(3000)])
    xyz[:, 2] = heights(xyz)
    ties = [c.view_of(xyz) + rng.normal(0, 0.1, (3000, 2)) for c in (cameras.far, cameras.near)]
    lens = RadialDivision(k, cameras.far.matrix[:2, 2], float(cameras.far.matrix[0, 0]))
    return lens.distort(ties[0]), ties[1], xyz[:, 2] / float(cameras.far.centre[2])


def test_relief_before_the_wall_does_not_bend_it() -> None:
    """Mouldings that stand out more towards top and bottom read as a bend of all ties."""
    moulded = np.random.default_rng(2).random(3000) < 0.8
    x1, x2, height = seen_in_both(lambda at: np.where(moulded, 0.03 * np.abs(at[:, 1]), 0.0))
    assert wall_shape(x1, x2, SIZE)[0].is_certain
    assert not shape_of_wall(x1, x2, SIZE, height).is_certain


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(10, 13))
def test_two_parallel_faces_are_no_bent_wall(seed: int) -> None:
    # Piers on both sides, 15 cm before the wall between them: all ties bend by 2.5 px.
    piers = lambda at: np.where(np.abs(at[:, 0]) > 2.5, 0.15, 0.0)  # noqa: E731
    x1, x2, height = seen_in_both(piers, seed=seed)
    assert wall_shape(x1, x2, SIZE)[0].px > 1.0
    for plane in (0.0, 0.01):  # that of the wall, and one between the faces
        assert shape_of_wall(x1, x2, SIZE, height - plane).px < 0.1


@pytest.mark.parametrize("seed", few_by_default(range(10, 13), 10))
def test_a_bent_wall_behind_another_face_is_told(seed: int) -> None:
    faced = lambda at: np.where(np.floor(1.1 * at[:, 0]) % 3 == 0, 0.13, 0.0)  # noqa: E731
    x1, x2, height = seen_in_both(faced, seed=seed, k=-0.02)
    assert shape_of_wall(x1, x2, SIZE, height).is_certain


def bent_pair(k: tuple[float, float], way: str, seed: int, monkeypatch: pytest.MonkeyPatch):
    """Return a pair set up as if its lenses bent nothing, and points with their pixels."""
    rng = np.random.default_rng(seed)
    cameras = bifocal_cameras(size=SIZE, errors=SetupErrors(tilt_deg=0.3), rng=rng)
    both = (cameras.far, cameras.near)
    interiors = [
        Interior.from_focal(float(c.matrix[0, 0]), image_size=SIZE, sigma=0.02, source="--focal")
        for c in both
    ]

    def seen(xyz: np.ndarray, noise: float) -> list[np.ndarray]:
        views = [c.view_of(xyz) + rng.normal(0, noise, (len(xyz), 2)) for c in both]
        return [
            RadialDivision(own, c.matrix[:2, 2], float(c.matrix[0, 0])).distort(view)
            for c, own, view in zip(both, k, views, strict=True)
        ]

    xyz = rng.uniform([-5, -3.2, -0.4], [5, 3.2, 0.4], (1500, 3))
    wall = np.arange(1500) < 1050
    xyz[wall, 2] = 0.0
    first, second = seen(xyz, 0.1)
    homography, _ = cv2.findHomography(first[wall], second[wall], 0)
    ties = Ties(
        pixels1=first, pixels2=second, seen1=first, seen2=second, homography=homography,
        on_plane=wall, tolerance=0.3,
    )  # fmt: skip
    monkeypatch.setattr(
        "bifocal.orientation.absolute_orientation.ties_of", lambda *_, **__: (ties, ())
    )
    monkeypatch.setattr("bifocal.orientation.absolute_orientation._mended_by_ties", lambda *_: None)
    far, near = (round(float(camera.centre[2]), 3) for camera in both)
    site = SiteMeasures(distance1=far, distance2=near)
    control = Control()
    if way == "control":
        known = rng.uniform([-4.5, -2.8, -0.3], [4.5, 2.8, 0.3], (9, 3))
        picks, site = seen(known, 0.4), SiteMeasures()
        control = Control(
            ids=tuple("ABCDEFGHI"), xyz=known, sigma=np.full((9, 3), 0.003), pixels1=picks[0],
            pixels2=picks[1],
        )  # fmt: skip
    photos = [
        PhotoInput(grey=None, interior=interior, name=name)
        for interior, name in zip(interiors, ("far.jpg", "near.jpg"), strict=True)
    ]
    made = orient_pair((photos[0], photos[1]), control=control, site=site)
    found = make_alignment(made, (photos[0], photos[1]), way=way)
    points = rng.uniform([-4.5, -2.8, -0.3], [4.5, 2.8, 0.3], (300, 3))
    points = points[np.hypot(points[:, 0], points[:, 1]) > 1.2]
    return Pair.from_dict(found.pair.to_dict() | {"setup": found.setup}), points, seen(points, 0.5)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("k", "way"),
    [
        ((-0.05, 0.0), "site"),
        ((-0.15, -0.15), "control"),
        pytest.param((-0.05, -0.05), "site", marks=pytest.mark.acceptance),
        *(
            pytest.param(k, "control", marks=pytest.mark.acceptance)
            for k in ((0.0, -0.06), (-0.05, -0.05), (0.04, 0.06))
        ),
    ],
)
def test_sigma_of_a_bent_wall_is_what_relief_errs_by(
    k: tuple[float, float], way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ratios = []
    for seed in range(2, 4):
        pair, points, pixels = bent_pair(k, way, seed, monkeypatch)
        solved = pair.intersect(*pixels)
        error = (solved.xyz - points)[:, 2] / solved.sigma[:, 2]
        ratios.append(float(np.sqrt((error**2).mean())))
        assert set(solved.flags) <= {"OK", "ON-PLANE", "WEAK", "UNCERTAIN"}
        assert np.mean(np.array(solved.flags) == "UNCERTAIN") < (0.4 if k[0] < -0.1 else 0.1)
    assert 0.7 < np.sqrt(np.mean(np.square(ratios))) < 1.4


def test_wrong_ties_on_their_lines_have_no_support() -> None:
    rng = np.random.default_rng(4)
    pixels = rng.uniform(0, 3000, (2000, 2))
    parallax = 0.02 * (pixels - 1500) + rng.normal(0, 0.3, (2000, 2))
    parallax[:60] *= rng.uniform(3, 10, (60, 1))  # along the radius, so on the line
    far = np.linalg.norm(parallax - 0.02 * (pixels - 1500), axis=1) > 12
    kept = supported(pixels, parallax, 3000)
    assert not kept[far].any()
    assert kept[60:].mean() > 0.99


def test_the_walls_own_face_is_found_beside_plinth_and_joints() -> None:
    rng = np.random.default_rng(5)
    xyz = np.column_stack([rng.uniform(-5, 5, 3000), rng.uniform(-3, 3, 3000), np.zeros(3000)])
    xyz[:1200, 2] = 0.001 * xyz[:1200, 0] + 0.004  # the face, tilted and displaced
    xyz[1200:2000, 2] = 0.021  # within the band that a fixed width would average
    xyz[2000:, 2] = rng.uniform(-0.08, 0.08, 1000)
    sigma = np.full(3000, 0.0015)
    xyz[:, 2] += rng.normal(0, 0.0015, 3000)
    face = narrow_face(xyz, sigma, band=0.0875)
    np.testing.assert_allclose(face.plane, [0.004, 0.001, 0.0], atol=3e-4)
    assert face.roughness < 0.001
    assert face.members[:1200].mean() > 0.9
    assert face.members[1200:2000].mean() < 0.02


def test_a_walls_roughness_is_told_from_the_precision_of_its_points() -> None:
    rng = np.random.default_rng(6)
    xyz = np.column_stack([rng.uniform(-5, 5, (3000, 2)), rng.normal(0, 0.012, 3000)])
    sigma = rng.uniform(0.002, 0.009, 3000)
    xyz[:, 2] += sigma * rng.normal(size=3000)
    assert narrow_face(xyz, sigma, band=0.09).roughness == pytest.approx(0.012, rel=0.1)


def test_joints_and_mouldings_do_not_thicken_lift_or_turn_the_wall() -> None:
    # As on a church: a fifth is ashlar even to 3 mm, the rest joints and mouldings, more of them on
    # one side.
    rng = np.random.default_rng(9)
    xyz = np.column_stack([rng.uniform(-4, 4, (5000, 2)), np.zeros(5000)])
    kind = rng.uniform(0, 1, 5000) - 0.03 * xyz[:, 0]
    joint, moulding = (kind > 0.25) & (kind < 0.65), kind > 0.65
    uneven = np.where(moulding, 0.025, np.where(joint, 0.018, 0.003))
    xyz[:, 2] = rng.normal(np.where(moulding, 0.035, 0.0), uneven)
    rest = rng.random(5000) < 0.13
    xyz[rest, 2] = rng.uniform(-0.09, 0.09, rest.sum())
    xyz[:, 2] += rng.normal(0, 0.003, 5000)
    face = narrow_face(xyz, np.full(5000, 0.003), band=0.09)
    assert abs(face.plane[0]) < 1e-3
    assert np.abs(face.plane[1:]).max() < 3e-4
    assert face.roughness == pytest.approx(0.003, abs=0.0015)


def test_a_smooth_face_in_a_corner_is_not_the_wall() -> None:
    """A castle's wall of 16 mm, and 550 points of a smooth face in its left fifth, 11 mm before."""
    rng = np.random.default_rng(1)
    wall, corner, rest = (
        np.column_stack([rng.uniform(-6, right, n), rng.uniform(-3, 4, n), rng.normal(*height, n)])
        for right, n, height in (
            (6, 3800, (0.0, 0.016)), (-3.5, 550, (0.011, 0.0011)), (6, 1500, (0.0, 0.2)),
        )
    )  # fmt: skip
    xyz = np.concatenate([wall, corner, rest])
    sigma = rng.uniform(0.5, 2, len(xyz)) * 0.001
    xyz[:, 2] += rng.normal(0, 1, len(xyz)) * sigma
    face = narrow_face(xyz, sigma, band=0.1)
    assert face.roughness == pytest.approx(0.0155, abs=0.002)
    ends = face.plane @ [[1, 1, 1], [-6, 0, 6], [0, 0, 0]]
    assert np.abs(ends).max() < 0.005  # 11 mm and more, were the corner taken for it
    assert np.ptp(xyz[face.members, 0]) > 11


def test_one_detail_in_two_orientations_is_no_rival_of_itself() -> None:
    rng = np.random.default_rng(7)
    codes = np.abs(rng.normal(size=(40, 128))).astype(np.float32)
    codes /= np.linalg.norm(codes, axis=1, keepdims=True)
    pixels = rng.uniform(0, 900, (40, 2))

    def features(places: np.ndarray, descriptors: np.ndarray) -> Features:
        ones = np.ones(len(places))
        return Features(
            pixels=places, size=ones, direction=ones, descriptors=descriptors, reduction=1.0
        )

    # Each twice: another orientation of the same place has nearly the same descriptor.
    twice = features(
        np.repeat(pixels, 2, axis=0),
        np.repeat(codes, 2, axis=0) + np.tile([[0.0], [1e-3]], (40, 1)).astype(np.float32),
    )
    rows1, rows2 = match_features(features(pixels, codes), twice)
    assert len(rows1) == 40
    np.testing.assert_array_equal(rows2 // 2, rows1)


def through_port(photo: np.ndarray, cam: Pinhole) -> np.ndarray:
    """Return a square photo of the wall as seen in water through 10 mm of glass, 50 mm before it.

    By hand: sin a = 1.49 sin g = 1.337 sin b; a ray meets the wall at 0.05 tan a + 0.01 tan g +
    (d - 0.06) tan b instead of d tan a. The lens is 1.337 times as wide, for as much of the wall.
    """
    middle, focal, d = cam.matrix[:2, 2], cam.matrix[0, 0], cam.centre[2]
    column, row = np.meshgrid(np.arange(photo.shape[1]), np.arange(photo.shape[0]))
    away = np.stack([column - middle[0], row - middle[1]], axis=-1) / (focal / 1.337)
    air = np.linalg.norm(away, axis=-1, keepdims=True)
    sine = np.sin(np.arctan(air))
    glass, water = np.tan(np.arcsin(sine / 1.49)), np.tan(np.arcsin(sine / 1.337))
    reach = (0.05 * air + 0.01 * glass + (d - 0.06) * water) / d
    at = (middle + focal * away * reach / np.maximum(air, 1e-12)).astype(np.float32)
    return cv2.remap(photo, at[..., 0], at[..., 1], cv2.INTER_CUBIC)


def through_water(photo: np.ndarray, cam: Pinhole, depth: float) -> np.ndarray:
    """Return a square photo of the wall as seen through a level of water before it. [m]

    By hand: a ray leaves at angle a in air and goes on at b in water, sin a = 1.334 sin b; it meets
    the wall at (d - depth) tan a + depth tan b instead of d tan a.
    """
    middle, focal, d = cam.matrix[:2, 2], cam.matrix[0, 0], cam.centre[2]
    column, row = np.meshgrid(np.arange(photo.shape[1]), np.arange(photo.shape[0]))
    away = np.stack([column - middle[0], row - middle[1]], axis=-1) / focal
    air = np.linalg.norm(away, axis=-1, keepdims=True)
    sine = np.sin(np.arctan(air)) / 1.334
    reach = ((d - depth) * air + depth * np.tan(np.arcsin(sine))) / d
    at = (middle + focal * away * reach / np.maximum(air, 1e-12)).astype(np.float32)
    return cv2.remap(photo, at[..., 0], at[..., 1], cv2.INTER_CUBIC)


@pytest.mark.acceptance
@pytest.mark.parametrize("medium", ["port", pytest.param("surface", marks=pytest.mark.long)])
def test_photos_through_water_are_said_not_to_fit(medium: str) -> None:
    cameras = wall_camera(16.0), wall_camera(9.0, offset=(0.05, -0.04))
    views = take(*cameras)
    photos = [
        PhotoInput(
            grey=through_port(image, cam) if medium == "port" else through_water(image, cam, 2.0),
            interior=Interior.from_focal(
                cam.matrix[0, 0] / (1.337 if medium == "port" else 1.0),
                image_size=WALL_SIZE,
                sigma=0.005,
                source="test",
            ),
            name=name,
        )
        for image, cam, name in zip(
            (views.far, views.near), cameras, ("a.jpg", "b.jpg"), strict=True
        )
    ]
    with pytest.raises(GeometryError, match=r"THE MODEL DOES NOT FIT.*refraction.*--indices"):
        orient_pair((photos[0], photos[1]), control=Control(), site=SiteMeasures(distance1=16.0))
