"""Folders of MyPTV, proPTV and OpenLPT as these programs write them; their formulas written out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import Camera, FlatInterface, InputError, Layers, Sensor, convert, project
from tests.builders.commands import multimedia_command as main

SIZE, PITCH = (1280, 1024), 0.012
CENTRE, ANGLES, F = np.array([60.0, 30.0, 505.0]), (0.02, 3.19, 3.12), 6000.0
OFFSET = np.array([12.0, -20.0])
POINTS = np.random.default_rng(4).uniform((0, 0, -40), (70, 70, 0), (40, 3)).round(2)
TERMS = np.zeros((3, 5))


def axes(angles) -> np.ndarray:
    """Return Rx Ry Rz as MyPTV has them: the camera's axes in the world are its rows."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return about_x @ about_y @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])


def seen(points: np.ndarray) -> np.ndarray:
    """Return column and row that MyPTV's camera without polynomial sees."""
    inside = (points - CENTRE) @ axes(ANGLES).T
    return F * inside[:, :2] / inside[:, 2:] + np.array(SIZE) / 2 + OFFSET


def tsai(folder: Path, terms: np.ndarray = TERMS, name: str = "cam1") -> None:
    """Write a camera as MyPTV saves it."""
    rows = [SIZE, CENTRE, ANGLES, (F,), OFFSET, *terms]
    lines = ["Tsai model camera", name, *("".join(f"{v} " for v in row) for row in rows)]
    (folder / name).write_text("\n".join(lines) + "\n")


def listed(path: Path, pixels: np.ndarray, head: str = "", comma: str = "\t") -> None:
    """Write control points: column, row, X, Y, Z."""
    path.parent.mkdir(exist_ok=True)
    table = np.column_stack([pixels, POINTS])
    np.savetxt(path, table, fmt="%.4f", delimiter=comma, header=head, comments="# ")


def read(folder: Path):
    return convert(folder, folder / "out.toml", unit="mm", pixel_size=PITCH, overwrite=True)


def pixels_of(camera: Camera, points: np.ndarray, media=None) -> np.ndarray:
    return camera.sensor.pixel_from_image(project(camera, points, media))


def test_myptvs_camera_and_its_points_are_read(tmp_path):
    tsai(tmp_path)
    listed(tmp_path / "Calibration" / "cam1_cal_points", seen(POINTS))
    done = read(tmp_path)
    camera, points = done.project.cameras[0], done.project.object_points
    assert (done.source, camera.name, done.project.unit) == ("particle tracker", "cam1", "mm")
    np.testing.assert_allclose(camera.centre, CENTRE, atol=1e-9)
    np.testing.assert_allclose(pixels_of(camera, POINTS), seen(POINTS), atol=1e-8)
    np.testing.assert_allclose(points.xyz, POINTS)
    measured = camera.sensor.pixel_from_image(done.project.image_points.image)
    np.testing.assert_allclose(measured, seen(POINTS), atol=1e-4)


def test_myptvs_polynomial_becomes_a_lens_and_its_misfit_is_said(tmp_path):
    """A pixel u, v of MyPTV looks along (u' + e, v' + e, f) @ R."""
    terms = np.array([[1e-3, 3e-4, -5e-6, 3e-6, 4e-6], [1e-3, -5e-6, 4e-6, 1e-6, -6e-6], [0] * 5])
    tsai(tmp_path, terms)
    done = read(tmp_path)
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1279, 7), np.linspace(0, 1023, 7)))
    away = np.array(SIZE) / 2 + OFFSET
    bent = np.column_stack([u, v, u * u, v * v, u * v]) @ terms.T
    rays = np.column_stack([u - away[0], v - away[1], np.full(u.shape, F)]) + bent
    places = CENTRE + 0.08 * rays @ axes(ANGLES)
    miss = np.linalg.norm(pixels_of(done.project.cameras[0], places) - np.stack([u, v], 1), axis=1)
    assert miss.max() < 2.5
    assert np.linalg.norm(bent, axis=1).max() > 10
    assert f"at most {miss.max():.2g} px" in done.remarks[0]


def test_lists_of_points_alone_make_cameras_to_start_with(tmp_path):
    """As proPTV has them, and MyPTV's polynomials of lab space, which are no cameras."""
    (tmp_path / "cam0").write_text("extendedZolof model camera\ncam0\nO 0 \t 1.0 \n")
    for number, turn in ((0, 0.0), (1, 0.02)):
        shifted = seen(POINTS) + np.array([700 * turn, 0])
        listed(tmp_path / f"markers_c{number}.txt", shifted, "x,y,X,Y,Z", " ")
    done = read(tmp_path)
    assert done.project.camera_names == ("cam0", "cam1")
    assert len(done.project.object_points.ids) == 40
    assert len(done.project.image_points.ids) == 80
    for camera, pixels in zip(done.project.cameras, (0, 14), strict=True):
        rest = pixels_of(camera, POINTS) - (seen(POINTS) + np.array([pixels, 0]))
        assert np.sqrt((rest**2).sum(axis=1).mean()) < 5
        assert np.linalg.norm(camera.centre - CENTRE) < 150
    assert "made from the points of markers_c0.txt, in air" in done.remarks[0]


ROTATION = cv2.Rodrigues(np.array([np.pi - 0.1, 0.05, 0.02]))[0]
CAMERA = np.array([30.0, -20.0, 400.0])
MATRIX = np.array([[3000.0, 0, 630], [0, 3010, 500], [0, 0, 1]])
LENS = np.array([-0.05, 0.02, 1e-4, -2e-4, 0.0])


def openlpt(path: Path, rotation, matrix, lens, plate: str = "", model: str = "PINHOLE") -> None:
    """Write a camera as OpenLPT saves it."""
    path.parent.mkdir(exist_ok=True)

    def rows(values) -> str:
        return "".join(",".join(f"{v:.17g}" for v in row) + "\n" for row in np.atleast_2d(values))

    shift = -rotation @ CAMERA
    path.write_text(
        f"# Camera Model: (PINHOLE/POLYNOMIAL)\n{model}\n# Camera Calibration Error: \nNone\n"
        "# Pose Calibration Error: \nNone\n# Image Size: (n_row,n_col)\n1024,1280\n"
        f"# Camera Matrix: \n{rows(matrix)}# Distortion Coefficients: \n{rows(lens)}"
        f"# Rotation Vector: \n{rows(cv2.Rodrigues(rotation)[0].T)}"
        f"# Rotation Matrix: \n{rows(rotation)}# Inverse of Rotation Matrix: \n{rows(rotation.T)}"
        f"# Translation Vector: \n{rows(shift)}# Inverse of Translation Vector: \n{rows(CAMERA)}"
        + plate
    )


def test_openlpts_cameras_are_opencvs(tmp_path):
    openlpt(tmp_path / "cam1.txt", ROTATION, MATRIX, LENS)
    # The same camera, its y upwards and looking along -z.
    turned = np.diag([-1.0, 1.0, -1.0]) @ ROTATION
    openlpt(tmp_path / "cam2.txt", turned, MATRIX * [[1], [-1], [1]] * 1.0 + 0.0, LENS)
    text = (tmp_path / "cam2.txt").read_text().replace("-500", "500")
    (tmp_path / "cam2.txt").write_text(text.replace(",0.0001,", ",-0.0001,"))
    wanted = cv2.projectPoints(POINTS, ROTATION, -ROTATION @ CAMERA, MATRIX, LENS)[0][:, 0]
    for camera in read(tmp_path).project.cameras:
        np.testing.assert_allclose(pixels_of(camera, POINTS), wanted, atol=1e-7)


@pytest.mark.parametrize("wording", ["older", "newer"])
def test_openlpts_plate_is_glass_with_the_object_behind_it(tmp_path, wording):
    titles = {
        "older": ("Reference Point of Refractive Plate: ", "Normal Vector of Refractive Plate: ",
                  "Refractive Index Array: ", "Width of the Refractive Plate: (mm)"),
        "newer": ("Plane Point (Farthest Interface)", "Plane Normal (camera->object direction)",
                  "Indices (obj->win->air)", "Widths (plate thicknesses in mm)"),
    }[wording]  # fmt: skip
    values = ("0,0,60", "0,0,-1", "1.33,1.49,1", "12.7")
    plate = "".join(f"# {t}\n{v}\n" for t, v in zip(titles, values, strict=True))
    for number in (1, 2):
        openlpt(tmp_path / f"cam{number}.txt", ROTATION, MATRIX, LENS, plate, "PINPLATE")
    found = read(tmp_path).project
    assert found.media_of == ("w1", "w1")
    glass = Layers(indices=(1.0, 1.49, 1.33), thicknesses=(12.7,))
    wall = FlatInterface(layers=glass, point=(0, 0, 60), normal=(0, 0, 1))
    camera = replace(found.cameras[0], sensor=Sensor(width=1280, height=1024, pixel_size=PITCH))
    got = project(camera, POINTS, found.media["w1"])
    np.testing.assert_allclose(got, project(camera, POINTS, wall), atol=1e-12)
    assert np.abs(got - project(camera, POINTS)).max() > 0.01


def test_the_command_reads_such_a_folder(tmp_path):
    tsai(tmp_path)
    done = CliRunner().invoke(main, ["convert", str(tmp_path), str(tmp_path / "a.toml")])
    assert done.exit_code == 0, done.output
    assert "cam1" in (tmp_path / "a.toml").read_text()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("markers_c0.txt", "1 2 3 4\n", r"line 1: 4 values, expected column, row"),
        ("markers_c0.txt", "1 2 3 4 5\n", r"holds 1 control points"),
        ("markers_c0.txt", "1 2 3 4 5\n" * 9, r"more than once"),
        ("markers_c0.txt", "".join(f"{k} {k * k} {k} {k * k} 0\n" for k in range(9)), "one plane"),
        ("cam1", "Tsai model camera\ncam1\n1280 1024\n", r"2 numbers after the name, expected 26"),
        ("cam1", "extendedZolof model camera\ncam1\n", r"is a polynomial \(Zolof\)"),
        ("c.txt", "# Camera Model: (PINHOLE)\nPOLYNOMIAL\n", r"its model is 'POLYNOMIAL'"),
        ("c.txt", "# Camera Model: (PINHOLE)\nPINHOLE\n", r"0 numbers below .* 'image size'"),
    ],
)
def test_what_is_wrong_in_such_files_is_named(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read(tmp_path)
    assert not (tmp_path / "out.toml").exists()


def test_mirrored_points_and_cameras_of_one_number_are_refused(tmp_path):
    listed(tmp_path / "markers_c0.txt", seen(POINTS) * [-1, 1] + [1280, 0])
    with pytest.raises(InputError, match=r"no camera sees these points so"):
        read(tmp_path)
    tsai(tmp_path)
    tsai(tmp_path, name="copy_1")
    with pytest.raises(InputError, match=r"another camera of number 1"):
        read(tmp_path)
