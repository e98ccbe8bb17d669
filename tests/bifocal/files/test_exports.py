"""Exports read back by the libraries other programs use."""

from __future__ import annotations

import json
import struct
from dataclasses import replace

import ezdxf
import laspy
import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from bifocal import InputError
from bifocal.files.exports import export_points
from bifocal.files.point_tables import read_survey_points
from bifocal.model.points import Points
from tests.builders.commands import bifocal_command as main

POINTS = Points(
    ids=("001", "=HYPERLINK(1)", "C", "lost"),
    xyz=np.array([[1.0, 2.0, 0.5], [-3.25, 0.0, -0.1], [0.0, 0.0, 0.0], [np.nan] * 3]),
    world=np.array(
        [[500001.0, 4e6, 12.0], [500002.0, 4e6, 10.0], [500003.0, 4e6, 9.0], [np.nan] * 3]
    ),
    sigma_r=np.array([0.01, 0.02, 0.9, np.nan]),
    flags=("OK", "OK", "UNCERTAIN", "NADIR"),
    notes=("", "a,b", "", ""),
)


def test_dxf_points_lie_where_they_should_in_metres(tmp_path):
    remarks = export_points(tmp_path / "p.dxf", POINTS)
    drawing = ezdxf.readfile(tmp_path / "p.dxf")
    assert drawing.dxfversion == "AC1024"
    assert drawing.header["$INSUNITS"] == 6
    found = [tuple(e.dxf.location) for e in drawing.modelspace().query("POINT")]
    np.testing.assert_allclose(found, POINTS.xyz[:3])
    assert [e.dxf.layer for e in drawing.modelspace().query("POINT")][2] == "BIFOCAL_UNCERTAIN"
    texts = [e.dxf.text for e in drawing.modelspace().query("TEXT")]
    assert "001" in texts
    assert "+0.500" in texts
    assert "lost" in remarks[0]


def test_points_that_are_known_in_the_world_alone_have_no_relief_written(tmp_path):
    bare = replace(POINTS, xyz=np.full((4, 3), np.nan))
    export_points(tmp_path / "p.dxf", bare, world=True)
    texts = [e.dxf.text for e in ezdxf.readfile(tmp_path / "p.dxf").modelspace().query("TEXT")]
    assert texts == ["001", "=HYPERLINK(1)", "C"]


def test_csv_orders_are_pnezd_and_penzd(tmp_path):
    export_points(tmp_path / "a.csv", POINTS)
    first, second, *_ = (tmp_path / "a.csv").read_text().splitlines()
    assert first == "001,2.0000,1.0000,0.5000,OK"
    assert second.startswith("'=HYPERLINK(1),")
    assert second.endswith('"OK a,b"')
    export_points(tmp_path / "b.csv", POINTS, order="PENZD", world=True)
    assert (tmp_path / "b.csv").read_text().startswith("001,500001.0000,4000000.0000,12.0000")


def test_italian_excel_gets_semicolons_and_decimal_commas(tmp_path):
    export_points(tmp_path / "a.csv", POINTS, flavour="excel-it")
    assert (tmp_path / "a.csv").read_bytes().startswith("\ufeff001;2,0000;1,0000".encode())


def test_las_and_laz_keep_a_tenth_of_a_millimetre(tmp_path):
    for name in ("p.las", "p.laz"):
        export_points(tmp_path / name, POINTS, world=True)
        cloud = laspy.read(tmp_path / name)
        np.testing.assert_allclose(cloud.xyz, POINTS.world[:3], atol=5e-5)
        np.testing.assert_allclose(cloud["sigma_r"], [0.01, 0.02, 0.9], rtol=1e-6)


def test_ply_is_binary_doubles(tmp_path):
    export_points(tmp_path / "p.ply", POINTS)
    data = (tmp_path / "p.ply").read_bytes()
    start = data.index(b"end_header\n") + len(b"end_header\n")
    assert np.frombuffer(data[start : start + 24], "<f8").tolist() == [1.0, 2.0, 0.5]
    assert b"element vertex 3" in data


def test_ply_says_the_precision_of_each_point_in_metres(tmp_path):
    export_points(tmp_path / "p.ply", POINTS)
    heading, rows = (tmp_path / "p.ply").read_bytes().split(b"end_header\n")
    names = [line.split()[1:] for line in heading.decode().splitlines() if "property" in line]
    assert names == [["double", "x"], ["double", "y"], ["double", "z"], ["float", "sigma_r"],
                     ["uchar", "uncertain"]]  # fmt: skip
    points = list(struct.iter_unpack("<dddfB", rows))
    assert [point[3] for point in points] == pytest.approx([0.01, 0.02, 0.9], rel=1e-6)
    assert [point[4] for point in points] == [0, 0, 1]


def test_dxf_of_the_world_still_writes_the_relief_beside_its_points(tmp_path):
    export_points(tmp_path / "w.dxf", POINTS, world=True)
    drawing = ezdxf.readfile(tmp_path / "w.dxf").modelspace()
    np.testing.assert_allclose([e.dxf.location for e in drawing.query("POINT")], POINTS.world[:3])
    layer = drawing.query('TEXT[layer=="BIFOCAL_RELIEF"]')
    assert [e.dxf.text for e in layer] == ["+0.500", "-0.100", "+0.000"]


def test_geojson_is_valid_json_with_the_relief(tmp_path):
    export_points(tmp_path / "p.geojson", POINTS)
    data = json.loads((tmp_path / "p.geojson").read_text())
    assert data["features"][0]["geometry"]["coordinates"] == [1.0, 2.0, 0.5]
    assert data["features"][2]["properties"]["flag"] == "UNCERTAIN"


def test_a_formula_as_a_name_stays_text_in_the_workbook(tmp_path):
    export_points(tmp_path / "p.xlsx", POINTS)
    sheet = openpyxl.load_workbook(tmp_path / "p.xlsx")["Results"]
    assert (sheet["A3"].value, sheet["A3"].data_type) == ("=HYPERLINK(1)", "s")
    assert sheet["A2"].value == "001"


def test_refusals_name_the_mend(tmp_path):
    with pytest.raises(InputError, match=r"\.dxf"):
        export_points(tmp_path / "p.dwg", POINTS)
    with pytest.raises(InputError, match="PNEZD"):
        export_points(tmp_path / "p.csv", POINTS, order="XYZ")
    (tmp_path / "q.csv").write_text("mine")
    with pytest.raises(InputError, match="overwrite"):
        export_points(tmp_path / "q.csv", POINTS)
    assert (tmp_path / "q.csv").read_text() == "mine"
    bare = Points(ids=("a",), xyz=[[1, 2, 3]], sigma_r=[0.1], flags=("OK",), notes=("",))
    with pytest.raises(InputError, match="Georeference"):
        export_points(tmp_path / "w.csv", bare, world=True)
    assert {p.name for p in tmp_path.iterdir()} == {"q.csv"}


def test_the_command_takes_a_result_table_and_names_what_it_lacks(tmp_path):
    run = CliRunner().invoke
    table = tmp_path / "result.csv"
    table.write_text(
        "Point,X [m],Y [m],Z [m],sigma_r,flag\n001,1.5,2.5,0.25,0.01,OK\nx,,,,,NADIR\n"
    )
    out = tmp_path / "o.geojson"
    done = run(main, ["export", str(table), "--out", str(out)])
    assert done.exit_code == 0, done.stderr
    assert "left out: x" in done.stderr
    data = json.loads(out.read_text())
    assert data["features"][0]["geometry"]["coordinates"] == [1.5, 2.5, 0.25]
    table.write_text("Point,s1\nA,3\n")
    done = run(main, ["export", str(table), "--out", str(tmp_path / "o.dxf")])
    assert done.exit_code == 1
    assert "bifocal solve" in done.stderr
    done = run(main, ["export", str(tmp_path / "none.xlsx"), "--out", str(tmp_path / "o.dxf")])
    assert done.exit_code == 1
    assert "none.xlsx" in done.stderr


def test_a_survey_is_never_exported_onto_itself(tmp_path):
    table = tmp_path / "result.csv"
    table.write_text("Point,X,Y,Z\nA,1,2,3\n")
    done = CliRunner().invoke(main, ["export", str(table), "--out", str(table), "--overwrite"])
    assert done.exit_code == 1
    assert "is one of the files that are read; name another output, e.g. result-result.csv" in (
        done.stderr
    )
    assert table.read_text().startswith("Point")


def test_names_with_control_characters_fit_into_a_workbook(tmp_path):
    nan = np.full(1, np.nan)
    points = Points(
        ids=("A\x01b",), xyz=np.ones((1, 3)), world=None, sigma_r=nan, flags=("OK",), notes=("",)
    )
    export_points(tmp_path / "o.xlsx", points)
    assert openpyxl.load_workbook(tmp_path / "o.xlsx")["Results"]["A2"].value == "Ab"


def test_error_ellipses_have_the_axes_of_the_covariance(tmp_path):
    # By hand: variances 25 and 4 mm2 along the directions 30 and 120 degrees from +Y.
    turn = np.radians(30.0)
    u, v = np.array([np.sin(turn), np.cos(turn)]), np.array([np.cos(turn), -np.sin(turn)])
    matrix = 25e-6 * np.outer(u, u) + 4e-6 * np.outer(v, v)
    points = Points(
        ids=("A",), xyz=np.array([[1.0, 2.0, 0.1]]), sigma_r=np.array([0.02]), flags=("OK",),
        notes=("",), sigma_xy=np.sqrt(np.diagonal(matrix))[None], cov_xy=matrix[:1, 1],
    )  # fmt: skip
    assert points.ellipses()[0] == pytest.approx([0.005, 0.002, 30.0])
    export_points(tmp_path / "p.dxf", points, ellipses=100)
    (drawn,) = ezdxf.readfile(tmp_path / "p.dxf").modelspace().query("ELLIPSE")
    assert drawn.dxf.layer == "BIFOCAL_ELLIPSES_X100"
    assert tuple(drawn.dxf.major_axis)[:2] == pytest.approx(tuple(0.5 * u))
    assert drawn.dxf.ratio == pytest.approx(0.4)
    export_points(tmp_path / "p.geojson", points)
    said = json.loads((tmp_path / "p.geojson").read_text())["features"][0]["properties"]
    assert said["sigma_X"] == pytest.approx(matrix[0, 0] ** 0.5)
    assert (said["ellipse_a"], said["ellipse_b"]) == pytest.approx((0.005, 0.002))
    assert said["ellipse_azimuth"] == pytest.approx(30.0)
    export_points(tmp_path / "none.dxf", points, ellipses=0)
    assert not ezdxf.readfile(tmp_path / "none.dxf").modelspace().query("ELLIPSE")


def test_a_dxf_is_the_same_in_whatever_order_ezdxf_counts_its_classes(tmp_path, monkeypatch):
    database = ezdxf.entitydb.EntityDB
    in_use = database.dxf_types_in_use
    for name, backwards in (("a.dxf", False), ("b.dxf", True)):
        monkeypatch.setattr(
            database, "dxf_types_in_use", lambda self, b=backwards: sorted(in_use(self), reverse=b)
        )
        export_points(tmp_path / name, POINTS)
    assert (tmp_path / "a.dxf").read_bytes() == (tmp_path / "b.dxf").read_bytes()


def test_world_coordinates_of_a_workbook_follow_those_of_the_wall(tmp_path):
    xyz = np.random.default_rng(3).uniform(-5, 5, (6, 3))
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    world = 1.0002 * xyz @ turn.T + [351234.0, 4123456.0, 33.0]
    points = Points(
        ids=tuple("abcdef"), xyz=xyz, world=world, sigma_r=np.full(6, 0.01), flags=("OK",) * 6,
        notes=("",) * 6,
    )  # fmt: skip
    export_points(tmp_path / "p.xlsx", points)
    book = openpyxl.load_workbook(tmp_path / "p.xlsx")
    cells = {row[0].value: row[1].value for row in book["World"].iter_rows()}
    for row, own in enumerate(xyz, start=2):
        text = book["Results"].cell(row, 5).value.lstrip("=").replace("^", "**")
        for letter, value in zip("BCD", own, strict=True):
            text = text.replace(f"{letter}{row}", repr(float(value)))
        placed = eval(text, {name: float(value) for name, value in cells.items()})
        assert placed == pytest.approx(world[row - 2, 0], abs=1e-8)
    again, _ = read_survey_points(tmp_path / "p.xlsx")
    np.testing.assert_allclose(again.world, world, rtol=0, atol=1e-9)
    # Without heights there is nothing to follow: values.
    flat = world * [1, 1, np.nan]
    export_points(tmp_path / "flat.xlsx", replace(points, world=flat))
    assert openpyxl.load_workbook(tmp_path / "flat.xlsx").sheetnames == ["Results"]
