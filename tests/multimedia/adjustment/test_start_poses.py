"""Cameras of which no pose is stated, calibrated from nothing but a wand, particles or boards."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    Camera,
    Cylinder,
    FlatInterface,
    GeometryError,
    ImagePoints,
    InputError,
    Interfaces,
    ObjectPoints,
    Project,
    ScaleBar,
    Unknowns,
    bundle_adjust,
    project,
    read_project,
    write_project,
)
from photocore.camera.rotation import rotation_from_vector
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import LAYERS, SENSOR, control

WAND = ScaleBar(first="@a", second="@b", length=80.0, sigma=0.02)
FREE = Unknowns(control="free", scale_bars=(WAND,))
NOISE = 0.001
MIDDLE = np.array([0.0, 0.0, -95.0])
TOP = FlatInterface(layers=LAYERS)
SIDE = FlatInterface(layers=LAYERS, point=(120.0, 0.0, -95.0), normal=(1.0, 0.0, 0.0))
PORT = FlatInterface(layers=LAYERS, point=(0.0, 0.0, -40.0), moves_with_camera=True)
#: Where cameras stand, each with its media.
ABOVE = (((-250.0, 100.0, 420.0), "top"), ((200.0, 180.0, 380.0), "top"),
         ((40.0, -300.0, 400.0), "top"))  # fmt: skip
ROUND = (*ABOVE[:2], ((520.0, 60.0, -60.0), "side"), ((500.0, -120.0, -150.0), "side"))
SCENES = {
    "glass": (ABOVE, {"top": TOP}),
    "two walls": (ROUND, {"top": TOP, "side": SIDE}),
    "ports": (tuple((eye, "port") for eye, _ in ABOVE), {"port": PORT}),
    "air": (tuple((eye, "") for eye, _ in ABOVE), {}),
}
#: Two cameras far off, apart by as much.
FAR_PAIR = ((((465.0, 3.0, 796.0), "port"), ((-249.0, 75.0, 841.0), "port")), {"port": PORT})


def photographed(
    scene: str, xyz: np.ndarray, ids: tuple[str, ...], c: float = 20.0, noise: float = NOISE
) -> tuple[list[Camera], Project]:
    """Return the true cameras, each rolled at random, and a project that states no pose. [mm]"""
    places, media = SCENES.get(scene, FAR_PAIR)
    rng = np.random.default_rng(7)
    truth = []
    for k, (eye, _) in enumerate(places):
        camera = Camera.looking_at(eye, MIDDLE, principal_distance=c)
        roll = rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-3, 3)]))
        truth.append(replace(camera, rotation=camera.rotation @ roll, sensor=SENSOR, name=f"c{k}"))
    image = np.concatenate(
        [project(c, xyz, media.get(of)) for c, (_, of) in zip(truth, places, strict=True)]
    )
    image += noise * rng.standard_normal(image.shape)
    names = tuple(camera.name for camera in truth)
    blank = tuple(replace(c, centre=np.zeros(3), rotation=np.eye(3)) for c in truth)
    return truth, Project(
        cameras=blank, media=media, media_of=tuple(of for _, of in places), unit="mm",
        sigma_image=noise, without_pose=names,
        image_points=ImagePoints(
            cameras=tuple(np.repeat(names, len(ids)).tolist()), ids=ids * len(truth), image=image
        ),
    )  # fmt: skip


def waved(
    scene: str = "glass", places: int = 12, particles: int = 12, **lens: float
) -> tuple[list[Camera], Project]:
    """Return the true cameras, and what they see of a wand and of particles."""
    rng = np.random.default_rng(3)
    middle = rng.uniform((-35, -30, -130), (35, 30, -60), (places, 3))
    way = rng.standard_normal((places, 3))
    way *= 40.0 / np.linalg.norm(way, axis=1)[:, None]
    xyz = np.concatenate([middle - way, middle + way, control(particles)])
    ids = (*(f"{k}a" for k in range(places)), *(f"{k}b" for k in range(places)),
           *(f"p{k}" for k in range(particles)))  # fmt: skip
    return photographed(scene, xyz, ids, **lens)


def apart_of(views) -> np.ndarray:
    """Return the distances between neighbouring cameras, which no datum changes."""
    centres = np.array([camera.centre for camera in views])
    return np.linalg.norm(centres - np.roll(centres, 1, axis=0), axis=1)


def without_rows(given: Project, keep) -> Project:
    """Return a project with the image points for which ``keep(camera, id)`` holds."""
    images = given.image_points
    rows = [k for k, pair in enumerate(zip(images.cameras, images.ids, strict=True)) if keep(*pair)]
    return replace(given, image_points=ImagePoints(
        cameras=tuple(images.cameras[k] for k in rows), ids=tuple(images.ids[k] for k in rows),
        image=images.image[rows],
    ))  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
def test_a_wand_gives_poses_of_which_nothing_was_known(scene):
    truth, given = waved(scene)
    result = bundle_adjust(given, FREE)
    assert result.sigma0 == pytest.approx(NOISE, rel=0.25)
    np.testing.assert_allclose(apart_of(result.project.cameras), apart_of(truth), rtol=0.01)
    assert "no pose was stated" in result.remarks[0]
    assert not result.project.without_pose
    if scene == "glass":  # the middle of the points is before the glass's point
        middle = np.median(result.project.object_points.xyz, axis=0)
        assert np.abs(middle[:2]).max() < 20.0
        heights = [camera.centre[2] for camera in result.project.cameras]
        np.testing.assert_allclose(heights, [eye[2] for eye, _ in ABOVE], rtol=0.01)


def test_points_that_some_cameras_miss_and_wand_ends_seen_once_do_no_harm():
    truth, given = waved(places=16, particles=20)
    rng = np.random.default_rng(5)
    images = given.image_points
    lost = {pair for pair in zip(images.cameras, images.ids, strict=True) if rng.random() < 0.2}
    lost |= {("c1", "0a"), ("c2", "0a")}
    part = without_rows(given, lambda *pair: pair not in lost)
    result = bundle_adjust(part, FREE)
    np.testing.assert_allclose(apart_of(result.project.cameras), apart_of(truth), rtol=0.02)


def test_boards_seen_by_two_ports_need_neither_poses_nor_a_wand():
    side = 30.0 * np.arange(4.0)
    board = np.array([(x, y, 0.0) for y in side for x in side])
    rng = np.random.default_rng(2)
    ids, plates, xyz = [], [], []
    for k in range(4):
        turn = rotation_from_vector(0.5 * rng.standard_normal(3))
        xyz.append((board - 45.0) @ turn.T + MIDDLE + 20.0 * rng.standard_normal(3))
        ids += [f"{k}:{n}" for n in range(len(board))]
        plates += [f"board{k}"] * len(board)
    truth, given = photographed("ports", np.concatenate(xyz), tuple(ids))
    boards = ObjectPoints(ids=tuple(ids), xyz=np.tile(board, (4, 1)), groups=tuple(plates))
    given = replace(given, object_points=boards)
    unknowns = Unknowns(control="free", plates=tuple(dict.fromkeys(plates)))
    result = bundle_adjust(given, unknowns)
    assert result.sigma0 == pytest.approx(NOISE, rel=0.25)
    np.testing.assert_allclose(apart_of(result.project.cameras), apart_of(truth), rtol=0.002)


def refusals():
    _, given = waved(places=6, particles=4)
    still = Cylinder(point=(0, 0, -95), axis=(0, 0, 1), radius=900.0)
    curved = Interfaces(surfaces=(still,), indices=(1.0, 1.337))
    _, scrambled = waved("air", places=6, particles=4)
    images = scrambled.image_points
    images = replace(images, image=np.random.default_rng(1).permutation(images.image))
    point = ObjectPoints(ids=("0a",), xyz=np.zeros((1, 3)))
    alone = replace(
        without_rows(given, lambda camera, _: camera == "c0"),
        cameras=given.cameras[:1], media_of=("top",), without_pose=("c0",),
    )  # fmt: skip
    return {
        "some with a pose": (replace(given, without_pose=("c1",)), FREE, "c1 without pose"),
        "control": (replace(given, object_points=point), FREE, "multimedia resect"),
        "one camera": (alone, FREE, "one camera alone"),
        "curved": (replace(given, media={"top": curved}), FREE, "c0.*not flat"),
        "no distance": (given, Unknowns(control="free"), "no known distance"),
        "few points": (
            without_rows(given, lambda _, name: name[:-1] in ("0", "1")), FREE, "share 8",
        ),
        "other points": (replace(scrambled, image_points=images), FREE, "no poses bring"),
    }  # fmt: skip


def test_what_gives_no_poses_is_refused_with_the_reason():
    for what, (given, unknowns, text) in refusals().items():
        with pytest.raises((InputError, GeometryError)) as error:
            bundle_adjust(given, unknowns)
        assert re.search(text, str(error.value)), (what, error.value)


def test_a_project_file_without_poses_becomes_one_with_poses(tmp_path):
    truth, given = waved(places=8, particles=4)
    source, out = tmp_path / "wand.toml", tmp_path / "tank.toml"
    write_project(source, given)
    assert "centre" not in source.read_text()
    assert read_project(source, posed=False).without_pose == given.without_pose
    command = ["adjust", str(source), "--control", "free", "--scale-bar", "@a,@b,80,0.02"]
    result = CliRunner().invoke(main, [*command, "--out", str(out)])
    assert result.exit_code == 0, result.output
    np.testing.assert_allclose(apart_of(read_project(out).cameras), apart_of(truth), rtol=0.01)
    # What needs poses says how to come by them.
    for word in ("project", "intersect"):
        result = CliRunner().invoke(main, [word, str(source)])
        assert result.exit_code == 1, word
        assert "no pose is stated for c0, c1, c2" in result.output
        assert "Traceback" not in result.output


def test_a_resection_needs_no_pose_to_begin_with(tmp_path):
    xyz, ids = control(20), tuple(f"p{k}" for k in range(20))
    truth, given = photographed("glass", xyz, ids)
    source, out = tmp_path / "tank.toml", tmp_path / "posed.toml"
    write_project(source, replace(given, object_points=ObjectPoints(ids=ids, xyz=xyz)))
    result = CliRunner().invoke(main, ["resect", str(source), "--out", str(out)])
    assert result.exit_code == 0, result.output
    for camera, true in zip(read_project(out).cameras, truth, strict=True):
        np.testing.assert_allclose(camera.centre, true.centre, atol=0.5)


def test_a_large_free_network_of_two_cameras_may_turn_about_the_line_through_both():
    """With more than 400 unknowns the datum is that of the cameras, whose turns have to count."""
    truth, given = waved("far pair", places=20, particles=120, c=12.0, noise=0.003)
    result = bundle_adjust(replace(given, cameras=tuple(truth), without_pose=()), FREE)
    assert result.sigma0 == pytest.approx(0.003, rel=0.15)


def test_points_on_scale_bars_hold_the_datum_where_hardly_any_other_point_is_left():
    truth, given = waved("ports", places=10, particles=0)
    lonely = without_rows(given, lambda camera, name: name != "0a" or camera == "c0")
    result = bundle_adjust(replace(lonely, cameras=tuple(truth), without_pose=()), FREE)
    assert result.sigma0 == pytest.approx(NOISE, rel=0.3)


def test_image_points_of_other_points_are_left_out_and_named():
    truth, given = waved(places=15, particles=15)
    images = given.image_points
    rows = [3, 40, 71]
    image = images.image.copy()
    image[rows] += [[0.6, -0.4], [-0.5, 0.5], [0.3, 0.8]]
    result = bundle_adjust(replace(given, image_points=replace(images, image=image)), FREE)
    assert result.sigma0 == pytest.approx(NOISE, rel=0.25)
    assert "3 image points left out" in result.remarks[1]
    for row in rows:
        assert f"{images.ids[row]} in {images.cameras[row]}" in result.remarks[1]
    np.testing.assert_allclose(apart_of(result.project.cameras), apart_of(truth), rtol=0.01)


def test_of_exact_images_none_is_taken_for_that_of_another_point():
    _, given = waved(noise=1e-9)
    result = bundle_adjust(replace(given, sigma_image=NOISE), FREE)
    assert not [text for text in result.remarks if "left out" in text]
    assert result.sigma0 < 1e-7
