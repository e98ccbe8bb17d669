"""Particles of a frame: exact clouds with clutter, a real frame against OpenPTV's own tuples."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import FlatInterface, InputError, Project, correspondences, project, write_project
from multimedia.openptv.openptv_files import (
    glass_interface,
    read_camera,
    read_control,
    read_correspondences,
)
from multimedia.openptv.ray_meetings import meeting_rays
from multimedia.openptv.target_map import TargetMap
from photocore.arrays import each_once
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import LAYERS, SENSOR, cameras

WALL = FlatInterface(layers=LAYERS)
VIEWS = [replace(camera, sensor=SENSOR) for camera in cameras()]


def frame(count: int, noise: float, clutter: int, seed: int):
    """Return particles, the targets of each camera in any order, and the true tuples."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform((-60, -50, -150), (60, 50, -50), (count, 3))
    targets, numbers = [], np.empty((count, 4), dtype=int)
    for k, camera in enumerate(VIEWS):
        seen = camera.sensor.pixel_from_image(project(camera, xyz, WALL))
        seen = seen + noise * rng.standard_normal(seen.shape)
        pixels = np.vstack([seen, rng.uniform((0, 0), (1280, 1024), (clutter, 2))])
        order = rng.permutation(len(pixels))
        targets.append(pixels[order])
        numbers[:, k] = np.argsort(order)[:count]
    return xyz, targets, numbers


def test_all_particles_are_found_among_clutter_and_none_else():
    xyz, targets, numbers = frame(100, 0.1, 50, 5)
    got, tuples, misfit = correspondences(VIEWS, targets, [WALL] * 4, tolerance=0.6)
    full = (tuples >= 0).all(axis=1)
    truth = {tuple(row) for row in numbers.tolist()}
    right = [tuple(row) in truth for row in tuples[full].tolist()]
    assert sum(right) >= 98
    assert full.sum() - sum(right) <= 1
    assert np.median(misfit[full]) < 0.2
    place = {tuple(row): point for row, point in zip(numbers.tolist(), xyz, strict=True)}
    apart = [
        np.linalg.norm(place[tuple(row)] - point)
        for row, point in zip(tuples.tolist(), got, strict=True)
        if tuple(row) in place
    ]
    assert np.median(apart) < 0.1  # 0.1 px of 12 um at 500 mm and 25 mm are 0.024 mm across
    # Each target once.
    for k in range(4):
        used = tuples[tuples[:, k] >= 0, k]
        assert len(set(used.tolist())) == len(used)


def test_a_particle_that_a_camera_missed_is_found_by_the_others():
    _, targets, numbers = frame(40, 0.0, 0, 6)
    targets[2] = np.delete(targets[2], numbers[0, 2], axis=0)
    _, tuples, _ = correspondences(VIEWS, targets, [WALL] * 4, tolerance=0.01)
    assert len(tuples) == 40
    lonely = tuples[tuples[:, 2] < 0]
    assert lonely.tolist() == [[numbers[0, 0], numbers[0, 1], -1, numbers[0, 3]]]


def test_meeting_rays_are_all_that_meet_and_each_row_is_taken_once():
    rng = np.random.default_rng(14)
    rays = []
    for x in (-200.0, 200.0):
        origins = rng.normal((x, 0.0, 1e4), (40.0, 40.0, 0.0), (120, 3))
        along = rng.normal((-x, 0.0, 9.7e3), (60.0, 60.0, 60.0), (120, 3)) - origins
        rays.append((origins, along / np.linalg.norm(along, axis=1)[:, None]))
    wide = [(rng.uniform(0.0, 2.0, 120), 0.002), (rng.uniform(0.0, 2.0, 120), 0.001)]
    one, two, _ = map(np.concatenate, zip(*meeting_rays(*rays, *wide), strict=True))
    got = set(zip(one.tolist(), two.tolist(), strict=True))
    (o1, d1), (o2, d2) = rays
    expected = set()
    for a in range(120):
        both = np.stack([np.broadcast_to(d1[a], d2.shape), -d2], axis=2)
        far = np.stack([np.linalg.lstsq(m, o - o1[a])[0] for m, o in zip(both, o2, strict=True)])
        gap = np.linalg.norm(np.einsum("nij,nj->ni", both, far) - (o2 - o1[a]), axis=1)
        limit = wide[0][0][a] + wide[1][0] + far @ (0.002, 0.001)
        expected |= {
            (a, b) for b in np.flatnonzero((far > 0).all(axis=1) & (gap <= limit)).tolist()
        }
    assert got == expected
    assert len(expected) > 20
    numbers = np.array([*expected])[rng.permutation(len(expected))]
    rows, used = set(each_once(numbers).tolist()), (set(), set())
    for row, pair in enumerate(numbers.tolist()):
        is_used = any(n in one for n, one in zip(pair, used, strict=True))
        assert (row in rows) != is_used
        if not is_used:
            for n, one in zip(pair, used, strict=True):
                one.add(n)


@pytest.mark.parametrize(("side", "count"), [(1.0, 1), (-1.0, 0)])
def test_rays_meet_before_their_cameras_in_any_unit_and_never_behind(side, count):
    """0.5 away from cameras 0.6 apart: half a metre, or half a millimetre."""
    origins = np.array([[[-0.3, 0.0, 0.0]], [[0.3, 0.0, 0.0]]])
    along = side * np.array([[[0.6, 0.0, 0.8]], [[-0.6, 0.0, 0.8]]])
    width = (np.array([1e-6]), 0.0)
    (meeting,) = meeting_rays(*zip(origins, along, strict=True), width, width)
    assert len(meeting[0]) == count
    np.testing.assert_allclose(meeting[2], np.tile([0.0, 0.0, 0.4], (count, 1)), atol=1e-12)


@pytest.mark.parametrize("reach", [0.03, 2.0, 30.0])
def test_a_map_of_targets_returns_the_nearest_within_reach(reach: float):
    rng = np.random.default_rng(15)
    pixels, places = rng.uniform(0.0, 400.0, (500, 2)), rng.uniform(-50.0, 450.0, (4000, 2))
    places[:500] = pixels + rng.normal(0.0, 0.7 * reach, (500, 2))
    away = np.linalg.norm(places[:, None] - pixels, axis=2)
    expected = np.where(away.min(axis=1) < reach, away.argmin(axis=1), -1)
    assert (expected[:500] >= 0).sum() > 200
    places[-1] = np.nan
    expected[-1] = -1
    assert TargetMap(pixels, reach).nearest(places).tolist() == expected.tolist()
    assert TargetMap(pixels[:1], reach).nearest(pixels[:2]).tolist() == [0, -1]


def test_no_targets_are_no_particles():
    none = [np.empty((0, 2))] * 4
    xyz, tuples, misfit = correspondences(VIEWS, none, [WALL] * 4)
    assert (len(xyz), len(tuples), len(misfit)) == (0, 0, 0)
    with pytest.raises(InputError, match="at least 5 to agree"):
        correspondences(VIEWS, none, [WALL] * 4, fewest=5)


def written_frame(folder: Path, targets) -> list[str]:
    """Write a project and target files; return the words of the command."""
    tank = Project(cameras=tuple(VIEWS), media={"w": WALL}, media_of=("w",) * 4, unit="mm")
    write_project(folder / "tank.toml", tank)
    words = ["particles", str(folder / "tank.toml")]
    for k, pixels in enumerate(targets):
        lines = [f"{n} {x:.6f} {y:.6f} 9 3 3 99 -1" for n, (x, y) in enumerate(pixels)]
        path = folder / f"cam{k}.1_targets"
        path.write_text(f"{len(lines)}\n" + "\n".join(lines) + "\n")
        words += ["--targets", str(path)]
    return words


def test_targets_that_have_nothing_to_do_with_each_other_are_no_particles(tmp_path: Path):
    _, targets, _ = frame(0, 0.0, 110, 11)
    words = [
        *written_frame(tmp_path, targets),
        "--tolerance",
        "3",
        "--out",
        str(tmp_path / "p.csv"),
    ]
    got = CliRunner().invoke(main, words)
    assert got.exit_code == 1
    assert "these are chance" in got.stderr
    assert "--fewest 4" in got.stderr
    assert not (tmp_path / "p.csv").exists()


def test_how_many_come_by_chance_is_said_beside_the_particles(tmp_path: Path):
    _, targets, numbers = frame(30, 0.1, 110, 12)
    words = [*written_frame(tmp_path, targets), "--tolerance", "8"]
    got = CliRunner().invoke(main, [*words, "--json"])
    assert got.exit_code == 0, got.output
    found = json.loads(got.stdout)
    truth = {tuple(row) for row in numbers.tolist()}
    wrong = sum(tuple(one["targets"]) not in truth for one in found["particles"])
    assert wrong == 10
    # True ones leave fewer targets to chance than the displaced frames have.
    assert wrong < found["by_chance_at_most"] < 3.5 * wrong
    assert "by chance at most" in CliRunner().invoke(main, words).stdout


def test_a_tolerance_that_fits_the_targets_is_proposed_and_holds(tmp_path: Path):
    _, targets, numbers = frame(250, 0.1, 150, 13)
    words = written_frame(tmp_path, targets)
    got = CliRunner().invoke(main, [*words, "--json"])
    assert got.exit_code == 0, got.output
    wide = json.loads(got.stdout)["by_chance_at_most"]
    assert wide > 50
    said = re.search(r"--tolerance (\S+) would do: targets are good to (\S+) px", got.stderr)
    assert said, got.stderr
    assert 0.3 <= float(said[1]) <= 0.7
    assert float(said[2]) == pytest.approx(0.1, rel=0.15)
    again = CliRunner().invoke(main, [*words, "--tolerance", said[1], "--json"])
    found = json.loads(again.stdout)
    assert "would do" not in again.stderr
    assert found["by_chance_at_most"] < 0.1 * wide
    tuples = {tuple(one["targets"]) for one in found["particles"]}
    assert len(tuples & {tuple(row) for row in numbers.tolist()}) >= 245
    # `track` takes it unless another is stated.
    for k, number in product(range(4), (2, 3, 4)):
        shutil.copy(tmp_path / f"cam{k}.1_targets", tmp_path / f"cam{k}.{number}_targets")
    bases = [word for k in range(4) for word in ("--targets", str(tmp_path / f"cam{k}."))]
    tracked = CliRunner().invoke(main, ["track", str(tmp_path / "tank.toml"), *bases])
    assert f"particles were sought within {float(said[1]):g} px" in tracked.stderr


@pytest.mark.acceptance
def test_a_real_frame_gives_openptvs_tuples(data_dir):
    folder = data_dir / "openptv_cavity"
    with (folder / "particles_frame10001.csv").open() as file:
        rows = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])
    sensor, views, media = read_control(folder / "ptv.par").sensor, [], []
    for k in range(1, 5):
        path = folder / f"particles_cam{k}.tif.ori"
        camera, glass, _ = read_camera(path, sensor=sensor, name=f"cam{k}")
        views.append(camera)
        media.append(glass_interface(glass, (1, 1.33, 1.46), 6.0))
    orders = [np.random.default_rng(k).permutation(len(rows)) for k in range(4)]
    targets = [rows[order][:, 2 * k : 2 * k + 2] for k, order in enumerate(orders)]
    # Rays of this calibration miss each other by 0.31 mm, some 3 px.
    _, tuples, _ = correspondences(views, targets, media, tolerance=5.0)
    owner = [np.where(tuples[:, k] >= 0, orders[k][tuples[:, k]], -1) for k in range(4)]
    alike = [len({int(n) for n in row if n >= 0}) == 1 for row in zip(*owner, strict=True)]
    assert len(tuples) >= 290
    assert np.mean(alike) > 0.93


def test_the_command_writes_what_openptv_reads(tmp_path: Path):
    xyz, targets, numbers = frame(30, 0.0, 0, 7)
    words = [*written_frame(tmp_path, targets), "--tolerance", "0.05"]
    run = CliRunner().invoke
    got = run(main, [*words, "--json", "--out", str(tmp_path / "rt_is.1")])
    assert got.exit_code == 0, got.output
    assert len(json.loads(got.stdout)["particles"]) == 30
    places, tuples = read_correspondences(tmp_path / "rt_is.1")
    order = [numbers.tolist().index(row) for row in tuples.tolist()]
    assert np.abs(places - xyz[order]).max() < 1e-3
    table = run(main, [*words, "--out", str(tmp_path / "p.csv")])
    assert "30 of 30 targets used" in table.stdout
    assert (tmp_path / "p.csv").read_text().startswith("id,X [mm],Y [mm],Z [mm],cam1 target")
    short = run(main, words[:-4])
    assert short.exit_code == 1
    assert "3 file(s) of targets for 4 cameras" in short.stderr
    wrong = run(main, [*words, "--out", str(tmp_path / "p.txt")])
    assert wrong.exit_code == 1
    assert "rt_is.FRAME" in wrong.stderr
