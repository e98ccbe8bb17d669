"""Domes, tubes and graded water as unknowns, on images from conserved quantities alone."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from multimedia import (
    Camera,
    Cylinder,
    GeometryError,
    ImagePoints,
    InputError,
    Interfaces,
    Layers,
    ObjectPoints,
    Project,
    Sphere,
    Unknowns,
    bundle_adjust,
    read_project,
    write_project,
)
from multimedia.media.camera import EXTERIOR
from tests.builders.commands import multimedia_command as main
from tests.multimedia.curved_world import (
    image_of,
    through_dome,
    through_graded_water,
    through_tube,
)

INDICES = (1.0, 1.49, 1.337)
C = 18.0
#: The dome in the camera frame: not about the projection centre, as no dome is.
DOME, RADII = np.array([6.0, -4.0, 25.0]), (80.0, 88.0)
#: Stations of one camera in a housing, before a body of targets.
STATIONS = np.array(
    [
        [0.0, 0.0, 0.0, 0.02, 0.01, 0.1],
        [300.0, 60.0, -50.0, 0.05, 0.48, 1.6],
        [-310.0, -40.0, -30.0, -0.04, -0.46, -0.4],
        [30.0, 290.0, -40.0, -0.45, 0.03, 2.9],
        [-20.0, -280.0, -60.0, 0.47, -0.02, 0.3],
    ]
)
AXIS, TUBE, WALLS = np.array([0.03, -0.02, 1.0]), np.array([1.5, -1.0, 0.0]), (110.0, 104.0)


def body(spread: tuple[float, float, float], middle: tuple[float, float, float], count: int):
    """Return targets in a box."""
    rng = np.random.default_rng(20)
    return np.asarray(middle) + rng.uniform(-0.5, 0.5, (count, 3)) * spread


def a_project(poses, images, points, media, *, noise: float = 0.0, seed: int = 0) -> Project:
    """Return a project of these images, its cameras started a little off."""
    rng = np.random.default_rng(seed)
    ids, names = tuple(map(str, range(len(points)))), [f"s{k}" for k in range(len(poses))]
    off = 1.0 if noise == 0 else 0.0
    cameras = tuple(
        Camera.from_angles(
            pose[:3] + off * rng.normal(0, 2, 3), *(pose[3:] + off * rng.normal(0, 0.004, 3)),
            principal_distance=C, name=name,
        )
        for pose, name in zip(poses, names, strict=True)
    )  # fmt: skip
    image = np.concatenate(images)
    return Project(
        cameras=cameras,
        media={"port": media},
        media_of=("port",) * len(poses),
        object_points=ObjectPoints(ids=ids, xyz=points, sigma=np.zeros_like(points)),
        image_points=ImagePoints(
            cameras=tuple(np.repeat(names, len(points))), ids=ids * len(poses),
            image=image + noise * rng.normal(size=image.shape),
        ),
        sigma_image=max(noise, 1e-4),
        unit="mm",
    )  # fmt: skip


def dome_project(*, noise: float = 0.0, seed: int = 0, count: int = 24, **start) -> Project:
    """Return the housing with a dome that is taken to be a little elsewhere."""
    points = body((600.0, 500.0, 400.0), (0.0, 0.0, -450.0), count)
    images = []
    for pose in STATIONS:
        turned = Rotation.from_euler("XYZ", pose[3:])
        dome = pose[:3] + turned.apply(DOME)
        seen = through_dome(pose[:3], points, dome, RADII, INDICES)
        images.append(image_of(seen, pose[3:], C))
    given = {
        "centre": DOME + np.array([1.0, -1.5, 2.0]),
        "radius": RADII[0] + 1.0,
        "glass": 7.6,
    } | start
    radii = (given["radius"], given["radius"] + given["glass"])
    media = Interfaces(
        surfaces=tuple(Sphere(centre=given["centre"], radius=r) for r in radii),
        indices=INDICES, with_camera=(True, True),
    )  # fmt: skip
    return a_project(STATIONS, images, points, media, noise=noise, seed=seed)


def tube_project(*, noise: float = 0.0, seed: int = 0, count: int = 24) -> Project:
    """Return four cameras around a glass tube that is taken to stand upright."""
    points = body((90.0, 90.0, 200.0), (0.0, 0.0, 0.0), count)
    poses, images = [], []
    for bearing, height in ((0.0, 60.0), (1.5, -50.0), (3.2, 20.0), (4.6, -90.0)):
        eye = np.array([600 * np.cos(bearing), 600 * np.sin(bearing), height])
        camera = Camera.looking_at(eye, (0, 0, 0), principal_distance=C)
        poses.append([*eye, *camera.angles])
        seen = through_tube(eye, points, TUBE, AXIS, WALLS, INDICES)
        images.append(image_of(seen, camera.angles, C))
    media = Interfaces(
        surfaces=tuple(
            Cylinder(point=(0, 0, 0), axis=(0, 0, 1), radius=r + 0.5)
            for r in WALLS  # type: ignore[arg-type]
        ),
        indices=INDICES,
    )
    return a_project(np.array(poses), images, points, media, noise=noise, seed=seed)


GRADIENT = 2e-5


def graded_project(*, noise: float = 0.0, seed: int = 0, true: float = GRADIENT) -> Project:
    """Return four cameras above a tank of salt water, given as fresh throughout."""
    points = body((240.0, 200.0, 380.0), (0.0, 0.0, -210.0), 36)
    poses = np.array(
        [[-220.0, -160, 520, 0.3, -0.4, 0.1], [230.0, -150, 510, 0.3, 0.4, -0.2],
         [-210.0, 170, 530, -0.3, -0.4, 1.3], [240.0, 180, 505, -0.3, 0.4, -0.9]]
    )  # fmt: skip
    images = [
        image_of(through_graded_water(p[:3], points, INDICES[2], true, 10.0, INDICES[1]), p[3:], C)
        for p in poses
    ]
    media = Interfaces.parallel(Layers(indices=(1.0, 1.49, 1.336), thicknesses=(10.0,)))
    return a_project(poses, images, points, media, noise=noise, seed=seed)


OF_DOME = ("centreX", "centreY", "centreZ", "radius", "thickness1")
OF_TUBE = ("shift1", "shift2", "tilt1", "tilt2", "radius")


def test_exact_images_give_the_dome_to_rounding():
    result = bundle_adjust(dome_project(), Unknowns(media=OF_DOME))
    found = [result.value(n if n[0] == "t" else f"port:{n}") for n in OF_DOME]
    np.testing.assert_allclose(found, [*DOME, RADII[0], RADII[1] - RADII[0]], atol=2e-9)
    assert result.sigma0 < 1e-12
    both = result.project.media["port"].surfaces
    np.testing.assert_array_equal(both[0].centre, both[1].centre)


def test_exact_images_give_the_tube_to_rounding():
    result = bundle_adjust(tube_project(), Unknowns(media=OF_TUBE))
    outer, inner = result.project.media["port"].surfaces
    axis = AXIS / np.linalg.norm(AXIS)
    np.testing.assert_allclose(outer.axis, axis, atol=1e-11)
    apart = np.cross(outer.point - TUBE, axis)
    np.testing.assert_allclose(apart, 0, atol=1e-9)
    np.testing.assert_allclose((outer.radius, inner.radius), WALLS, atol=1e-9)
    assert result.sigma0 < 1e-12


def test_exact_images_give_index_and_gradient_to_rounding():
    result = bundle_adjust(graded_project(), Unknowns(media=("index3", "gradient", "offset")))
    assert result.value("gradient") == pytest.approx(GRADIENT, abs=1e-14)
    assert result.value("index3") == pytest.approx(INDICES[2], abs=1e-11)
    assert result.sigma0 < 1e-12


#: Makers, unknowns, noise and truth.
WORLDS = {
    "dome": (
        dome_project, OF_DOME[:4], 0.0005,
        dict(zip((f"port:{n}" for n in OF_DOME[:4]), (*DOME, RADII[0]), strict=True)),
        {"glass": RADII[1] - RADII[0], "count": 60},
    ),
    "tube": (tube_project, OF_TUBE, 0.002, {"port:radius": WALLS[0]}, {}),
    "graded water": (
        graded_project, ("index3", "gradient"), 0.002,
        {"index3": INDICES[2], "gradient": GRADIENT}, {},
    ),
}  # fmt: skip


def errors_of(world: str, seed: int) -> tuple[np.ndarray, float]:
    """Return errors over sigmas and the chi-square of all errors over their number."""
    make, names, noise, of_media, given = WORLDS[world]
    project = make(noise=noise, seed=seed, **given)
    result = bundle_adjust(project, Unknowns(media=names))
    # With noise the cameras start where they are.
    truth = of_media | {
        f"{camera.name}:{name}": camera.value(name)
        for camera in project.cameras
        for name in EXTERIOR
    }
    error = np.array([result.value(name) - true for name, true in truth.items()])
    rows = [result.names.index(name) for name in truth]
    covariance = result.covariance[np.ix_(rows, rows)]
    square = error @ np.linalg.solve(covariance, error) / len(error)
    return error / np.sqrt(np.diag(covariance)), float(square)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "world", [pytest.param(w, marks=() if w == "dome" else pytest.mark.long) for w in WORLDS]
)
def test_errors_over_sigmas_scatter_by_one(world):
    """Cameras and media together, 25 to 35 unknowns in each of 10 draws: chi-square at 0.1 %."""
    pulls, squares = zip(*(errors_of(world, seed) for seed in range(10)), strict=True)
    free = np.size(pulls)
    low, high = chi2.ppf((0.0005, 0.9995), free) / free
    assert low < np.mean(squares) < high


@pytest.mark.acceptance
def test_gradient_of_even_water_is_called_insignificant():
    even = graded_project(noise=0.002, seed=5, true=0.0)
    result = bundle_adjust(even, Unknowns(media=("index3", "gradient")))
    assert abs(result.value("gradient")) < 3 * result.sigma("gradient")
    assert any("gradient is not significant" in line for line in result.remarks)
    salt = bundle_adjust(graded_project(noise=0.002, seed=5), Unknowns(media=("gradient",)))
    assert not any("not significant" in line for line in salt.remarks)


def test_a_camera_in_the_middle_of_its_dome_leaves_the_radius_to_the_prior():
    given = dome_project(count=12)
    at_home = Interfaces(
        surfaces=tuple(Sphere(centre=(0, 0, 0), radius=r) for r in RADII),  # type: ignore[arg-type]
        indices=INDICES, with_camera=(True, True),
    )  # fmt: skip
    straight = [image_of(given.object_points.xyz - pose[:3], pose[3:], C) for pose in STATIONS]
    noisy = a_project(STATIONS, straight, given.object_points.xyz, at_home, noise=0.001)
    result = bundle_adjust(noisy, Unknowns(media=("radius",), typical_priors=True))
    assert result.sigma("port:radius") == pytest.approx(8.0, rel=0.1)
    assert any("port:radius: the data hardly carry it" in line for line in result.remarks)


def test_a_camera_in_the_middle_of_its_dome_cannot_tell_its_radius_without_a_prior():
    given = dome_project(count=12)
    at_home = Interfaces(
        surfaces=tuple(Sphere(centre=(0, 0, 0), radius=r) for r in RADII),  # type: ignore[arg-type]
        indices=INDICES, with_camera=(True, True),
    )  # fmt: skip
    straight = [image_of(given.object_points.xyz - pose[:3], pose[3:], C) for pose in STATIONS]
    noisy = a_project(STATIONS, straight, given.object_points.xyz, at_home, noise=0.001)
    wanted = r"port:radius comes out as 80 ± \S+ mm, 80 mm was given: the data.*--prior"
    with pytest.raises(GeometryError, match=wanted):
        bundle_adjust(noisy, Unknowns(media=("radius",)))
    with pytest.raises(GeometryError, match=r"index3 comes out as 1\.3.*cannot carry it"):
        bundle_adjust(noisy, Unknowns(media=("index3",)))


@pytest.mark.acceptance
def test_a_dome_of_another_size_is_refused():
    with pytest.raises(GeometryError, match=r"port:radius comes out as 79.* mm, 200 mm was given"):
        bundle_adjust(
            dome_project(noise=0.0005, radius=200.0, glass=8.0, centre=DOME),
            Unknowns(media=("radius",), priors={"port:radius": 5.0}),
        )


def test_what_these_media_lack_is_named():
    with pytest.raises(InputError, match="no 'offset'; its parameters are centreX"):
        bundle_adjust(dome_project(count=10), Unknowns(media=("offset",)))


@pytest.mark.acceptance
def test_the_command_adjusts_a_dome_and_graded_water(tmp_path):
    salty = graded_project(noise=0.001)
    graded = replace(salty.media["port"], gradient=1e-6)
    for name, given, media in (
        ("dome", dome_project(noise=0.001, glass=8.0), "centreX,centreY,centreZ,radius"),
        ("salt", replace(salty, media={"port": graded}), "index3,gradient"),
    ):
        source, out = tmp_path / f"{name}.toml", tmp_path / f"{name}2.toml"
        report = tmp_path / f"{name}.html"
        write_project(source, given)
        arguments = ["adjust", str(source), "--media", media, "--out", str(out), "--json"]
        result = CliRunner().invoke(main, [*arguments, "--report", str(report)])
        assert result.exit_code == 0, result.stderr
        text = report.read_text(encoding="utf-8")
        adjusted = read_project(out).media["port"]
        assert isinstance(adjusted, Interfaces)
        label, true = ("port:radius", RADII[0]) if name == "dome" else ("gradient", GRADIENT)
        found = json.loads(result.stdout)["unknowns"][label]
        assert abs(found["value"] - true) < 4 * found["sigma"]
        if name == "dome":
            assert "sphere about" in text
            assert adjusted.surfaces[0].radius == found["value"]
        else:
            assert "per mm of depth" in text
            assert adjusted.gradient == found["value"]


@pytest.mark.acceptance
def test_a_gradient_may_be_written_into_the_section_of_plane_parallel_media(tmp_path):
    source = tmp_path / "tank.toml"
    write_project(source, graded_project())
    text = source.read_text(encoding="utf-8")
    head, _, rest = text.partition("[media.port]")
    cameras = rest[rest.index("[[camera]]") :]
    section = "[media.port]\nindices = [1.0, 1.49, 1.336]\nthicknesses = [10.0]\ngradient = 0.0\n"
    source.write_text(head + section + cameras, encoding="utf-8")
    result = bundle_adjust(read_project(source), Unknowns(media=("index3", "gradient", "offset")))
    assert result.value("gradient") == pytest.approx(GRADIENT, abs=1e-12)
    source.write_text(head + section.replace("= 0.0", '= "x"') + cameras, encoding="utf-8")
    with pytest.raises(InputError, match="gradient"):
        read_project(source)
