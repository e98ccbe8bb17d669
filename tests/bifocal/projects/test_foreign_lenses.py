"""Lens terms that OpenCV lacks, names that a project has twice, scenes of a Meshroom cache."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from scipy.optimize import fsolve

from bifocal import InputError, Lens
from photocore.programs.model import ForeignView
from photocore.programs.photos import PhotoFinder
from photocore.programs.projects import read_foreign_project
from tests.builders import foreign_projects as made

SIZE = (6000, 4000)


def calibrated(folder: Path, kind: str = "frame", **terms: float) -> Path:
    """Write one camera of Metashape at the origin, its axes the world's."""
    shot = made.Shot(
        "one.png", SIZE, (4000, 4000), (2999.5, 1999.5), (0,) * 5, np.eye(3), np.zeros(3)
    )
    path = made.write_metashape(folder / "cameras.xml", [shot])
    tree = ElementTree.parse(path)
    sensor = tree.getroot().find(".//sensor")
    sensor.set("type", kind)
    inside = sensor.find("calibration")
    for key, value in terms.items():
        for node in inside.findall(key):
            inside.remove(node)
        ElementTree.SubElement(inside, key).text = repr(value)
    tree.write(path)
    return path


def seen_by_metashape(xyz: np.ndarray, kind: str, **terms: float) -> np.ndarray:
    """Return pixels by the formulas of its manual, appendix C; from the corner of the image."""
    f = terms.get("f", 4000.0)
    cx, b1, b2, k1, k2, k3, k4, p1, p2 = (
        terms.get(key, 0.0) for key in ("cx", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2")
    )
    x, y = xyz[:, 0] / xyz[:, 2], xyz[:, 1] / xyz[:, 2]
    if kind != "frame":
        r0 = np.hypot(x, y)
        theta = np.arctan(r0)
        scale = (theta if kind == "equidistant_fisheye" else 2 * np.sin(theta / 2)) / r0
        x, y = x * scale, y * scale
    r = np.hypot(x, y)
    q = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6 + k4 * r**8
    xs = x * q + p1 * (r**2 + 2 * x**2) + 2 * p2 * x * y
    ys = y * q + p2 * (r**2 + 2 * y**2) + 2 * p1 * x * y
    return np.column_stack([3000 + cx + xs * f + xs * b1 + ys * b2, 2000 + ys * f]) - 0.5


def projected(view: ForeignView, xyz: np.ndarray) -> np.ndarray:
    rays = (xyz - view.centre) @ view.rotation.T @ view.camera.matrix.T
    return Lens(**view.lens._asdict()).distort(rays[:, :2] / rays[:, 2:])


@pytest.mark.parametrize(
    ("kind", "terms", "most"),
    [
        ("frame", {"b1": -3.0, "b2": 0.8, "k1": -0.03, "k2": 0.01, "cx": 12.0}, 0.02),
        ("frame", {"k1": -0.1, "k2": 0.05, "k3": -0.02, "k4": 0.01}, 0.002),
        ("frame", {"b2": 1e-4, "k4": 1e-7}, 1e-3),
        ("equidistant_fisheye", {"f": 2500.0, "k1": 0.01, "b1": 2.0}, 1e-9),
        ("equisolid_fisheye", {"f": 2500.0, "k1": 0.01, "k2": -0.003}, 0.002),
    ],
)
def test_metashape_terms_that_opencv_lacks_are_read_by_their_effect(
    tmp_path: Path, kind: str, terms: dict[str, float], most: float
) -> None:
    path = calibrated(tmp_path, kind, **terms)
    read = read_foreign_project(path, PhotoFinder(path))
    across = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 12), np.linspace(-0.46, 0.46, 12)), -1)
    xyz = np.column_stack([across.reshape(-1, 2), np.ones(144)])
    away = projected(read.views[0], xyz) - seen_by_metashape(xyz, kind, **terms)
    assert np.abs(away).max() < most
    assert not [text for text in read.remarks if "fitted" in text]


def test_what_a_fit_leaves_is_said_and_what_it_cannot_reach_refused(tmp_path: Path) -> None:
    path = calibrated(tmp_path, k1=-0.1, k2=0.03, b2=3.0, p1=1e-3, p2=2e-3)
    (said,) = [
        text for text in read_foreign_project(path, PhotoFinder(path)).remarks if "fitted" in text
    ]
    assert "leave up to 0.1" in said
    path = calibrated(tmp_path, "equidistant_fisheye", f=1000.0, p1=4e-3)
    with pytest.raises(InputError, match="no lens model of OpenCV's comes nearer"):
        read_foreign_project(path, PhotoFinder(path))


def test_visualsfm_corrects_what_was_measured(tmp_path: Path) -> None:
    Image.new("L", (300, 200)).save(tmp_path / "a b.jpg")
    path = tmp_path / "m.nvm"
    path.write_text('NVM_V3\n\n1\na"b.jpg 280 1 0 0 0 0 0 0 -0.15 0\n\n0\n')
    (view,) = read_foreign_project(path, PhotoFinder(path)).views
    assert view.name == "a b.jpg"
    for x, y in ((0.3, 0.2), (-0.45, 0.1)):
        # Its formula read backwards: (1 - 0.15 m²) m = ideal, m the measurement in units of f.
        m = fsolve(lambda m, x=x, y=y: m * (1 - 0.15 * (m @ m)) - [x, y], [x, y], xtol=1e-14)
        found = projected(view, np.array([[x, y, 1.0]]))[0]
        np.testing.assert_allclose(found, 280 * m + [149.5, 99.5], atol=1e-4)


@pytest.mark.parametrize("centre", ["153 98", "3 -2"])  # from the corner, from the middle
def test_visualsfm_keeps_a_calibration_fixed(tmp_path: Path, centre: str) -> None:
    Image.new("L", (300, 200)).save(tmp_path / "a.jpg")
    path, (cx, cy) = tmp_path / "m.nvm", centre.split()
    path.write_text(f"NVM_V3 FixedK 280 {cx} 281 {cy} 0\n\n1\na.jpg 280 1 0 0 0 0 0 0 0 0\n\n0\n")
    (view,) = read_foreign_project(path, PhotoFinder(path)).views
    found = projected(view, np.array([[0.3, -0.2, 1.0]]))[0]
    # The middle is at 150, 100 from the corner of the first pixel, whose own middle is at 0.5.
    np.testing.assert_allclose(found, [0.3 * 280 + 152.5, -0.2 * 281 + 97.5], atol=1e-9)
    path.write_text(path.read_text().replace("FixedK 280", "FixedK wide"))
    with pytest.raises(InputError, match="FixedK"):
        read_foreign_project(path, PhotoFinder(path))
    path.write_text("NVM_V3_R9T\n0\n")
    with pytest.raises(InputError, match="expected NVM_V3, or NVM_V3 FixedK"):
        read_foreign_project(path, PhotoFinder(path))


def test_a_radial_fourth_term_of_realitycapture_is_fitted(tmp_path: Path) -> None:
    Image.new("L", SIZE).save(tmp_path / "one.jpg")
    path = tmp_path / "cameras.csv"
    head = "#name,x,y,alt,heading,pitch,roll,f,k1,k4,t2"
    path.write_text(f"{head}\none.jpg,0,0,0,0,0,0,24,-.05,.01,1e-3\n")
    (view,) = read_foreign_project(path, PhotoFinder(path)).views
    x, y = 0.5, -0.3  # looks down: the camera's z is the world's -z, y with it
    r = x * x + y * y
    bent = np.array([x, y]) * (1 - 0.05 * r + 0.01 * r**4) + 1e-3 * np.array(
        [r + 2 * x * x, 2 * x * y]
    )
    found = projected(view, np.array([[x, -y, -1.0]]))[0]
    np.testing.assert_allclose(found, 4000 * bent + [2999.5, 1999.5], atol=0.002)
    path.write_text("#name,x,y,z\none.jpg,0,0,0\n")
    with pytest.raises(InputError, match="lacks alt, heading"):
        read_foreign_project(path, PhotoFinder(path))
    Image.new("L", SIZE).save(tmp_path / "two.jpg")
    rows = "one.jpg,9.182312,45.46,130,0,0,0,24,0,0,0\ntwo.jpg,9.182401,45.46,131,0,0,0,24,0,0,0"
    path.write_text(f"{head}\n{rows}\n")
    with pytest.raises(InputError, match="are longitudes and latitudes"):
        read_foreign_project(path, PhotoFinder(path))


def test_labels_alike_are_told_apart_by_their_groups_or_both_named(tmp_path: Path) -> None:
    shots = made.make_shots()[:2]
    shots = [shot._replace(file="DSC.png") for shot in shots]
    path = made.write_metashape(tmp_path / "cameras.xml", shots)
    with pytest.raises(InputError, match="cameras 0, 1 are both called DSC"):
        read_foreign_project(path, PhotoFinder(path))
    tree = ElementTree.parse(path)
    cameras = tree.getroot().find(".//cameras")
    for label, camera in zip(("card1", "card2"), cameras.findall("camera")[:2], strict=True):
        cameras.remove(camera)
        ElementTree.SubElement(cameras, "group", label=label).append(camera)
        (tmp_path / label).mkdir()
        Image.new("L", (300, 200)).save(tmp_path / label / "DSC.JPG")
    tree.write(path)
    names = [view.name for view in read_foreign_project(path, PhotoFinder(path)).views]
    assert names == ["card1/DSC", "card2/DSC"]
    assert [PhotoFinder(path).find(name) for name in names] == [
        tmp_path / f"{n}.JPG" for n in names
    ]


def test_a_meshroom_folder_gives_its_newest_scene_with_most_photos(tmp_path: Path) -> None:
    shots, xyz = made.make_shots(), made.to_world(made.wall_points(10))
    cache = tmp_path / "MeshroomCache"
    nodes = {
        "ConvertSfMFormat/c3": shots, "StructureFromMotion/b2": shots,
        "StructureFromMotion/a1": shots[:2],
    }  # fmt: skip
    for age, (node, some) in enumerate(nodes.items()):
        (cache / node).mkdir(parents=True)
        path = made.write_alicevision(cache / node / "sfm.sfm", some, xyz)
        os.utime(path, (1e9 - age, 1e9 - age))
    (cache / "CameraInit" / "d4").mkdir(parents=True)
    empty = '{"version": ["1","2","6"], "views": []}'
    (cache / "CameraInit" / "d4" / "cameraInit.sfm").write_text(empty)
    (tmp_path / "wall.mg").write_text("{}")
    for place in (tmp_path, cache, tmp_path / "wall.mg"):
        read = read_foreign_project(place, PhotoFinder(place))
        assert len(read.views) == len(shots)
        assert "the part ConvertSfMFormat/c3 (4 photos) is taken" in read.remarks[0]
    assert len(read_foreign_project(cache, PhotoFinder(cache), "StructureFromMotion/a1").views) == 2
