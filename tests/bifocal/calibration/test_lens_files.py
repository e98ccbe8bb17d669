"""Files of lenses: our own, COLMAP's, Metashape's, OpenCV's; broken ones are named."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from bifocal import InputError, Interior, Lens
from bifocal.calibration.workflow import calibrate_from_edges
from tests.bifocal.calibration.known_lens import BROWN, GRID, MATRIX, brown_by_hand


def test_colmap_pixels_are_half_a_pixel_off_ours(tmp_path):
    path = tmp_path / "cameras.txt"
    path.write_text("# list\n1 OPENCV 1024 768 900 905 512 384 -0.2 0.06 0.001 -0.0005\n")
    lens = Lens.read(path)
    np.testing.assert_allclose(lens.camera_matrix, MATRIX)
    np.testing.assert_allclose(lens.coefficients, [-0.2, 0.06, 1e-3, -5e-4])


def test_metashape_exchanges_the_tangential_terms(tmp_path):
    path = tmp_path / "cal.xml"
    path.write_text(
        "<calibration><projection>frame</projection><width>1024</width><height>768</height>"
        "<f>905</f><cx>0</cx><cy>0</cy><b1>-5</b1><k1>-0.2</k1><k2>0.06</k2>"
        "<p1>-0.0005</p1><p2>0.001</p2></calibration>"
    )
    lens = Lens.read(path)
    np.testing.assert_allclose(lens.camera_matrix, MATRIX)
    np.testing.assert_allclose(lens.distort(GRID), brown_by_hand(GRID, BROWN), atol=1e-9)
    text = path.read_text()
    path.write_text(text.replace("<k1>", "<b2>0.1</b2><k1>"))
    with pytest.raises(InputError, match="b2"):
        Lens.read(path)
    path.write_text(text.replace("<k1>", "<k4>0.02</k4><k1>"))
    away = GRID - MATRIX[:2, 2]  # k4 moves by r⁸
    eighth = ((away / np.diag(MATRIX)[:2]) ** 2).sum(axis=-1, keepdims=True) ** 4
    more = brown_by_hand(GRID, BROWN) + 0.02 * eighth * away
    np.testing.assert_allclose(Lens.read(path).distort(GRID), more, atol=0.02)


def test_opencv_yaml_is_read(tmp_path):
    path = tmp_path / "cal.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 1024)
    storage.write("image_height", 768)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.array([[-0.2, 0.06, 1e-3, -5e-4, 0.0]]))
    storage.release()
    lens = Lens.read(path)
    np.testing.assert_allclose(lens.camera_matrix, MATRIX)
    assert lens.image_size == (1024, 768)


def test_our_own_file_keeps_everything(tmp_path):
    BROWN.write(tmp_path / "l.json")
    data = json.loads((tmp_path / "l.json").read_text())
    data["mine"] = "kept"
    (tmp_path / "l.json").write_text(json.dumps(data))
    lens = Lens.read(tmp_path / "l.json")
    assert lens.to_dict()["mine"] == "kept"
    np.testing.assert_array_equal(lens.camera_matrix, MATRIX)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{}", "camera_matrix"),
        ('{"camera_matrix": [[1]], "coefficients": [], "image_size": [9,9]}', "shape"),
        (
            '{"camera_matrix": [[1,0,0],[0,1,0],[0,0,1]], "coefficients": [1],"image_size": [9,9]}',
            "coefficients",
        ),
        (
            '{"camera_matrix": [[1,0,0],[0,1,0],[0,0,1]], "coefficients": [], "image_size": [1, 1],'
            ' "model": "magic"}',
            "magic",
        ),
    ],
)
def test_a_broken_lens_file_is_named(tmp_path, content, message):
    (tmp_path / "bad.json").write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        Lens.read(tmp_path / "bad.json")
    assert "bad.json" in str(caught.value)


GOOD = {"camera_matrix": MATRIX.tolist(), "coefficients": [0, 0, 0, 0], "image_size": [1024, 768]}


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("image_size", "ab", "image_size: expected numbers"),
        ("image_size", ["a", "b"], "image_size: expected numbers"),
        ("image_size", ["3000", "2000"], "image_size: expected numbers"),
        ("image_size", [384.7, 256], "whole pixels"),
        ("image_size", [np.inf, 256], "whole pixels"),
        ("image_size", [1e30, 256], "whole pixels"),
        ("image_size", [10**400, 256], "image_size: holds a whole number above"),
        ("image_size", 5, "whole pixels"),
        ("image_size", {"a": 1}, "image_size: expected numbers"),
        ("image_size", None, "whole pixels"),
        ("coefficients", [[1], [2, 3]], "coefficients: expected numbers"),
        ("camera_matrix", [[0, 0, 5], [0, 0, 5], [0, 0, 1]], "fx and fy above zero"),
        ("camera_matrix", [[900, 0, 5], [0, 900, 5], [0, 0, 0]], "fx and fy above zero"),
        ("camera_matrix", [[-900, 0, 5], [0, 900, 5], [0, 0, 1]], "fx and fy above zero"),
        ("model", {}, "is not one of"),
        ("sigma0", "x", "sigma0: expected numbers"),
        ("sigma0", [0.5], "sigma0: expected one number"),
        ("sigma0", True, "sigma0: expected one number"),
        ("sigma0", np.nan, "sigma0: must be zero or more"),
    ],
)
def test_text_lists_and_huge_numbers_in_a_lens_file_are_named(tmp_path, key, value, message):
    path = tmp_path / "lens.json"
    path.write_text(json.dumps(GOOD | {key: value}))
    with pytest.raises(InputError, match=message) as caught:
        Lens.read(path)
    assert str(caught.value).startswith(f"{path}: ")


METASHAPE = "<calibration><projection>frame</projection><width>9</width><height>9</height>{}"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("cameras.txt", "1 SIMPLE_PINHOLE 3000 2000 0 1500 1000", "focal lengths"),
        ("cameras.txt", "1 PINHOLE 3000 2000 900 0 1500 1000", "focal lengths"),
        ("cameras.txt", "1 PINHOLE nan 2000 900 900 1500 1000", "image_size"),
        ("cameras.txt", "1 PINHOLE 384.7 2000 900 900 1500 1000", "whole pixels"),
        ("cameras.txt", "1 PINHOLE 3000 2000 900 900 nan 1000", "camera_matrix"),
        ("m.xml", METASHAPE.format("<f>9</f><b1>-9</b1></calibration>"), "above zero"),
        ("m.xml", METASHAPE.format("<f>9</f><cx>nan</cx></calibration>"), "camera_matrix"),
        ("m.xml", '<!DOCTYPE a [<!ENTITY b "3">]>' + METASHAPE.format("<f>&b;"), "DOCTYPE"),
    ],
)
def test_impossible_calibrations_of_other_programs_are_named(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        Lens.read(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_lens_file_whose_precision_is_no_number_is_named():
    for wrong, said in (("two", "expected a number"), (2.0, "must be a share"), (0, "must be a")):
        lens = replace(BROWN, extra={"sigma_focal": wrong})
        with pytest.raises(InputError, match=rf"lens\.json: sigma_focal: {said}"):
            Interior.from_lens(lens, source="lens.json")


def test_straight_lines_of_a_resized_photo_have_the_lens_of_its_size(tmp_path):
    """A 35 mm lens on a sensor 22.7 mm wide, 3072 px; the photo was saved at a third of it."""
    exif = Image.Exif()
    exif.get_ifd(34665).update(
        {37386: 35.0, 41486: 3072 / 22.7, 41488: 4, 40962: 3072, 40963: 2304}
    )
    Image.new("RGB", (1024, 768), (120, 110, 100)).save(tmp_path / "wall.jpg", exif=exif)
    along = np.linspace(20, 1000, 30)
    rows = [f"L{k},{x:.3f},{at:.3f}" for k, at in enumerate((60, 300, 500, 700)) for x in along]
    (tmp_path / "lines.csv").write_text("\n".join(["line,col [px],row [px]", *rows]))
    out = tmp_path / "lens.json"
    calibrate_from_edges([tmp_path / "wall.jpg"], out, lines=tmp_path / "lines.csv")
    assert Lens.read(out).camera_matrix[0, 0] == pytest.approx(35 / 22.7 * 1024, rel=1e-3)
    assert Lens.read(out).extra["sigma_focal"] == 0.02
