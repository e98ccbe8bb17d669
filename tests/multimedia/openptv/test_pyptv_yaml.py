"""Folders as pyptv writes them: all parameters in one YAML file, targets named by its rule."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from multimedia import (
    Brown,
    FlatInterface,
    InputError,
    ObjectPoints,
    Project,
    project,
    read_experiment,
    write_experiment,
)
from multimedia.openptv.experiment import particle_points
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import LAYERS, SENSOR, cameras, control

CLICKS = [[100.0 * k + 10.0 * j, 200.0 + k + j] for k in range(4) for j in range(4)]


def parameters(count: int = 4) -> dict:
    """Return what pyptv keeps of a run, those sections that say nothing of the geometry short."""
    names = [f"cal/cam{k}.tif" for k in range(1, count + 1)]
    return {
        "num_cams": count,
        "cal_ori": {
            "chfield": 0, "fixp_name": "cal/dots.txt", "img_cal_name": names,
            "img_ori": [f"{name}.ori" for name in names], "pair_flag": False, "tiff_flag": True,
        },
        "criteria": {"X_lay": [-40.0, 40.0], "cnx": 0.02, "corrmin": 33.0},
        "man_ori": {"nr": [1, 10, 20, 30] * count},
        "multi_planes": {"n_planes": 3, "plane_name": [f"img/calib_{c}_cam" for c in "abc"]},
        "ptv": {
            "allcam_flag": False, "chfield": 0, "hp_flag": True, "img_cal": names,
            "img_name": [f"img/cam{k}.10001" for k in range(1, count + 1)],
            "imx": 1280, "imy": 1024, "mmp_d": 10.0, "mmp_n1": 1.0, "mmp_n2": 1.5, "mmp_n3": 1.337,
            "pix_x": 0.012, "pix_y": 0.012, "tiff_flag": True, "splitter": False,
        },
        "sequence": {
            "base_name": [f"img/C{k}_%05d.tif" for k in range(1, count + 1)], "first": 1, "last": 2,
        },
        "man_ori_coordinates": {
            f"camera_{k}": {
                f"point_{j + 1}": dict(zip("xy", CLICKS[4 * k + j], strict=True)) for j in range(4)
            }
            for k in range(count)
        },
    }  # fmt: skip


def rewritten(folder: Path, **sections: dict) -> Path:
    """Write the file of a run, some keys of sections replaced."""
    content = parameters()
    for name, keys in sections.items():
        content[name] = {**content[name], **keys}
    path = folder / "parameters_Run1.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return an experiment whose .par files are gone, with a frame of two particles."""
    half = np.array([SENSOR.width, SENSOR.height]) / 2
    wall = FlatInterface(layers=LAYERS, point=(0, 0, 100), normal=(0, 0, 1))
    shift = np.array([0, 0, 100.0])
    tank = Project(
        cameras=tuple(
            replace(c, centre=c.centre + shift, sensor=replace(SENSOR, origin=half))
            for c in cameras(Brown())
        ),
        media={"wall1": wall}, media_of=("wall1",) * 4, unit="mm",
        object_points=ObjectPoints(ids=tuple(map(str, range(1, 41))), xyz=control(40) + shift),
    )  # fmt: skip
    experiment = tmp_path / "exp"
    write_experiment(experiment, tank)
    shutil.rmtree(experiment / "parameters")
    (experiment / "cal" / "calblock.txt").rename(experiment / "cal" / "dots.txt")
    (experiment / "cal" / "calblock.txt").write_text("".join(f"{k} 0 0 {k}\n" for k in range(9)))
    for name in ("img", "res"):
        (experiment / name).mkdir()
    for k, camera in enumerate(tank.cameras, start=1):
        pixels = camera.sensor.pixel_from_image(
            project(camera, tank.object_points.xyz[:2], tank.media["wall1"])
        )
        lines = [f"{n} {x:.6f} {y:.6f} 9 3 3 99 {n}\n" for n, (x, y) in enumerate(pixels)]
        (experiment / "img" / f"cam{k}.0001_targets").write_text("".join(["2\n", *lines]))
    rows = [
        f"{n + 1} {x:.3f} {y:.3f} {z:.3f} {n} {n} {n} {n}\n"
        for n, (x, y, z) in enumerate(tank.object_points.xyz[:2])
    ]
    (experiment / "res" / "rt_is.1").write_text("".join(["2\n", *rows]))
    rewritten(experiment)
    return experiment


def test_one_yaml_file_says_what_the_par_files_do(folder, tmp_path):
    content = read_experiment(folder)
    tank = content.project
    assert tank.camera_names == ("cam1", "cam2", "cam3", "cam4")
    assert tank.media["wall1"].layers.indices == (1.0, 1.5, 1.337)
    assert tank.media["wall1"].layers.thicknesses == (10.0,)
    assert tank.cameras[0].sensor.pixel_size.tolist() == [0.012, 0.012]
    assert tank.cameras[0].sensor.origin.tolist() == [640, 512]
    np.testing.assert_allclose(tank.object_points.xyz, control(40) + np.array([0, 0, 100]))
    # img/C1_%05d.tif: its targets are cam1.0001_targets.
    assert particle_points(content)[0].ids == ("p1", "p2")
    assert len(particle_points(content)[1].ids) == 8
    assert [ids for ids, _ in content.manual] == [["1", "10", "20", "30"]] * 4
    assert content.manual[2][1].tolist() == CLICKS[8:12]
    # As OpenPTV's own export of the same cameras.
    write_experiment(tmp_path / "legacy", tank)
    legacy = read_experiment(tmp_path / "legacy").project
    for one, two in zip(tank.cameras, legacy.cameras, strict=True):
        np.testing.assert_array_equal(one.centre, two.centre)
        assert one.principal_distance == two.principal_distance


def test_older_files_that_call_the_number_of_cameras_otherwise_are_read(folder):
    text = (folder / "parameters_Run1.yaml").read_text().replace("num_cams", "n_cam")
    (folder / "parameters_Run1.yaml").write_text(text)
    assert len(read_experiment(folder).project.cameras) == 4


def test_cameras_behind_a_beam_splitter_are_named_by_their_orientation(folder):
    rewritten(
        folder,
        cal_ori={"img_cal_name": ["cal/C001H001.tif", "---", "---", "---"]},
        sequence={"base_name": ["img/C001H001S000%d.tif", "--", "--", "--"]},
    )
    content = read_experiment(folder)
    assert content.project.camera_names == ("C001H001", "cam2", "cam3", "cam4")
    assert len(particle_points(content)[1].ids) == 8


def test_of_several_runs_one_is_named(folder):
    second = rewritten(folder, ptv={"mmp_n3": 1.34}).rename(folder / "parameters_Run2.yaml")
    rewritten(folder)
    with pytest.raises(InputError, match=r"several runs; .*parameters_Run1\.yaml.*Run2"):
        read_experiment(folder)
    assert read_experiment(second).project.media["wall1"].layers.indices[2] == 1.34


def test_ptv_par_beside_it_is_read_and_said(folder, tmp_path):
    write_experiment(tmp_path / "legacy", read_experiment(folder).project)
    shutil.copytree(tmp_path / "legacy" / "parameters", folder / "parameters")
    remarks = " ".join(read_experiment(folder).project.remarks)
    assert "ptv.par: was read; parameters_Run1.yaml there may differ" in remarks


def test_the_command_makes_a_project_of_such_a_folder(folder, tmp_path):
    done = CliRunner().invoke(main, ["openptv", str(folder), "--out", str(tmp_path / "tank.toml")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "tank.toml").is_file()
    assert "calib_a" not in done.output  # pyptv lists planes whether there are any or not


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"ptv": {"imx": "wide"}}, r"ptv: imx must be a number"),
        ({"ptv": {"pix_x": 12.0}}, r"ptv: pix_x must be the side of a pixel in mm"),
        (
            {"cal_ori": {"img_cal_name": ["cal/cam1.tif"]}},
            r"img_cal_name must be a list of 4 names",
        ),
        ({"cal_ori": {"img_ori": [f"cal/no{k}.ori" for k in range(4)]}}, r"of camera 1 was not"),
        (
            {"man_ori_coordinates": {"camera_1": {"point_1": {"x": 1}}}},
            r"camera_1: .* 'point_2' is",
        ),
        ({"man_ori": {"nr": None}}, r"man_ori: nr must be a list"),
        ({"multi_planes": {"plane_name": None}}, r"plane_name must be a list"),
        ({"ptv": {"imy": -1}}, r"imy must be the pixels"),
    ],
)
def test_what_is_wrong_is_named_by_section_and_key(folder, sections, message):
    rewritten(folder, **sections)
    with pytest.raises(InputError, match=message):
        read_experiment(folder)


@pytest.mark.parametrize("text", ["a: [1\n", "- 1\n", "", "num_cams: -3\n", "num_cams: .nan\n"])
def test_files_that_are_no_parameters_are_refused(folder, text):
    (folder / "parameters_Run1.yaml").write_text(text)
    with pytest.raises(InputError, match=r"parameters_Run1\.yaml"):
        read_experiment(folder)
