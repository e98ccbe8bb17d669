"""Pairs of one wall behind water or ports, adjusted together; rays from tests/scenes/wet.py."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import Pair, PairMedia, Pinhole
from bifocal.model.orientation_precision import pinhole
from bifocal.networks.joint_adjustment import (
    JointAdjustment,
    JointUnknowns,
    adjust_jointly,
)
from bifocal.networks.joint_observations import JointObservations
from bifocal.networks.joint_workflow import _adjusted_pair, _adjusted_photo
from multimedia import Layers
from tests.bifocal.model.test_pair_through_media import PAIRS, content
from tests.bifocal.orientation.street import CONTROL, write_table
from tests.builders.commands import bifocal_command as main
from tests.builders.pinholes import camera_matrix, rotation_from_vector
from tests.scenes import SetupErrors, bifocal_cameras, demo_scene, render
from tests.scenes.wet import WetCamera, under_water

AQUARIUM = {"indices": (1.0, 1.49, 1.337), "thicknesses": (0.02,)}
#: First interface over the wall where it stays with the object, else z0 of a port. [m]
KINDS = {"tank": (2.0, None), "port": (None, 0.06), "leaning": (None, 0.06)}
#: Axes of a port that leans by 8 and 5 degrees, one a row, in the frame of its camera.
LEANING = rotation_from_vector(np.radians([8.0, -5.0, 0.0])) @ np.diag([1.0, -1, -1])


def media_told(*kinds):
    """Return what the package is told of both cameras' media; of one kind for both."""
    kinds = kinds * (3 - len(kinds))
    height, port = KINDS[kinds[0]]
    leaning = [kind == "leaning" for kind in kinds]
    return PairMedia(
        layers=Layers(**AQUARIUM), port=port and (port, port),
        depth=height and height - AQUARIUM["thicknesses"][0],
        normals=tuple(LEANING[2] if leans else None for leans in leaning), turning=tuple(leaning),
    )  # fmt: skip


def wet(camera, kind):
    """Return a camera behind media, and what the package is told of them."""
    height, port = KINDS[kind]
    z0 = camera.centre[2] - height if height else port
    axes = LEANING if kind == "leaning" else None
    told = media_told(kind)
    return WetCamera(
        matrix=camera.matrix, rotation=camera.rotation, centre=camera.centre, size=(5000, 3300),
        z0=z0, axes=np.eye(3) if axes is None else axes @ camera.rotation, **AQUARIUM,
    ), told  # fmt: skip


def camera_at(rng, middle, distance, focal):
    turn = np.diag([1.0, -1, -1]) @ rotation_from_vector(rng.normal(0, 0.01, 3))
    centre = np.array([middle, 0.0, distance]) + rng.normal(0, 0.05, 3)
    return Pinhole(camera_matrix(focal, 1.0, 2500, 1650), turn, centre)


@pytest.mark.parametrize("kind", KINDS)
def test_a_camera_sees_through_media_what_traced_rays_show(kind):
    """Pixels, and their slopes as the camera moves and turns, and the interface with it or not."""
    rng = np.random.default_rng(1)
    camera = camera_at(rng, 0.5, 7.0, 6000.0)
    xyz = rng.uniform([-2, -1.5, -0.4], [2, 1.5, 0.6], (20, 3))
    scene, media = wet(camera, kind)
    view = media.view(0, camera, xyz)
    np.testing.assert_allclose(view.pixels, scene.view_of(xyz), atol=1e-7)

    def slope(change, step=1e-5):
        moved = [wet(camera.stepped(sign * step * change), kind)[0] for sign in (1, -1)]
        return (moved[0].view_of(xyz) - moved[1].view_of(xyz)) / (2 * step)

    for k in (0, *range(4, 10)):
        np.testing.assert_allclose(
            view.by_camera[:, :, k], slope(np.eye(10)[k]), rtol=1e-5, atol=2e-3
        )
    for k, way in enumerate(1e-5 * np.eye(3)):
        numeric = (scene.view_of(xyz + way) - scene.view_of(xyz - way)) / 2e-5
        np.testing.assert_allclose(view.by_point[:, :, k], numeric, rtol=1e-5, atol=2e-3)


def measured(kind, rng, pairs=3, noise=0.4):
    """Return observations, a start and true points of overlapping pairs through media."""
    cameras = [
        camera_at(rng, 3.0 * k, distance, focal)
        for k in range(pairs) for focal, distance in ((6000.0, 9.0), (3400.0, 5.2))
    ]  # fmt: skip
    count = 40 * pairs
    xyz = rng.uniform([-3, -2, -0.3], [3.0 * pairs, 2, 0.5], (count, 3))
    known = np.full((count, 3), np.nan)
    known[:8] = xyz[:8] + rng.normal(0, 0.001, (8, 3))
    seen = []
    for number, camera in enumerate(cameras):
        pixels = wet(camera, kind)[0].view_of(xyz)
        inside = ((pixels > 0) & (pixels < (5000, 3300))).all(axis=1)
        seen += [(number, k, *pixels[k]) for k in np.flatnonzero(inside)]
    rays = np.array(seen)
    observations = JointObservations(
        names=tuple(f"{k // 2}, {('far', 'near')[k % 2]}" for k in range(len(cameras))),
        camera=rays[:, 0].astype(int), point=rays[:, 1].astype(int),
        pixels=rays[:, 2:] + rng.normal(0, noise, (len(rays), 2)),
        sigma=np.full(len(rays), noise), ids=tuple(f"P{k}" for k in range(count)),
        known=known, sigma_known=np.full((count, 3), 0.001), sigma_focal=np.zeros(len(cameras)),
        media=tuple((media_told(kind), k % 2) for k in range(len(cameras))),
    )  # fmt: skip
    off = [np.r_[np.zeros(4), rng.normal(0, 0.003, 3), rng.normal(0, 0.05, 3)] for _ in cameras]
    start = JointUnknowns(
        cameras=tuple(c.stepped(step) for c, step in zip(cameras, off, strict=True)),
        xyz=xyz + rng.normal(0, 0.05, xyz.shape),
    )
    return observations, start, xyz


@pytest.mark.parametrize(
    "kind", [pytest.param("tank", marks=pytest.mark.acceptance), "port", "leaning"]
)
def test_pairs_behind_media_are_as_precise_as_their_sigmas_say(kind):
    observations, start, xyz = measured(kind, np.random.default_rng(2))
    got = adjust_jointly(observations, start)
    assert got.sigma0 == pytest.approx(1.0, abs=0.1)
    error = (got.xyz - xyz)[8:]
    there = np.isfinite(error).all(axis=1)
    twice = np.bincount(observations.point, minlength=len(xyz))[8:] >= 2
    assert there[twice].mean() > 0.95
    variance = np.diagonal(got.covariance, axis1=1, axis2=2)[8:]
    ratio = np.sqrt((error[there] ** 2 / variance[there]).mean())
    assert 0.7 < ratio < 1.4
    assert np.sqrt((error[there] ** 2).mean(axis=0)).max() < 0.012
    # The same rays taken for rays in air.
    dry = adjust_jointly(replace(observations, media=()), start)
    assert dry.sigma0 > 3 or len(dry.blunders) > 20


def test_ports_move_with_the_camera_and_tanks_stay():
    port, tank = (Pair.from_dict(content(name)) for name in ("port", "tank"))
    assert PairMedia.of(port).depth is None
    told = PairMedia.of(tank)
    assert told.depth + told.layers.thickness == pytest.approx(0.9)
    higher = pinhole(tank.image1)._replace(centre=np.array([0.0, 0.0, 3.6]))
    assert told.z0(0, higher) == pytest.approx(2.7)
    assert PAIRS["tank"][1]["z0"] == 2.6


def street_under_water(folder, depth=3.0, middles=(-2.4, 0.0, 2.4), leans=None):
    """Write photos, nominal pair files and tables of a façade behind water.

    Under a surface that stays 3 m over it, or through ports that lean by angles about X and Y.
    """
    rng, paths = np.random.default_rng(7), []
    for number, middle in enumerate(middles):
        name = "abc"[number]
        cameras = bifocal_cameras(
            size=(720, 600), pixel=0.0085, nadir=(middle, 0.0), rng=rng,
            errors=SetupErrors(principal_point=0.0, focal=0.0),
        )  # fmt: skip
        z0 = tuple(float(c.centre[2]) - depth for c in (cameras.far, cameras.near))
        if leans is None:
            sunk = under_water(cameras, indices=(1.0, 1.337), z0=z0)
        else:
            sunk = under_water(cameras, indices=(1.0, 1.337), z0=(0.06, 0.06), leans=leans)
        shot = render(demo_scene(), sunk, rng=rng, gsd=0.1)
        photos = []
        for side, image, camera, nominal in (
            ("far", shot.image1, sunk.far, cameras.nominal_far),
            ("near", shot.image2, sunk.near, cameras.nominal_near),
        ):
            Image.fromarray(image).save(folder / f"{name}_{side}.png")
            shift = np.array([[1.0, 0, -middle], [0, 1, 0], [0, 0, 1]])
            stated = replace(nominal, matrix=camera.matrix).photo(f"{name}_{side}.png")
            # Of a port it is known how it sits before its camera, not how that is turned.
            port = None if leans is None else camera.axes[2] @ camera.rotation.T
            photos.append(
                replace(
                    stated, nadir=stated.nadir - [middle, 0.0],
                    plane_from_pixel=shift @ stated.plane_from_pixel,
                    layers=Layers(indices=(1.0, 1.337)),
                    z0=stated.distance - depth if leans is None else 0.06,
                    interface_normal=None if port is None else port @ nominal.rotation,
                )
            )  # fmt: skip
        path = folder / f"{name}.pair.json"
        Pair(image1=photos[0], image2=photos[1]).write(path)
        seen = [target for target in shot.targets if target.seen]
        for role in ("control", "check"):
            chosen = [t for t in seen if (t.name in CONTROL) == (role == "control")]
            write_table(folder / f"{name}_{role}.csv", chosen, rng)
        paths.append(path)
    return paths


@pytest.mark.acceptance
@pytest.mark.long
@pytest.mark.parametrize("leans", [None, ((6.0, -4.0), (-3.0, 5.0))])
def test_a_rendered_street_under_water_is_adjusted_by_the_command(tmp_path, leans):
    middles = (-2.4, 0.0, 2.4) if leans is None else (-2.4, 0.0)
    paths = street_under_water(tmp_path, middles=middles, leans=leans)
    words = ["adjust", *map(str, paths), "--out", str(tmp_path / "joint"), "--json"]
    for path in paths:
        name = path.name[0]
        words += ["--control", str(tmp_path / f"{name}_control.csv")]
        words += ["--check", str(tmp_path / f"{name}_check.csv")]
    result = CliRunner().invoke(main, [*words, "--sigma-pick", "0.2"])
    assert result.exit_code == 0, result.stderr
    said = json.loads(result.stdout)
    checks = [p for p in said["points"] if p["kind"] == "check"]
    assert len(checks) >= (15 if leans is None else 8)
    assert max(said["rms_px"]) < 0.25
    # 8.5 mm pixels, picks of 0.15 px; a pixel of parallax is worth 1.2 times as much as in air.
    assert np.sqrt(np.mean([p["dX"] ** 2 + p["dY"] ** 2 for p in checks])) < 0.004
    assert np.median([abs(p["dr"]) for p in checks]) < 0.025
    for path in paths:
        pair = Pair.read(tmp_path / "joint" / path.name)
        for photo in (pair.image1, pair.image2):
            stays = photo.distance - photo.z0 if leans is None else 2.94 + photo.z0
            assert stays == pytest.approx(3.0, abs=1e-9)
        with (tmp_path / f"{path.name[0]}_check.csv").open(encoding="utf-8") as file:
            rows = [row for row in csv.reader(file)][1:]
        numbers = np.array([[float(v) for v in row[1:]] for row in rows])
        found = pair.intersect(numbers[:, 3:5], numbers[:, 5:]).xyz - numbers[:, :3]
        assert np.median(np.abs(found[:, 2])) < 0.03


def adjustment(cameras, media, covariances):
    """Return an adjustment of pairs without a point, of covariances (14, 14)."""
    count = len(cameras)
    return JointAdjustment(
        cameras=tuple(cameras), xyz=np.zeros((0, 3)), covariance=np.zeros((0, 3, 3)), sigma0=1.0,
        redundancy=1, iterations=1, residuals=np.zeros((0, 2)), control=np.zeros((0, 3)),
        blunders=(), left_in=(),
        by_camera=np.stack([part for c in covariances for part in (c[:7, :7], c[7:, 7:])]),
        between=np.stack([c[:7, 7:] for c in covariances]),
        observations=JointObservations(
            names=("far", "near") * (count // 2), camera=np.zeros(0, int), point=np.zeros(0, int),
            pixels=np.zeros((0, 2)), sigma=np.zeros(0), ids=(), known=np.zeros((0, 3)),
            sigma_known=np.zeros((0, 3)), sigma_focal=np.zeros(count), media=tuple(media),
        ),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["tank", "port", "leaning port"])
def test_an_adjusted_pair_tells_every_point_what_its_cameras_are_worth(name, tmp_path):
    """By hand: each camera moved alone, z0 and the port following it as they do."""
    pair = Pair.from_dict(content(name))
    cameras = [pinhole(photo) for photo in (pair.image1, pair.image2)]
    media, rng = PairMedia.of(pair), np.random.default_rng(4)
    mixed = rng.normal(size=(14, 14)) * 1e-4
    whole = mixed @ mixed.T
    adjusted = adjustment(cameras, [(media, 0), (media, 1)], [whole])
    made = _adjusted_pair(pair, adjusted, 0, (pair.image1, pair.image2))
    made.write(tmp_path / "made.pair.json")
    again = Pair.read(tmp_path / "made.pair.json")
    assert not again.remarks
    points = np.array([[0.5, 0.3, 0.1], [-0.4, 0.2, -0.2]])
    pixels = pair.project(points)
    np.testing.assert_allclose(again.intersect(*pixels).xyz, points, atol=1e-9)
    by = np.zeros((2, 3, 14))
    for side in (0, 1):
        for column, parameter in enumerate((0, *range(4, 10))):
            ends = []
            for step in (1e-6, -1e-6):
                photos = [pair.image1, pair.image2]
                moved = cameras[side].stepped(step * np.eye(10)[parameter])
                photos[side] = _adjusted_photo(photos[side], moved, media, side)
                ends.append(Pair(image1=photos[0], image2=photos[1]).intersect(*pixels).xyz)
            by[:, :, 7 * side + column] = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(
        again.covariance_of_orientation(points), by @ whole @ by.transpose(0, 2, 1), rtol=1e-4
    )


def test_glass_that_stays_and_leans_is_refused_before_any_work(tmp_path):
    """One glass, 0.3 m before the wall and leaning, seen from two places."""
    normal = np.array([0.1, -0.15, 1.0])
    normal /= np.linalg.norm(normal)
    data = content("leaning port")
    for key in ("image1", "image2"):
        photo = data[key]
        centre = np.array([*photo["nadir"], photo["distance"]])
        data[key] = photo | {
            "interface_normal": normal.tolist(),
            "z0": float(normal @ centre) - 0.3,
        }
    for name in "ab":
        (tmp_path / f"{name}.pair.json").write_text(json.dumps(data))
    words = ["adjust", *(str(tmp_path / f"{n}.pair.json") for n in "ab")]
    done = CliRunner().invoke(main, [*words, "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    assert "a.pair.json: both photos look through one glass" in done.stderr
    square = {key: data[key] | {"interface_normal": [0, 0, 1.0]} for key in ("image1", "image2")}
    told = PairMedia.of(Pair.from_dict({**data, **square}))
    assert told.normals == (None, None)
    assert told.depth is not None


def test_the_covariance_of_a_pair_is_its_own_whatever_pairs_stand_beside_it():
    rng = np.random.default_rng(5)
    camera = camera_at(rng, 0.0, 7.0, 6000.0)
    kinds = ("leaning", "port", "port", "leaning", "tank", "tank")
    media = [(media_told(*kinds[k : k + 2]), side) for k in (0, 2, 4) for side in (0, 1)]
    mixed = rng.normal(size=(3, 14, 14)) * 1e-4
    covariances = mixed @ mixed.transpose(0, 2, 1)
    together = adjustment([camera] * 6, media, covariances)
    found = [together.orientation(k) for k in range(3)]
    for k, own in enumerate(found):
        alone = adjustment([camera] * 2, media[2 * k : 2 * k + 2], covariances[k : k + 1])
        np.testing.assert_array_equal(own, alone.orientation(0))
    # Only a port that leans turns with its camera.
    moves = [(own**2).sum(axis=1) > 0 for own in found[:2]]
    assert (moves[0] != moves[1]).any()
