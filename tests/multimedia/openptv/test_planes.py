"""Multi-plane calibrations of OpenPTV: untidy folders, wrong lists, matches that are none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    Brown,
    Camera,
    Convention,
    FlatInterface,
    Layers,
    Project,
    project,
    read_project,
    write_experiment,
)
from multimedia.openptv.plane_files import labels_of
from multimedia.openptv.workflow import import_openptv
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import SENSOR

NOISE = 0.3  # px
DEPTHS = {"plane1": 0.0, "plane2": -12.0, "plane3": -24.0}
HALF = np.array([SENSOR.width, SENSOR.height]) / 2
WALL = FlatInterface(
    layers=Layers(indices=(1.0, 1.46, 1.33), thicknesses=(6.0,)), point=(0, 0, 60.0)
)


def grid(z: float) -> np.ndarray:
    """Return 11 x 7 dots 10 mm apart."""
    x, y = np.meshgrid(np.arange(-50, 51, 10.0), np.arange(-30, 31, 10.0))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def views() -> list[Camera]:
    """Return two cameras 400 mm before the wall."""
    lens = Brown(k1=3e-5, p1=1e-5, convention=Convention.OPENPTV)
    eyes = [(-150, -90, 400), (150, -100, 410)]
    made = [Camera.looking_at(eye, (0, 0, -10), principal_distance=35.0) for eye in eyes]
    return [
        replace(
            camera, sensor=replace(SENSOR, origin=HALF), name=f"cam{k}", distortion=lens,
            principal_point=(0.1, -0.05 * k), principal_distance=35.0 + 0.2 * k,
        )
        for k, camera in enumerate(made, start=1)
    ]  # fmt: skip


def savetxt(path: Path, table: np.ndarray) -> None:
    """Write floats as pyptv does, numbers from 0."""
    path.parent.mkdir(parents=True, exist_ok=True)
    numbered = np.column_stack([np.arange(len(table)), table])
    np.savetxt(path, numbered, fmt="%9.5f" if table.shape[1] == 2 else "%10.5f")


def seen(camera: Camera, xyz: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return the pixels measured of the dots inside the image, and those dots."""
    pixels = camera.sensor.pixel_from_image(project(camera, xyz, WALL))
    inside = ((pixels > 5) & (pixels < 2 * HALF - 5)).all(axis=1)
    return pixels[inside] + NOISE * rng.standard_normal((inside.sum(), 2)), xyz[inside]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return an experiment as found: stems and files disagree, copies and backups lie about."""
    rng = np.random.default_rng(15)
    folder = tmp_path / "tank"
    cameras = views()
    empty = Project(cameras=tuple(cameras), media={"wall": WALL}, media_of=("wall",) * 2, unit="mm")
    write_experiment(folder, empty)
    stems = [f"cal/{label}_cam" for label in DEPTHS]
    (folder / "parameters" / "multi_planes.par").write_text("3\n" + "  \n".join(stems) + "\n")
    (folder / "parameters" / "._multi_planes.par").write_bytes(b"\0\5\26\7")
    for k, camera in enumerate(cameras, start=1):
        for label, z in DEPTHS.items():
            pixels, xyz = seen(camera, grid(z), rng)
            # The second camera's files are called the other way round.
            stem = f"cal/cam{k}_{label}.tif" if k == 2 else f"cal/{label}_cam{k}.tif"
            savetxt(folder / f"{stem}.crd", pixels)
            savetxt(folder / f"{stem}.fix", xyz)
            (folder / f"{stem}.ori.bck").write_text("0 0 0\n")
            savetxt(folder / f"cal/old/{label}_cam{k} copy.tif.crd", pixels[::-1])
            savetxt(folder / f"cal/old/{label}_cam{k} copy.tif.fix", xyz)
    body = np.column_stack([np.arange(1, 78), grid(0.0)])
    np.savetxt(folder / "cal" / "target_plane1.txt", body, fmt="%g")
    (folder / "parameters" / "cal_ori.par").write_text("cal/target_plane1.txt\n")
    return folder


def rewritten(path: Path, change) -> None:
    table = np.loadtxt(path)
    np.savetxt(path, change(table), fmt="%10.5f")


def test_a_multi_plane_experiment_is_resected_to_its_pixel_noise(folder, tmp_path):
    run = CliRunner().invoke
    made = run(main, ["openptv", str(folder), "--out", str(tmp_path / "t.toml"), "--json"])
    assert made.exit_code == 0, made.output
    data = json.loads(made.stdout)
    said = " ".join(data["remarks"])
    assert "plane2 (cal/plane2_cam1.tif.crd)" in said
    assert "plane3 (cal/cam2_plane3.tif.crd)" in said
    assert "copy" not in said
    got = run(main, ["resect", str(tmp_path / "t.toml"), "--json"])
    assert got.exit_code == 0, got.output
    for camera, truth in zip(json.loads(got.stdout)["cameras"], views(), strict=True):
        assert camera["points"] > 190
        assert camera["sigma0_um"] == pytest.approx(NOISE * 12.0, rel=0.1)
        # 0.3 px of 12 um over 200 points at 430 mm and 35 mm: some 0.02 mm along the axis.
        place = [camera[key] for key in ("X0", "Y0", "Z0")]
        assert place == pytest.approx(truth.centre, abs=0.3)
    # Numbers of each camera count on their own: points are tied by place.
    found = read_project(tmp_path / "t.toml")
    table = found.image_points
    for name, xyz in zip(found.object_points.ids, found.object_points.xyz, strict=True):
        assert name == f"X{xyz[0]:g}Y{xyz[1]:g}Z{xyz[2]:g}"
    assert set(found.object_points.groups) == set(DEPTHS)
    for camera in views():
        rows = table.of_camera(camera.name)
        at = found.object_points.rows([table.ids[row] for row in rows])
        image = project(camera, found.object_points.xyz[at], WALL)
        assert np.abs(table.image[rows] - image).max() < 6 * NOISE * 0.012


@pytest.mark.parametrize(
    ("stems", "labels"),
    [
        (["cal/plane1_cam", "cal/low/Camera"], ["plane1", "low"]),
        (["cam", "cal/low_cam"], ["plane1", "low"]),
        (["day1/body_cam", "day2/body_cam"], ["plane1", "plane2"]),
    ],
)
def test_positions_are_called_as_their_files_and_counted_where_two_are_called_alike(stems, labels):
    assert labels_of(stems) == labels


@pytest.mark.acceptance
def test_a_list_shifted_by_a_row_is_refused_though_it_fits_alone(folder):
    # Every dot of plane 3 is taken for its neighbour 10 mm farther: one camera sees that, but not
    # together with the other planes.
    rewritten(folder / "cal/plane3_cam1.tif.fix", lambda t: t + np.array([0, 10.0, 0, 0]))
    found = import_openptv(folder, out=None)
    said = " ".join(found.project.remarks)
    assert "cam1: cal/plane3_cam1.tif.crd was refused: it contradicts the other planes" in said
    assert "cam2: took" in said


@pytest.mark.acceptance
def test_a_list_in_another_order_is_refused_and_single_wrong_points_too(folder):
    order = np.random.default_rng(7).permutation(77)
    rewritten(
        folder / "cal/plane2_cam1.tif.crd",
        lambda table: np.column_stack([table[:, 0], table[order[order < len(table)], 1:]]),
    )
    rewritten(folder / "cal/plane1_cam1.tif.crd", lambda t: t + np.outer(t[:, 0] == 7, [0, 40, 0]))
    found = import_openptv(folder, out=None)
    said = [line for line in found.project.remarks if line.startswith("cam1")]
    assert any("plane2_cam1.tif.crd was refused: no camera sees" in line for line in said)
    assert any("1 points were refused" in line for line in said)


@pytest.mark.acceptance
def test_one_file_of_all_planes_serves_where_those_of_the_planes_are_missing(folder):
    tables = {
        ending: [np.loadtxt(folder / f"cal/{label}_cam1.tif.{ending}") for label in DEPTHS]
        for ending in ("crd", "fix")
    }
    for path in folder.rglob("plane*_cam1*.tif.*"):
        path.unlink()
    for ending, parts in tables.items():
        savetxt(folder / f"cal/cam1.tif.{ending}", np.vstack(parts)[:, 1:])
    found = import_openptv(folder, out=None)
    assert "cam1: took" in " ".join(found.project.remarks)
    assert "all planes (cal/cam1.tif.crd)" in " ".join(found.project.remarks)
    assert found.matched[0] > 190


@pytest.mark.acceptance
def test_millimetres_and_points_that_were_not_found_are_understood(folder):
    # As OpenPTV before pyptv: whole numbers, -999 for none, mm from the centre with y up.
    for label in DEPTHS:
        path = folder / f"cal/{label}_cam1.tif.crd"
        table = np.loadtxt(path)
        mm = (table[:, 1:] - HALF) * [0.012, -0.012]
        lines = [
            f"{int(n):3d} {x:9.5f} {y:9.5f}" for n, (x, y) in zip(table[:, 0], mm, strict=True)
        ]
        lines[4] = "-999  -7.68000  6.14400"
        path.write_text("\n".join(lines) + "\n")
    found = import_openptv(folder, out=None)
    said = next(line for line in found.project.remarks if line.startswith("cam1: took"))
    assert float(said.rpartition("), ")[2].split()[0]) == pytest.approx(NOISE, rel=0.1)
    assert found.matched[0] < found.matched[1]


@pytest.mark.acceptance
def test_a_body_file_in_another_folder_serves_where_the_own_is_missing(folder):
    (folder / "cal/plane1_cam1.tif.fix").unlink()
    said = " ".join(import_openptv(folder, out=None).project.remarks)
    assert "plane1 (cal/plane1_cam1.tif.crd with cal/old/plane1_cam1 copy.tif.fix)" in said


def test_endings_in_capitals_are_the_same_files(folder):
    for path in [*folder.rglob("*_cam1.tif.crd"), *folder.rglob("*_cam1.tif.fix")]:
        path.rename(path.with_name(path.name.replace(path.suffixes[-1], path.suffixes[-1].upper())))
    said = " ".join(import_openptv(folder, out=None).project.remarks)
    assert "plane2 (cal/plane2_cam1.tif.CRD)" in said
    assert "cam1.tif.CRD with" not in said


@pytest.mark.acceptance
def test_the_body_named_like_the_position_serves_where_no_fix_is_left(folder):
    for path in folder.rglob("plane1_cam1*.fix"):
        path.unlink()
    said = " ".join(import_openptv(folder, out=None).project.remarks)
    assert "plane1 (cal/plane1_cam1.tif.crd with cal/target_plane1.txt)" in said


def test_damaged_and_lonely_files_are_named_and_nothing_stops(folder):
    for path in (folder / "cal/old").iterdir():
        path.unlink()
    (folder / "cal/plane1_cam1.tif.fix").unlink()
    (folder / "cal/target_plane1.txt").unlink()
    (folder / "cal/plane2_cam1.tif.crd").write_text("0.0 1.0\n")
    rewritten(folder / "cal/plane3_cam1.tif.fix", lambda t: t[:-5] + np.array([100, 0, 0, 0]))
    found = import_openptv(folder, out=None)
    said = " ".join(found.project.remarks)
    assert found.matched[0] == 0
    assert "plane1_cam1.tif.crd was left out: no plane1_cam1.tif.fix says" in said
    assert "plane2_cam1.tif.crd, line 1: found 2 values, expected 3" in said
    assert "of different calibrations" in said


def test_points_that_stand_twice_are_named_and_nothing_stops(folder):
    for path in (folder / "cal/old").iterdir():
        path.unlink()
    rewritten(folder / "cal/plane2_cam1.tif.crd", lambda t: np.vstack([t, t[4:5]]))
    for ending in ("crd", "fix"):
        (folder / f"cal/cam2_plane3.tif.{ending}").write_bytes(
            (folder / f"cal/cam2_plane1.tif.{ending}").read_bytes()
        )
    said = " ".join(import_openptv(folder, out=None).project.remarks)
    assert "plane2_cam1.tif.fix: 1 points stand there more than once, such as that of number 4" in (
        said
    )
    assert "cal/cam2_plane3.tif.crd was left out: it has points of cal/cam2_plane1.tif.crd" in said


@pytest.mark.acceptance
def test_two_planes_that_contradict_each_other_are_both_refused_one_alone_is_said(folder):
    for ending in ("crd", "fix"):
        (folder / f"cal/plane3_cam1.tif.{ending}").unlink()
    for path in (folder / "cal/old").iterdir():
        path.unlink()
    rewritten(folder / "cal/plane2_cam1.tif.fix", lambda t: t + np.array([0, 10.0, 0, 0]))
    found = import_openptv(folder, out=None)
    assert found.matched[0] == 0
    assert "contradict each other: no one camera sees both" in " ".join(found.project.remarks)
    (folder / "cal/plane2_cam1.tif.fix").unlink()
    found = import_openptv(folder, out=None)
    assert found.matched[0] > 60
    assert "cam1: all these points lie in one plane" in " ".join(found.project.remarks)


@pytest.mark.acceptance
def test_targets_that_have_nothing_to_do_with_the_body_are_no_match(folder):
    (folder / "parameters" / "multi_planes.par").unlink()
    for path in [*folder.rglob("*.crd"), *folder.rglob("*.fix")]:
        path.unlink()
    rng = np.random.default_rng(1)
    for k in (1, 2):
        # As many targets as dots, of another body: every dot has some target within 25 px.
        places = rng.uniform((0, 0), (1280, 1024), (400, 2))
        lines = [f"{n} {x:.3f} {y:.3f} 20 5 5 99 -1" for n, (x, y) in enumerate(places)]
        text = f"{len(lines)}\n" + "\n".join(lines) + "\n"
        (folder / f"cal/cam{k}.tif_targets").write_text(text)
    found = import_openptv(folder, out=None)
    assert found.matched == (0, 0)
    assert "no more than by chance; none was taken" in " ".join(found.project.remarks)
