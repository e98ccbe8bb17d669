"""OpenPTV in and out: the real four-camera tank, folders as OpenPTV makes them, damaged files."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    Brown,
    Convention,
    FlatInterface,
    GeometryError,
    ImagePoints,
    InputError,
    ObjectPoints,
    Project,
    intersect,
    intersect_pairs,
    project,
    read_experiment,
    resect,
    write_experiment,
)
from multimedia.openptv.experiment import particle_points
from multimedia.openptv.openptv_files import (
    glass_interface,
    read_camera,
    read_control,
    read_correspondences,
    read_targets,
)
from multimedia.openptv.workflow import import_openptv
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import LAYERS, SENSOR, cameras, control

CALIBRATION = ("c", "xh", "yh", "k1", "p1", "p2", "scale")


@pytest.fixture
def cavity(data_dir: Path) -> Path:
    return data_dir / "openptv_cavity"


# sigma0 in um: as the file has the media (exterior orientation only), and in physical order.
EXTERIOR_AS_FILE = (5.73, 4.58, 8.99, 9.06)
EXTERIOR_PHYSICAL = (6.23, 7.12, 7.95, 4.79)
CALIBRATED_PHYSICAL = (5.67, 3.54, 4.54, 3.54)


@pytest.mark.parametrize("swap", [False, pytest.param(True, marks=pytest.mark.acceptance)])
def test_the_real_tank_is_resected_as_stated(cavity, swap):
    found = import_openptv(cavity, out=None, swap_indices=swap)
    assert found.matched == (43, 43, 71, 71)
    stated = EXTERIOR_PHYSICAL if swap else EXTERIOR_AS_FILE
    project_, images = found.project, found.project.image_points
    for k, camera in enumerate(project_.cameras):
        rows = images.of_camera(camera.name)
        place = project_.object_points.rows([images.ids[row] for row in rows])
        xyz, image = project_.object_points.xyz[place], images.image[rows]
        media = project_.interface_of(k)
        plain = resect(camera, xyz, image, media)
        assert plain.sigma0 * 1000 == pytest.approx(stated[k], rel=0.01)
        if swap:
            # Brown's terms on distorted coordinates, as the stated values were found with.
            brown = replace(
                camera, distortion=replace(camera.distortion, convention=Convention.BROWN)
            )
            full = resect(brown, xyz, image, media, estimate=CALIBRATION)
            assert full.sigma0 * 1000 <= CALIBRATED_PHYSICAL[k]


def test_interchanged_indices_are_said(cavity):
    remarks = " ".join(read_experiment(cavity).project.remarks)
    assert "glass has index 1.33 and water 1.46" in remarks
    assert "interchanged" in remarks
    swapped = read_experiment(cavity, swap_indices=True).project
    assert swapped.media["wall1"].layers.indices == (1.0, 1.46, 1.33)
    assert "interchanged" not in " ".join(swapped.remarks)


@pytest.mark.parametrize(("indices", "column"), [((1, 1.33, 1.46), 11), ((1, 1.46, 1.33), 15)])
def test_real_particles_are_intersected_as_openptv_does(cavity, indices, column):
    with (cavity / "particles_frame10001.csv").open() as file:
        rows = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])
    sensor = read_control(cavity / "ptv.par").sensor
    views, media = [], []
    for k in range(1, 5):
        camera, glass, _ = read_camera(
            cavity / f"particles_cam{k}.tif.ori", sensor=sensor, name=f"cam{k}"
        )
        views.append(camera)
        media.append(glass_interface(glass, indices, 6.0))
    image = np.stack([sensor.image_from_pixel(rows[:, 2 * k : 2 * k + 2]) for k in range(4)])
    xyz, apart = intersect_pairs(views, image, media)
    assert len(xyz) == 373
    # The file holds seven decimals.
    assert np.abs(xyz - rows[:, column : column + 3]).max() < 1e-6
    assert np.abs(apart - rows[:, column + 3]).max() < 1e-6
    stored = np.linalg.norm(xyz - rows[:, 8:11], axis=1)
    if column == 11:
        assert stored.max() < 0.003
        assert np.median(stored) < 0.0006
        # The rigorous points differ: they weigh rays by the image, not pairs alike.
        rigorous = intersect(views, image, media)
        ours = np.sqrt(np.nansum(rigorous.residuals**2))
        theirs = np.stack(
            [i - project(c, xyz, m) for c, i, m in zip(views, image, media, strict=True)]
        )
        assert ours < np.sqrt((theirs**2).sum())


@pytest.fixture
def tank_project() -> Project:
    wall = FlatInterface(layers=LAYERS, point=(0, 0, 0), normal=(0, 0, 1))
    # OpenPTV's glass vector starts at the origin, so the origin must lie in the water.
    shift = np.array([0, 0, 100.0])
    lens = Brown(k1=2e-5, k2=-3e-8, p1=1e-5, p2=-2e-5, shear=0.0004, convention=Convention.OPENPTV)
    half = np.array([SENSOR.width, SENSOR.height]) / 2
    views = tuple(
        replace(c, centre=c.centre + shift, sensor=replace(SENSOR, origin=half))
        for c in cameras(lens)
    )
    wall = replace(wall, point=shift)
    points = control(50) + shift
    image = [project(c, points, wall) for c in views]
    ids = tuple(str(k) for k in range(1, 51))
    return Project(
        cameras=views, media={"wall1": wall}, media_of=("wall1",) * 4, unit="mm",
        object_points=ObjectPoints(ids=ids, xyz=points),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in views for _ in ids), ids=ids * 4,
            image=np.concatenate(image),
        ),
    )  # fmt: skip


def test_export_and_import_give_the_same_cameras_media_and_points(tank_project, tmp_path):
    write_experiment(tmp_path / "exp", tank_project)
    found = import_openptv(tmp_path / "exp", out=None)
    for got, want in zip(found.project.cameras, tank_project.cameras, strict=True):
        assert np.abs(got.centre - want.centre).max() < 1e-12
        assert np.abs(got.rotation - want.rotation).max() < 1e-14
        assert got.distortion == want.distortion
        assert got.principal_point == pytest.approx(want.principal_point, abs=1e-14)
    assert found.matched == (50,) * 4
    assert found.project.object_points.xyz == pytest.approx(tank_project.object_points.xyz)
    assert np.abs(found.project.image_points.image - tank_project.image_points.image).max() < 1e-10


def test_optv_projects_an_exported_camera_to_the_same_place(tank_project, tmp_path):
    pytest.importorskip("optv")
    from optv.calibration import Calibration
    from optv.imgcoord import image_coordinates
    from optv.parameters import ControlParams

    write_experiment(tmp_path / "exp", tank_project)
    for camera in tank_project.cameras:
        calibration = Calibration()
        base = tmp_path / "exp" / "cal" / f"{camera.name}.tif"
        calibration.from_file(f"{base}.ori".encode(), f"{base}.addpar".encode())
        parameters = ControlParams(4)
        media = parameters.get_multimedia_params()
        media.set_layers(np.array([1.5]), np.array([10.0]))
        media.set_n1(1.0)
        media.set_n3(1.337)
        points = np.ascontiguousarray(tank_project.object_points.xyz)
        theirs = image_coordinates(points, calibration, parameters.get_multimedia_params())
        ours = project(camera, points, tank_project.media["wall1"])
        # optv stops its iteration at 1e-3 mm in the water.
        assert np.abs(theirs - ours).max() < 1e-4


def test_a_folder_with_parameters_cal_img_and_res_is_read(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    (folder / "img").mkdir()
    (folder / "res").mkdir()
    rows = ["2"]
    for k, camera in enumerate(tank_project.cameras):
        pixels = camera.sensor.pixel_from_image(
            project(camera, tank_project.object_points.xyz[:2], tank_project.media["wall1"])
        )
        lines = [f"{n} {x:.6f} {y:.6f} 9 3 3 99 {n}" for n, (x, y) in enumerate(pixels)]
        (folder / "img" / f"cam{k + 1}.10001_targets").write_text("2\n" + "\n".join(lines) + "\n")
    for n in range(2):
        x, y, z = tank_project.object_points.xyz[n]
        rows.append(f"{n + 1} {x:.3f} {y:.3f} {z:.3f} {n} {n} {n} {n if n else -1}")
    (folder / "res" / "rt_is.10001").write_text("\n".join(rows) + "\n")
    experiment = read_experiment(folder)
    objects, images = particle_points(experiment)
    assert objects.ids == ("p1", "p2")
    assert len(images.ids) == 7
    image, _ = images.grid(experiment.project.camera_names, images.names)
    found = intersect(experiment.project.cameras, image, experiment.project.interfaces)
    assert np.abs(found.xyz - tank_project.object_points.xyz[:2]).max() < 1e-4


def test_what_openptv_cannot_hold_is_refused_by_name(tank_project, tmp_path):
    views = tank_project.cameras
    scaled = replace(views[0], distortion=Brown(scale=1.01))
    with pytest.raises(InputError, match=r"camera cam1.*scale"):
        write_experiment(tmp_path / "a", replace(tank_project, cameras=(scaled, *views[1:])))
    with pytest.raises(InputError, match=r"cam1.*sensor"):
        write_experiment(
            tmp_path / "b",
            replace(tank_project, cameras=(replace(views[0], sensor=None), *views[1:])),
        )
    assert not (tmp_path / "a").exists() or not list((tmp_path / "a").iterdir())


def rewritten(folder: Path, name: str, old: str, new: str) -> None:
    path = folder / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_angles_in_degrees_are_found_by_the_matrix(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    camera = tank_project.cameras[1]
    radians = " ".join(f"{v:.16g}" for v in camera.angles)
    degrees = " ".join(f"{v:.10f}" for v in np.degrees(camera.angles))
    rewritten(folder, "cal/cam2.tif.ori", radians, degrees)
    found = read_experiment(folder).project
    assert any("angles are in degrees" in remark for remark in found.remarks)
    assert np.abs(found.cameras[1].rotation - camera.rotation).max() < 1e-9


def test_a_folder_of_an_experiment_in_air_has_no_wall(tank_project, tmp_path):
    """ptv.par of three indices 1 and a placeholder for the glass, as synthetic flows have them."""
    write_experiment(tmp_path / "e", tank_project)
    path = tmp_path / "e" / "parameters" / "ptv.par"
    lines = path.read_text().split()
    path.write_text("\n".join([*lines[:-4], "1", "1", "1", lines[-1]]) + "\n")
    inside = read_experiment(tmp_path / "e").project
    assert inside.media == {}
    # A particle on the cameras' side of where the glass would be meets.
    place = np.array([[5.0, -8.0, 40.0]])
    image = np.stack([project(camera, place) for camera in inside.cameras])
    met = intersect(inside.cameras, image, inside.interfaces)
    np.testing.assert_allclose(met.xyz, place, atol=1e-8)


def test_damaged_files_are_named(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    ori = folder / "cal" / "cam3.tif.ori"
    good = ori.read_text()
    ori.write_text(good[:60])
    with pytest.raises(InputError, match=r"cam3\.tif\.ori: .* numbers, expected"):
        read_experiment(folder)
    ori.write_text(good.replace(good.split()[8], "abc"))
    with pytest.raises(InputError, match=r"cam3\.tif\.ori, value 9: expected a number"):
        read_experiment(folder)
    matrix = tank_project.cameras[2].rotation * (1, 1, -1)
    words = good.split()
    words[6:15] = [f"{v:.9f}" for v in matrix.ravel()]
    ori.write_text(" ".join(words))
    with pytest.raises(GeometryError, match="left-handed"):
        read_experiment(folder)
    ori.unlink()
    with pytest.raises(InputError, match=r"cam3\.tif\.ori of camera 3 was not found"):
        read_experiment(folder)
    (folder / "parameters" / "ptv.par").unlink()
    with pytest.raises(InputError, match=r"neither ptv\.par"):
        read_experiment(folder)


def test_a_glass_vector_on_the_wrong_side_is_remarked(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    words = (folder / "cal" / "cam1.tif.ori").read_text().split()
    words[18:21] = ["0", "0", "-100"]
    (folder / "cal" / "cam1.tif.ori").write_text(" ".join(words))
    remarks = read_experiment(folder).project.remarks
    assert any("cam1.tif.ori: the camera stands" in remark for remark in remarks)


def test_target_and_correspondence_files_that_are_cut_off_are_named(tmp_path):
    targets = tmp_path / "cam1_targets"
    targets.write_text("2\n0 1.0 2.0 9 3 3 99 -1\n")
    with pytest.raises(InputError, match="announces 2 targets"):
        read_targets(targets)
    stored = tmp_path / "rt_is.1"
    stored.write_text("2\n1 0.0 0.0 0.0 1 2 3 4\n")
    with pytest.raises(InputError, match="announces 2 particles"):
        read_correspondences(stored)


def test_openptvs_scale_is_a_longer_principal_distance(tmp_path, tank_project):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    base = folder / "cal" / "cam1.tif"
    terms = (2e-5, -3e-8, 0.0, 1e-5, -2e-5, 1.01, 0.0004)
    Path(f"{base}.addpar").write_text(" ".join(repr(v) for v in terms))
    camera, _, _ = read_camera(Path(f"{base}.ori"), sensor=SENSOR, name="cam1")
    plain = tank_project.cameras[0]
    points = tank_project.object_points.xyz
    want = 1.01 * project(plain, points, tank_project.media["wall1"])
    assert np.abs(project(camera, points, tank_project.media["wall1"]) - want).max() < 1e-12


@pytest.mark.acceptance
@pytest.mark.long
def test_points_clicked_by_hand_replace_a_useless_orientation(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    for camera in tank_project.cameras:
        angles = " ".join(f"{v:.16g}" for v in camera.angles)
        path = folder / "cal" / f"{camera.name}.tif.ori"
        words = path.read_text().split()
        turned = replace(camera, rotation=camera.rotation @ np.diag([-1.0, -1.0, 1.0]))
        words[3:6] = [f"{v:.16g}" for v in turned.angles]
        words[6:15] = [f"{v:.12f}" for v in turned.rotation.ravel()]
        path.write_text(" ".join(words))
        assert angles not in path.read_text()
    assert max(import_openptv(folder, out=None).matched) < 25
    rows = [0, 9, 19, 29]
    clicks = [
        tank_project.cameras[k]
        .sensor.pixel_from_image(tank_project.image_points.image[50 * k : 50 * k + 50][rows])
        .round()
        for k in range(4)
    ]
    (folder / "parameters" / "man_ori.par").write_text("\n".join(["1", "10", "20", "30"] * 4))
    np.savetxt(folder / "man_ori.dat", np.concatenate(clicks))
    found = import_openptv(folder, out=None)
    assert found.matched == (50,) * 4
    assert any("clicked by hand" in remark for remark in found.project.remarks)


def test_a_calibration_body_of_any_name_is_found(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    (folder / "cal" / "calblock.txt").rename(folder / "cal" / "dots of 2019.txt")
    (folder / "cal" / "a note.txt").write_text("made on a Monday\n")
    with_body = read_experiment(folder).project
    assert with_body.object_points.xyz == pytest.approx(tank_project.object_points.xyz)
    (folder / "cal" / "dots of 2019.txt").unlink()
    for content, missing in ((with_body, False), (read_experiment(folder).project, True)):
        assert any("no calibration body" in line for line in content.remarks) == missing


def test_the_commands_give_openptvs_particle_positions(cavity, tmp_path):
    folder = tmp_path / "frame"
    folder.mkdir()
    (folder / "ptv.par").write_text((cavity / "ptv.par").read_text())
    for k in range(1, 5):
        for ending in ("ori", "addpar"):
            text = (cavity / f"particles_cam{k}.tif.{ending}").read_text()
            (folder / f"cam{k}.tif.{ending}").write_text(text)
    run = CliRunner().invoke
    made = run(main, ["openptv", str(folder), "--out", str(tmp_path / "frame.toml")])
    assert made.exit_code == 0, made.output
    table = str(cavity / "particles_frame10001.csv")
    words = ["intersect", str(tmp_path / "frame.toml"), "--points", table, "--json"]
    found = json.loads(run(main, [*words, "--method", "pairs"]).stdout)["points"]
    with (cavity / "particles_frame10001.csv").open() as file:
        stored = np.array([[float(r[f"stored_{a}"]) for a in "XYZ"] for r in csv.DictReader(file)])
    miss = np.linalg.norm(np.array([[p[a] for a in "XYZ"] for p in found]) - stored, axis=1)
    assert miss.max() < 0.003
    assert np.median(miss) < 0.0006
    # Rigorously, the rays of this experiment do not meet, and the command says so.
    assert "--method pairs" in run(main, words).stderr


@pytest.mark.parametrize("count", ["9" * 5000, "inf", "nan", "1e300"])
def test_an_impossible_number_of_targets_is_named(tmp_path: Path, count: str) -> None:
    path = tmp_path / "cam1.tif_targets"
    path.write_text(f"{count}\n" + "1 2 3 4 5 6 7 8\n")
    with pytest.raises(InputError, match=r"line 1 \(number of targets\): .* is no finite number"):
        read_targets(path)
    path.write_text("1\n1 2 3 1e300 5 6 7 8\n")
    with pytest.raises(InputError, match="value 4 of the targets: 1e300 is no finite number"):
        read_targets(path)


@pytest.mark.parametrize(
    ("read", "text"),
    [
        (read_targets, "2.5\n" + "1 " * 20),
        (read_correspondences, "1.5\n1 0 0 0 1 2\n"),
        (read_correspondences, "nan\n1 0 0 0 1 2\n"),
        (read_correspondences, ""),
    ],
)
def test_a_first_line_that_counts_nothing_is_named(tmp_path: Path, read, text: str) -> None:
    path = tmp_path / "stored"
    path.write_text(text)
    with pytest.raises(InputError, match="line 1"):
        read(path)


def test_a_stored_frame_without_particles_is_said(tank_project, tmp_path):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    (folder / "res").mkdir()
    (folder / "res" / "rt_is.10001").write_text("0\n")
    experiment = read_experiment(folder)
    assert particle_points(experiment)[0].ids == ()
    assert "rt_is.10001: holds no particles." in experiment.project.remarks


@pytest.mark.parametrize("columns", [3, 5])
def test_particles_have_a_target_number_for_each_camera(tank_project, tmp_path, columns):
    folder = tmp_path / "exp"
    write_experiment(folder, tank_project)
    (folder / "res").mkdir()
    (folder / "img").mkdir()
    (folder / "res" / "rt_is.1").write_text(f"1\n1 0.0 0.0 -9.0{' 0' * columns}\n")
    for k in range(4):
        (folder / "img" / f"cam{k + 1}.1_targets").write_text("1\n0 640 512 9 3 3 99 0\n")
    if columns < 4:
        with pytest.raises(InputError, match=r"rt_is\.1: 3 target columns for 4 cameras"):
            read_experiment(folder)
    else:
        assert len(particle_points(read_experiment(folder))[1].ids) == 4
