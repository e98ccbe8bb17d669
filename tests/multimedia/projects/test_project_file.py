"""The project file and its tables: round trips and messages."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    Cylinder,
    FlatInterface,
    GeometryError,
    ImagePoints,
    InputError,
    Interfaces,
    ObjectPoints,
    Plane,
    Project,
    Sphere,
    read_project,
    write_project,
)
from multimedia.projects.point_tables import (
    read_image_points,
    read_object_points,
    write_columns,
)
from tests.multimedia.tank import LAYERS, cameras, control, images
from tests.rounding import EPS

PLAIN = """
format = "multimedia-project/1"
unit = "mm"
object_points = "body.csv"
image_points = "seen.csv"

[media.tank]
indices = [1.0, 1.5, 1.337]
thicknesses = [10.0]

[[camera]]
name = "left"
media = "tank"
centre = [-100.0, 0.0, 500.0]
omega = 0.0
phi = -12.5
kappa = 0.0
c = 25.0
[camera.distortion]
convention = "opencv"
k1 = -0.1
[camera.sensor]
width = 1280
height = 1024
pitch = 0.012

[[camera]]
name = "right"
media = "tank"
centre = [100.0, 0.0, 500.0]
omega = 0.0
phi = 12.5
kappa = 0.0
c = 25.0
[camera.sensor]
width = 1280
height = 1024
pitch = [0.012, 0.012]
"""
BODY = "id;X [mm];Y [mm];Z [mm]\nA;1,5;2;-50\nB;0;0;-60\n"
SEEN = "camera,id,col [px],row [px]\nleft,A,600,500\nright,A,650.5,500\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "tank.toml").write_text(PLAIN)
    (tmp_path / "body.csv").write_text(BODY)
    (tmp_path / "seen.csv").write_text(SEEN)
    return tmp_path


def changed(folder, old, new, file="tank.toml"):
    path = folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return folder / "tank.toml"


def test_a_file_written_by_hand_is_read(folder):
    project = read_project(folder / "tank.toml")
    left = project.cameras[0]
    assert left.angles == pytest.approx((0, np.radians(-12.5), 0))
    assert left.distortion.k1 == pytest.approx(-0.1 / 625)
    assert project.object_points.xyz.tolist() == [[1.5, 2, -50], [0, 0, -60]]
    # column 600 is 39.5 pixels left of the centre (639.5) of 0.012 mm
    assert project.image_points.image[0] == pytest.approx([-0.474, 0.138])
    assert project.sigma_image == pytest.approx(0.006)


def full_project() -> Project:
    views, points = cameras(), control(12)
    ids = tuple(f"P{k}" for k in range(12))
    dome = Interfaces(
        surfaces=(
            Sphere(centre=(0, 0, 1), radius=80.0),
            Cylinder(point=(0, 0, 0), axis=(0, 1, 0), radius=200.0),
            Plane(point=(0, 0, 0), normal=(0, 0.1, 1)),
        ),
        indices=(1.0, 1.5, 1.4, 1.337),
        with_camera=(True, False, False),
    )
    port = FlatInterface(
        layers=LAYERS, point=(0, 0, -60), normal=(0.1, 0, 1), moves_with_camera=True
    )
    return Project(
        cameras=tuple(views), unit="mm", name="tank", sigma_image=0.002,
        media={"tank": FlatInterface(layers=LAYERS), "dome": dome, "port": port},
        media_of=("tank", "dome", "port", ""),
        object_points=ObjectPoints(ids=ids, xyz=points, sigma=np.full((12, 3), 0.01)),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in views for _ in ids), ids=ids * 4,
            image=images(views, points).reshape(-1, 2), groups=("frame 1",) * 48,
            sigma=np.full((48, 2), (0.003, 0.004)),
        ),
        extra={"plates": {"count": 3}},
    )  # fmt: skip


def test_what_is_written_is_read_back(tmp_path):
    want = full_project()
    files = write_project(tmp_path / "tank.toml", want)
    assert [file.name for file in files] == [
        "tank.toml", "tank_object_points.csv", "tank_image_points.csv",
    ]  # fmt: skip
    got = read_project(tmp_path / "tank.toml")
    for one, other in zip(got.cameras, want.cameras, strict=True):
        assert np.abs(one.centre - other.centre).max() == 0
        assert np.abs(one.rotation - other.rotation).max() < 8 * EPS
        assert one.distortion == other.distortion
        assert one.sensor.origin.tolist() == other.sensor.origin.tolist()
    assert got.media_of == want.media_of
    assert got.media["tank"].layers == LAYERS
    assert got.media["port"].moves_with_camera
    dome = got.media["dome"]
    assert dome.with_camera == (True, False, False)
    assert dome.surfaces[0].radius == 80.0
    assert got.object_points.xyz.tolist() == want.object_points.xyz.tolist()
    assert got.object_points.sigma.tolist() == want.object_points.sigma.tolist()
    assert np.abs(got.image_points.image - want.image_points.image).max() < 1e-12
    assert np.abs(got.image_points.sigma - want.image_points.sigma).max() < EPS
    assert got.image_points.groups == want.image_points.groups
    assert got.extra == {"plates": {"count": 3}}
    assert got.sigma_image == want.sigma_image


def test_existing_files_are_kept_unless_told(tmp_path):
    write_project(tmp_path / "tank.toml", full_project())
    before = (tmp_path / "tank_image_points.csv").read_bytes()
    with pytest.raises(InputError, match="exists already"):
        write_project(tmp_path / "tank.toml", full_project())
    assert (tmp_path / "tank_image_points.csv").read_bytes() == before
    write_project(tmp_path / "tank.toml", full_project(), overwrite=True)


def test_a_camera_without_sensor_writes_millimetres(tmp_path):
    want = full_project()
    bare = replace(want, cameras=tuple(replace(camera, sensor=None) for camera in want.cameras))
    write_project(tmp_path / "tank.toml", bare)
    assert "x [mm]" in (tmp_path / "tank_image_points.csv").read_text()
    got = read_project(tmp_path / "tank.toml")
    assert got.image_points.image.tolist() == want.image_points.image.tolist()


def test_units_in_headings_are_converted(folder):
    (folder / "body.csv").write_text("point,X [m],Y [m],Z [m]\nA,0.0015,0.002,-0.05\n")
    points, _ = read_object_points(folder / "body.csv", unit="mm")
    assert points.xyz[0] == pytest.approx([1.5, 2, -50])


@pytest.mark.parametrize(
    ("heading", "cells", "sigma"),
    [
        ("x [mm],y [mm],sigma_x", "1,2,0.003", (0.003, 0.003)),
        ("x [mm],y [mm],sigma_x [um],sigma_y [um]", "1,2,3,4", (0.003, 0.004)),
        ("x [um],y [um],sigma_x,sigma_y", "1000,2000,3,4", (0.003, 0.004)),
        ("x [mm],y [mm],sigma_x [px]", "1,2,0.5", (0.006, 0.006)),
        ("col,row,sigma_x,sigma_y", "600,500,0.5,0.25", (0.006, 0.003)),
        ("col,row,sigma_x [mm],sigma_y [um]", "600,500,0.003,4", (0.003, 0.004)),
    ],
)
def test_sigmas_of_image_points_are_in_the_unit_of_their_heading(tmp_path, heading, cells, sigma):
    path = tmp_path / "image.csv"
    path.write_text(f"camera,id,{heading}\ncam1,7,{cells}\n")
    points, _ = read_image_points(path, cameras())
    np.testing.assert_allclose(points.sigma, [sigma], rtol=4 * EPS)


def test_impossible_sigmas_are_named_by_their_cell(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("camera,id,x,y,sigma_x,sigma_y\ncam1,7,1,2,0.003,0\n")
    with pytest.raises(InputError, match=r"F2 \(sigma_y\): .* above zero"):
        read_image_points(path, cameras())
    path.write_text("id,X,Y,Z,sigma_Z\n7,1,2,3,-1\n")
    with pytest.raises(InputError, match=r"E2 \(sigma_Z\): .* negative"):
        read_object_points(path, unit="m")


def test_wide_tables_of_particles_are_read(folder):
    (folder / "wide.csv").write_text(
        "left_col,left_row,right_col,right_row\n600,500,650.5,500\n,,651,501\n"
    )
    project = read_project(folder / "tank.toml")
    points, _ = read_image_points(folder / "wide.csv", project.cameras)
    assert points.cameras == ("left", "right", "right")
    assert points.ids == ("1", "1", "2")
    assert points.image[0] == pytest.approx([-0.474, 0.138])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('format = "multimedia-project/1"', "", "format must be"),
        ('unit = "mm"', 'unit = "feet"', "'feet' is no unit"),
        ("c = 25.0", "c = -25.0", "principal_distance: must be above zero"),
        ("c = 25.0", "c = 2083.0", "Is c in pixels"),
        ("c = 25.0", "focal = 25.0", "unknown key 'focal'"),
        ("phi = -12.5", "phi = 'a'", "phi must be a number"),
        ("phi = -12.5", "phi = -1250.0", "in degrees"),
        ("phi = -12.5\n", "", "the key 'phi' is missing"),
        ('media = "tank"', 'media = "sea"', "its media 'sea' are not described"),
        ("centre = [-100.0, 0.0, 500.0]", "centre = [1.0, 2.0]", "centre must be 3 numbers"),
        ('name = "right"', 'name = "left"', "cameras: left occurs more than once"),
        ("pitch = 0.012", "pitch = 12.0", "0.002 to 0.03 mm"),
        ('convention = "opencv"', 'convention = "ptgui"', "'ptgui' is not known"),
        ("indices = [1.0, 1.5, 1.337]", "indices = [1.0, 0.5, 1.337]", "media.tank.*0.5"),
        ("thicknesses = [10.0]", "thicknesses = [10.0, 2.0]", "media.tank: thicknesses"),
        ("[media.tank]", "[media.tank", "not valid TOML"),
    ],
)
def test_every_bad_entry_is_named_with_file_and_place(folder, old, new, message):
    path = changed(folder, old, new)
    with pytest.raises((InputError, GeometryError), match=f"(?s)tank.toml.*{message}"):
        read_project(path)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("body.csv", "B;", "A;", '"A" stands in'),
        ("body.csv", "2;-50", ";-50", "is blank"),
        ("body.csv", "2;-50", "two;-50", "two"),
        ("seen.csv", "right,A", "left,A", "A in left occurs more than once"),
        ("seen.csv", "right,A", "middle,A", "no camera is called 'middle'"),
        ("seen.csv", "right,A", "rihgt,A", "no camera is called 'rihgt' (did you mean right?)"),
        ("seen.csv", "650.5", "", "is blank; leave the row out"),
    ],
)
def test_every_bad_cell_is_named(folder, file, old, new, message):
    path = changed(folder, old, new, file)
    with pytest.raises(InputError, match=re.escape(message)):
        read_project(path)


def test_a_camera_may_be_written_with_capitals(folder):
    before = read_project(folder / "tank.toml")
    changed(folder, "right,A", "RIGHT,A", "seen.csv")
    after = read_project(folder / "tank.toml")
    assert after.image_points.cameras == before.image_points.cameras
    assert after.camera_index("Right") == before.camera_index("right")


def test_interchanged_indices_are_remarked(folder):
    changed(folder, "[1.0, 1.5, 1.337]", "[1.0, 1.33, 1.46]")
    assert any("media.tank" in r for r in read_project(folder / "tank.toml").remarks)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such project file"):
        read_project(tmp_path / "none.toml")
    with pytest.raises(InputError, match="multimedia openptv"):
        read_project(tmp_path)


def test_both_tables_may_be_sheets_of_one_workbook(folder):
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    sheet.title = "ImagePoints"
    sheet.append(["Measured on a Monday"])
    for line in SEEN.splitlines():
        sheet.append([float(v) if v[0].isdigit() else v for v in line.split(",")])
    other = book.create_sheet("ObjectPoints")
    for line in BODY.replace(",", ".").splitlines():
        other.append([v if v[0].isalpha() else float(v) for v in line.split(";")])
    book.save(folder / "points.xlsx")
    changed(folder, '"body.csv"', '"points.xlsx"')
    changed(folder, '"seen.csv"', '"points.xlsx"')
    project = read_project(folder / "tank.toml")
    assert project.object_points.xyz.tolist() == [[1.5, 2, -50], [0, 0, -60]]
    assert project.image_points.image[0] == pytest.approx([-0.474, 0.138])


NAMES = ("+5", "@a", "=b", "-c", "'d", "007", "7", "=SUM(A1)")


@pytest.mark.parametrize("ending", ["xlsx", "csv"])
def test_names_come_back_from_a_table_as_they_were(tmp_path, ending):
    path = tmp_path / f"points.{ending}"
    measured = np.arange(float(len(NAMES)))
    columns = {"id": NAMES, **{f"{axis} [mm]": measured for axis in "XYZ"}}
    write_columns(path, columns, overwrite=False)
    assert read_object_points(path, unit="mm")[0].ids == NAMES


HUGE = "1" + "0" * 400


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("", "note = " + "9" * 5000 + "\n", "holds a whole number of thousands of digits"),
        ("", "note = " + "[" * 5000 + "]" * 5000 + "\n", "nested too deeply for a project file"),
        ('unit = "mm"', f'unit = "mm"\nsigma_image = {HUGE}', "sigma_image must be a number"),
        ("[1.0, 1.5, 1.337]", f"[1.0, 1.5, {HUGE}]", "indices: holds a whole number above"),
        ("[10.0]", f"[{HUGE}]", "thicknesses: holds a whole number above"),
        ("[[camera]]", f"[[camera]]\ncentre = [0, 0, {HUGE}]", "must be"),
        ("[[camera]]", '[[camera]]\ndistortion = { convention = ["brown"] }', "is not known"),
    ],
    ids=["digits", "depth", "sigma", "index", "thickness", "centre", "convention"],
)
def test_numbers_and_nesting_beyond_reason_are_refused(tmp_path, old, new, message):
    (path := tmp_path / "tank.toml").write_text(
        'format = "multimedia-project/1"\nunit = "mm"\n[media.tank]\nindices = [1.0, 1.5, 1.337]\n'
        "thicknesses = [10.0]\n[[camera]]\nomega = 0\nphi = 0\nkappa = 0\nc = 8.0\n"
        + ("" if "centre" in new else "centre = [0, 0, 500]\n"),
        encoding="utf-8",
    )
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(old, new) if old else new + text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as told:
        read_project(path)
    assert str(told.value).startswith(f"{path}: ")


@pytest.mark.parametrize("sigma", [np.ones(2), np.zeros((1, 2)), [[0.001, -0.001]]])
def test_a_precision_of_image_points_has_their_shape_and_is_positive(sigma) -> None:
    row = {"cameras": ("A",), "ids": ("1",), "image": [[0.0, 0.0]]}
    assert ImagePoints(**row, sigma=[[np.nan, 0.001]]).sigma.shape == (1, 2)
    with pytest.raises(InputError, match=r"expected shape \(1, 2\) and positive"):
        ImagePoints(**row, sigma=sigma)


def test_rows_of_object_points_are_found_by_name_and_those_that_are_none_are_told() -> None:
    points = ObjectPoints(ids=("a", "b", "c"), xyz=np.eye(3))
    assert points.rows(["c", "x", "a"]) == [2, -1, 0]
    assert ObjectPoints().rows(["a"]) == [-1]
