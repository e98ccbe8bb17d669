"""``multimedia track``: targets of four cameras through water in, tracks in every format out."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import Brown, FlatInterface, Layers, Project, intersect, project, write_project
from multimedia.media.camera import EXTERIOR
from multimedia.openptv.openptv_files import read_blobs, read_correspondences, read_targets
from multimedia.projects.project_file import read_project
from multimedia.tracking.self_calibration import calibrated_on_particles
from photocore.camera.similarity import fit_similarity
from photocore.errors import InputError
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import SENSOR, cameras
from tests.multimedia.tracking.flows import seen_through_water

COUNT, FRAMES, FIRST = 60, 8, 10001
WATER = FlatInterface(layers=Layers(indices=(1.0, 1.337)))


def place(t: int) -> np.ndarray:
    """Return where the particles are in a frame: they turn and rise. [mm]"""
    x, y, z = np.random.default_rng(5).uniform((-60, -50, -150), (60, 50, -60), (COUNT, 3)).T
    turn = np.exp(0.06j * t) * (x + 1j * y)
    return np.column_stack([turn.real, turn.imag, z + 1.5 * t])


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """Return a folder with a project and targets, and whose each target is, by frame and camera."""
    folder, rng = tmp_path_factory.mktemp("sequence"), np.random.default_rng(9)
    views = [replace(c, principal_point=np.zeros(2), sensor=SENSOR) for c in cameras(Brown())]
    tank = Project(cameras=tuple(views), media={"w": WATER}, media_of=("w",) * 4, unit="mm")
    write_project(folder / "tank.toml", tank)
    owners = {}
    for t in range(FRAMES):
        for k, camera in enumerate(views):
            seen = SENSOR.pixel_from_image(seen_through_water(camera, place(t), 1.337, 0.0))
            seen = seen + 0.1 * rng.standard_normal(seen.shape)
            order = rng.permutation(COUNT)
            lines = [f"{n} {x:.4f} {y:.4f} 9 3 3 99 -1\n" for n, (x, y) in enumerate(seen[order])]
            path = folder / f"{camera.name}.{FIRST + t}_targets"
            path.write_text(f"{COUNT}\n" + "".join(lines))
            owners[t, k] = order
    return folder, owners


def run(folder: Path, *words: str, bases: tuple[str, ...] = ("cam1", "cam2", "cam3", "cam4")):
    targets = [word for base in bases for word in ("--targets", str(folder / f"{base}."))]
    return CliRunner().invoke(main, ["track", str(folder / "tank.toml"), *targets, *words])


def test_tracks_are_those_of_the_particles_in_every_format(sequence, tmp_path):
    h5py = pytest.importorskip("h5py")
    folder, owners = sequence
    out, files = tmp_path / "tracks.csv", tmp_path / "res"
    got = run(folder, "--rate", "50", "--out", str(out), "--folder", str(files), "--json")
    assert got.exit_code == 0, got.output
    said = json.loads(got.stdout)
    assert said["tracks"] == COUNT
    assert said["frames"] == [FIRST, FIRST + FRAMES - 1]
    assert said["sigma_px"] == pytest.approx(0.1, rel=0.1)
    assert said["by_chance_at_most"] < 0.1 * said["particles_tested"]
    assert said["in_no_track"] == 0
    assert said["in_tracks_by_chance"] < 0.1 * COUNT * FRAMES
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == COUNT * FRAMES
    whose = {}
    miss, speeds = [], []
    for row in rows:
        t = int(row["frame"]) - FIRST
        names = {int(owners[t, k][int(row[f"cam{k + 1} target"])]) for k in range(4)
                 if row[f"cam{k + 1} target"]}  # fmt: skip
        assert len(names) == 1
        name = names.pop()
        assert whose.setdefault(row["track"], name) == name
        xyz = np.array([float(row[f"{a} [mm]"]) for a in "XYZ"])
        sigma = np.array([float(row[f"sigma_{a} [mm]"]) for a in "XYZ"])
        miss.append((xyz - place(t)[name]) / sigma)
        x, y, _ = place(t)[name]
        true = 50 * np.array([-0.06 * y, 0.06 * x, 1.5])
        v = np.array([float(row[f"v{a} [mm/s]"]) for a in "XYZ"])
        speeds.append((v - true) / [float(row[f"sigma_v{a} [mm/s]"]) for a in "XYZ"])
    assert np.sqrt(np.mean(np.square(miss))) == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(np.mean(np.square(speeds))) == pytest.approx(1.0, abs=0.15)

    for t in range(FRAMES):
        xyz, numbers = read_correspondences(files / f"rt_is.{FIRST + t}")
        links = np.loadtxt(files / f"ptv_is.{FIRST + t}", skiprows=1)
        assert np.abs(links[:, 2:] - xyz).max() == 0.0
        names = owners[t, 0][numbers[:, 0]]
        assert np.abs(xyz - place(t)[names]).max() < 0.5
        assert ((links[:, 0] == -1).all()) == (t == 0)
        assert ((links[:, 1] == -2).all()) == (t == FRAMES - 1)
        if t:
            before = read_correspondences(files / f"rt_is.{FIRST + t - 1}")[1]
            assert (owners[t - 1, 0][before[links[:, 0].astype(int), 0]] == names).all()

    again = run(folder, "--rate", "50", "--out", str(tmp_path / "tracks.h5"))
    assert again.exit_code == 0, again.output
    assert "480 of 480" not in again.output
    with h5py.File(tmp_path / "tracks.h5") as file:
        assert file["xyz"].attrs["unit"] == "mm"
        assert file["velocity"].attrs["unit"] == "mm/s"
        assert list(file.attrs["cameras"]) == ["cam1", "cam2", "cam3", "cam4"]
        assert file["track"][:].tolist() == [int(row["track"]) for row in rows]
        table = [[float(row[f"{a} [mm]"]) for a in "XYZ"] for row in rows]
        assert np.abs(file["xyz"][:] - table).max() < 1e-5
        assert file["targets"].shape == (COUNT * FRAMES, 4)


def test_tracks_of_cameras_in_the_wrong_order_are_chance(sequence, tmp_path):
    got = run(sequence[0], "--out", str(tmp_path / "t.csv"), bases=("cam2", "cam1", "cam4", "cam3"))
    assert got.exit_code == 1
    assert "order of the cameras cam1, cam2, cam3, cam4" in got.stderr
    assert not list(tmp_path.iterdir())


def test_a_lost_file_is_a_frame_without_targets(sequence, tmp_path):
    folder = tmp_path / "part"
    shutil.copytree(sequence[0], folder)
    (folder / f"cam2.{FIRST + 3}_targets").unlink()
    got = run(folder, "--json")
    assert got.exit_code == 0, got.stderr
    assert f"1 files of targets are not there (cam2.{FIRST + 3}_targets)" in got.stderr
    assert json.loads(got.stdout)["tracks"] == COUNT
    for camera in (1, 3, 4):
        (folder / f"cam{camera}.{FIRST + 3}_targets").unlink()
    got = run(folder)
    assert got.exit_code == 1
    assert f"frame {FIRST + 3} is not there" in got.stderr


def test_bad_input_is_one_message(sequence, tmp_path, monkeypatch):
    folder, _ = sequence
    for words, text in (
        (["--first", "9999"], "frame 9999 is not there of every camera"),
        (["--last", "999999999999"], f"frame {FIRST + FRAMES} is not there of every camera"),
        (["--last", "10002"], "Three or more in a row are needed"),
        (["--out", str(tmp_path / "t.txt")], ".csv, .xlsx or .h5"),
        (["--change", "1e-9"], "no track of 4 points"),
    ):
        got = run(folder, *words)
        assert got.exit_code == 1
        assert text in got.stderr
    got = run(folder, bases=("cam1", "cam2"))
    assert "once per camera, in the order cam1, cam2, cam3, cam4" in got.stderr
    got = run(folder, bases=("cam1", "cam2", "cam3", "other"))
    assert "no files other.NUMBER_targets there" in got.stderr
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    got = run(folder, "--out", str(tmp_path / "t.h5"))
    assert got.exit_code == 1
    assert "[hdf]" in got.stderr
    assert not list(tmp_path.iterdir())


def test_blobs_of_myptv_are_followed_as_targets_are(sequence, tmp_path):
    """All frames in one file, row first; a frame in which a camera sees nothing has no line."""
    folder, _ = sequence
    words, places = [], {}
    for k in range(1, 5):
        rows = []
        for t in range(FRAMES):
            targets = read_targets(folder / f"cam{k}.{FIRST + t}_targets").pixels
            places[k, t] = targets
            if (k, t) != (2, 4):
                rows += [f"{row:.4f}\t{column:.4f}\t3\t3\t9\t{t}" for column, row in targets]
        path = tmp_path / f"blobs_cam{k}"
        path.write_text("\n".join(rows) + "\n")
        words += ["--targets", str(path)]
    np.testing.assert_allclose(read_blobs(tmp_path / "blobs_cam3")[5], places[3, 5], atol=1e-9)
    done = CliRunner().invoke(main, ["track", str(folder / "tank.toml"), *words, "--json"])
    data = json.loads(done.stdout)
    assert (data["tracks"], data["frames"]) == (COUNT, [0, FRAMES - 1])
    assert "not there" not in done.output


def test_a_file_that_is_none_of_blobs_is_named(sequence):
    folder, _ = sequence
    words = [w for k in range(1, 5) for w in ("--targets", str(folder / f"cam{k}.10001_targets"))]
    done = CliRunner().invoke(main, ["track", str(folder / "tank.toml"), *words])
    assert done.exit_code == 1
    assert "cam1.10001_targets: line 1: 1 values, expected row, column" in done.output


def test_cameras_that_moved_are_put_right_by_the_particles(sequence, tmp_path):
    folder, _ = sequence
    truth, rng = read_project(folder / "tank.toml"), np.random.default_rng(12)
    steps = rng.standard_normal((4, 6)) * [0.4, 0.4, 0.4, 1e-3, 1e-3, 1e-3]
    moved = [c.stepped(EXTERIOR, step) for c, step in zip(truth.cameras, steps, strict=True)]
    shutil.copytree(folder, tmp_path / "moved")
    write_project(
        tmp_path / "moved" / "tank.toml", replace(truth, cameras=tuple(moved)), overwrite=True
    )
    last = str(FIRST + 3)
    words = ("--calibrate", str(tmp_path / "tank2.toml"), "--last", last, "--json")
    got = run(tmp_path / "moved", *words)
    assert got.exit_code == 0, got.output
    result = json.loads(got.stdout)
    calibration = result["calibration"]
    assert min(calibration["before"]) > 1.0
    # Four rays of 0.1 px have eight coordinates and three unknowns.
    assert max(calibration["after"]) < 0.15
    assert calibration["sigma_px"] == pytest.approx(0.1, rel=0.15)
    assert result["tracks"] == COUNT
    cameras_after = read_project(tmp_path / "tank2.toml").cameras
    xyz = place(3)
    image = [project(c, xyz, WATER) for c in truth.cameras]
    off = [misses(views, image, xyz) for views in (moved, cameras_after)]
    assert off[1] < 0.8 * off[0], off
    for camera, before, sigma in zip(
        cameras_after, truth.cameras, calibration["sigma"], strict=True
    ):
        assert np.linalg.norm(camera.centre - before.centre) < 3.0 * sigma


def misses(views, image, xyz):
    """Return how far points are off, but for place, turn and scale of all. [mm]"""
    got = intersect(views, image, WATER).xyz
    similarity = fit_similarity(got, xyz)
    back = similarity(got) - xyz
    return float(np.sqrt((back**2).mean()))


def test_two_cameras_are_not_calibrated_on_particles(sequence):
    folder, _ = sequence
    truth = read_project(folder / "tank.toml")
    with pytest.raises(InputError, match="three are needed"):
        calibrated_on_particles(
            replace(truth, cameras=truth.cameras[:2], media_of=("w",) * 2), [[np.zeros((9, 2))] * 2]
        )
