"""Files that are what they say, but hold what cannot be."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.attack.edits import edited, row, swapped
from tests.attack.lines import ALIGN, FACADE, SOLVE, WATER
from tests.attack.options import LIDAR, LINES, SHIFT
from tests.attack.projects import projects

DEEP = "[" * 100_000
BIG = 10**400
NAN, INF = float("nan"), float("inf")
PAIR_LINE = "bifocal solve picks.csv --pair wall.pair.json --json"
SET_LINE = "bifocal solve picks3.csv --pair wall.photos.json --json"
LENS_LINE = "bifocal undistort far.jpg --lens lens.json"
SOLVE_LINE = f"bifocal solve survey.csv {SOLVE} --json"
TANK_LINE = "multimedia project tank.toml --json"
CLOUD_LINE = f"multimedia bathymetry cloud.csv --out o.csv {WATER}"
PLY_LINE = f"multimedia bathymetry cloud.ply --out o.ply {WATER}"

_PAIR: list[tuple[tuple[object, ...], object, str]] = [
    (("format",), "bifocal-pair/9", "format"), (("format",), 5, "format"),
    (("image1",), ..., "image1"), (("image1",), [], "image1"), (("image1",), "far.jpg", "image1"),
    (("image2",), None, "image2"),
    *(
        (("image1", "distance"), value, "distance")
        for value in (
            ..., None, "17.5", True, [], [17.5], {}, 0, -3, NAN, INF, 1e300, 1e30, BIG, 9.5, "abc",
        )
    ),
    *(
        (("image2", "nadir"), value, "nadir")
        for value in (..., 3, "0,0", [0], [0, 0, 0], [0, NAN], [0, "x"], [[0, 0]], [True, False],
                      [0, 1e300])
    ),
    *(
        (("image1", "plane_from_pixel"), value, "plane_from_pixel")
        for value in (..., 3, "I", [], [[1, 0, 0], [0, 1, 0]], [[0] * 3] * 3, [[NAN] * 3] * 3,
                      [[1, 0, 0], [0, 1, 0], [0, 0, "1"]], [[1, 0], [0, 1, 0], [0, 0, 1]],
                      [[1e300, 0, 0], [0, 1e300, 0], [0, 0, 1]])
    ),
    *((("image1", "principal_distance"), value, "principal_distance") for value in
      ("abc", -1, 0, [], True, 1e300)),
    *((("image1", "pixel_size"), value, "pixel_size") for value in ("abc", -1, [], True)),
    *((("image1", "sigma_pixel"), value, "sigma_pixel") for value in
      ("x", -1, 0, [], True, 1e300)),
    *((("layers",), value, "layers|indices|thick") for value in
      (3, [], 0, False, "", {}, {"indices": [1]}, {"indices": [1, "n"], "thicknesses": []},
       {"indices": [1, 1.5, 1.3], "thicknesses": []}, {"indices": [1, -1], "thicknesses": []})),
    (("image1", "lens"), 3, "lens"), (("image1", "lens"), "nowhere.json", "nowhere.json"),
    (("image1", "file"), 3, "file"),
]  # fmt: skip
#: Of a set the same, and what it has more.
_SET: list[tuple[tuple[object, ...], object, str]] = [
    *((("photos", 1, *path[1:]), value, culprit) for path, value, culprit in _PAIR
      if path[0] == "image1" and len(path) > 1 and value != 9.5),
    (("format",), "bifocal-photos/9", "format"), (("photos",), ..., "photos"),
    (("photos",), {}, "photos"), (("photos",), [1, 2, 3], "photos"),
    (("photos", 2), None, "photos"), (("photos", 2, "name"), 3, "name"),
    (("photos", 2, "name"), "image1", "image1"), (("orientation",), {"covariance": []}, "36"),
]  # fmt: skip
_LENS: list[tuple[tuple[object, ...], object, str]] = [
    *(
        (("image_size",), value, "image_size|240 x 160")
        for value in (..., "ab", ["a", "b"], [240], [240.7, 160], [0, 160], [NAN, 160], [BIG, 1],
                      [1e300, 1], {}, None, [True, True], 5)
    ),
    *(
        (("camera_matrix",), value, "camera_matrix|principal distance")
        for value in (..., 3, "x", [], [[0] * 3] * 3, [[NAN] * 3] * 3, {},
                      [[-350, 0, 120], [0, 350, 80], [0, 0, 1]], [[350, 0, 120], [0, 350, 80]],
                      [[350, 0, 120], [0, 350, 80], [0, 0, 0]])
    ),
    *((("coefficients",), value, "coefficients") for value in
      (..., "x", [1], [NAN] * 5, ["a"] * 5, {}, None, [[1, 2], 3], [True] * 5, [1e300] * 5)),
    *((("model",), value, "model") for value in ("brown", 5, {}, [], None)),
    *((("sigma0",), value, "sigma0") for value in ("x", -1, [1, 2], True)),
]  # fmt: skip
_TANK: list[tuple[str, str, str]] = [
    ('format = "multimedia-project/1"', 'format = "multimedia-project/7"', "format"),
    ('format = "multimedia-project/1"', "format = 3", "format"),
    ('unit = "mm"', 'unit = "yard"', "unit"), ('unit = "mm"', "unit = 5", "unit"),
    ('unit = "mm"', 'unit = ', "tank.toml"),
    *(("sigma_image = 0.001", f"sigma_image = {value}", "sigma_image")
      for value in ('"x"', "-1", "nan", "inf", "[]", "true", "0")),
    *(("c = 25.0", f"c = {value}", "c:|cam1")
      for value in ('"x"', "-1", "nan", "inf", "[]", "true", "0", "1e300", "9" * 400)),
    *(("omega = -0", f"omega = {value} # ", "omega|angle|cam1")
      for value in ('"x"', "nan", "inf", "[]", "true", "1e300", "1979-05-27")),
    ("indices = [\n    1.0", 'indices = [\n    "a"', "indices"),
    ("indices = [\n    1.0", "indices = [\n    nan", "ind"),
    ("indices = [\n    1.0", "indices = [\n    -1.0", "ind"),
    ("indices = [\n    1.0", "indices = [\n    [1.0]", "ind"),
    ("indices = [\n    1.0,", "indices = [", "thickness|indices"),
    ("    10.0,", "    -10.0,", "thick"), ("    10.0,", "    nan,", "thick"),
    ("    10.0,", '    "x",', "thick"),
    ("    0.0,\n    0.0,\n    1.0,\n]", "    0.0,\n    0.0,\n    0.0,\n]", "normal"),
    ("normal = [\n    0.0,", "normal = [", "normal"),
    ("    820.0,", "    1e300,", "centre|cam1"), ("    820.0,", "    nan,", "centre|cam1"),
    ("    820.0,", "", "centre"), ("    820.0,", "    [820.0],", "centre"),
    ('media = "tank"', 'media = "glass"', "glass"), ('media = "tank"', "media = 3", "media"),
    ('name = "cam1"', 'name = "cam2"', "cam2"), ('name = "cam1"', "name = 1", "cam1"),

    *(('unit = "mm"', f'unit = "mm"\n{more}', "layers|indices|section") for more in
      ("layers = []", "layers = 3", "indices = [1.0, 1.3]", "thicknesses = []")),
    ("[media.tank]", "[media]", "tank|media"),
    ("[[camera]]", "[camera]", "camera|tank.toml"),
    ("k1 = 2e-05", 'k1 = "x"', "k1"), ("k1 = 2e-05", "k1 = nan", "k1"),
    ("k1 = 2e-05", "k1 = 1e300", "k1|distort"), ("k1 = 2e-05", "k9 = 1.0", "k9"),
    ('convention = "openptv"', 'convention = "other"', "convention"),
    ("width = 1280", "width = -5", "width"), ("width = 1280", "width = 12.5", "width"),
    ("width = 1280", 'width = "x"', "width"), ("width = 1280", f"width = {BIG}", "width"),
    ("    0.012,", "    0.0,", "pitch"), ("    0.012,", "    nan,", "pitch"),
    ('"tank_object_points.csv"', '"nowhere.csv"', "nowhere.csv"),
    ('"tank_object_points.csv"', '"' + 300 * "n" + '.csv"', "nnn"),
    ('"tank_object_points.csv"', "5", "object_points"),
    ('"tank_object_points.csv"', '"a\\u0000b.csv"', "tank.toml|object_points"),
    ('"tank_object_points.csv"', "[]", "object_points"),
    ("[media.tank]", f"x = {DEEP}", "tank.toml"),
    ("[media.tank]", "\x01", "tank.toml"),
]  # fmt: skip


def _cell(value: str) -> Callable[[Path], str]:
    """Return the picks with one y2 exchanged, after the last comma of the file."""
    return lambda folder: (folder / "survey.csv").read_text().rpartition(",")[0] + f",{value}\n"


def _shift_cell(value: str) -> Callable[[Path], str]:
    return lambda folder: (folder / "shift.csv").read_text().rpartition(",")[0] + f",{value}\n"


PLY = "ply\nformat ascii 1.0\nelement vertex 3\n{}end_header\n{}"
XYZ = "property float x\nproperty float y\nproperty float z\n"

RELIEF_SET_LINE = "bifocal relief wall.photos.json --out o.tif"
_RELIEF_SET: list[tuple[tuple[object, ...], Any, str]] = [
    (("photos",), [], "two photos"),
    (("photos", 2, "file"), ..., "file"),
    (("photos", 2, "file"), "gone.jpg", "gone.jpg"),
    (("photos", 2, "image_size"), [640, 480], "640 x 480"),
    (("photos", 1, "name"), "image1", "image1"),
    (("photos", 0, "distance"), -3, "distance"),
    (("format",), "bifocal-photos/9", "format"),
]

#: A line, the file that is exchanged, what it holds then, and what the refusal must name.
CONTENTS: list[tuple[str, str, Any, str]] = [
    *projects(),
    *(
        (PAIR_LINE, "wall.pair.json", edited("wall.pair.json", *path, value=value), culprit)
        for path, value, culprit in _PAIR
    ),
    *(
        (SET_LINE, "wall.photos.json", edited("wall.photos.json", *path, value=value), culprit)
        for path, value, culprit in _SET
    ),
    (SET_LINE, "picks3.csv", row("picks3.csv", "Q,1,2,3,,,"), "Q.*row2"),
    (SET_LINE, "picks3.csv", row("picks3.csv", "Q,1,2,,,,"), "Q.*two photos"),
    (SET_LINE, "picks3.csv", row("picks3.csv", "Q,1,2,3,4,five,6"), "five"),
    (SET_LINE, "picks3.csv", swapped("picks3.csv", "row3 [px]", "rowX"), "row3"),
    *(
        (PAIR_LINE, "wall.pair.json", text, "wall.pair.json")
        for text in (
            "[1]",
            "3",
            "null",
            '"x"',
            "{",
            "{}",
            '{"format": 1e999}',
            '{"a": ' + DEEP,
            "{\x00}",
            '{"a": ' + "9" * 5000 + "}",
            "\ufeff\ufeff{}",
        )
    ),
    *(
        (RELIEF_SET_LINE, file, edited(file, *path, value=value), culprit)
        for file in ("wall.photos.json",)
        for path, value, culprit in _RELIEF_SET
    ),
    *(
        (LENS_LINE, "lens.json", edited("lens.json", *path, value=value), culprit)
        for path, value, culprit in _LENS
    ),
    *(
        (TANK_LINE, "tank.toml", swapped("tank.toml", old, new), culprit)
        for old, new, culprit in _TANK
    ),
    *(
        (SOLVE_LINE, "survey.csv", _cell(value), "survey.csv.*(y2|P11|F13)")
        for value in (
            "abc",
            "12,4 cm",
            "12.4 cm x",
            "nan",
            "inf",
            "1e300",
            "1e400",
            "#REF!",
            "=1+1",
            "--3",
            "1.2.3",
            "0x10",
            "12:30",
            "1 2 3",
            "TRUE",
            "½",
        )
    ),
    (SOLVE_LINE, "survey.csv", row("survey.csv", "P0,1,2,3,4"), "P0"),
    (SOLVE_LINE, "survey.csv", row("survey.csv", "Q,1,,3,4"), "Q|y1"),
    (SOLVE_LINE, "survey.csv", row("survey.csv", 'Q,"1'), "survey.csv"),
    (SOLVE_LINE, "survey.csv", "id,x1 [mm],y1 [mm],x2 [mm],y2 [mm]\n", "survey.csv"),
    (SOLVE_LINE, "survey.csv", "a,b,c\n1,2,3\n", "survey.csv"),
    (SOLVE_LINE, "survey.csv", swapped("survey.csv", "y1 [mm]", "x1 [mm]"), "x1|y1"),
    (SOLVE_LINE, "survey.csv", "\0" * 10, "survey.csv"),
    (SOLVE_LINE, "survey.csv", "id;" * 2_000, "survey.csv"),
    *(
        (f"{SHIFT} --z0 1 --indices 1,1.337", "shift.csv", _shift_cell(value), "shift.csv.*Z|C")
        for value in ("abc", "inf", "1e300", "0.3 km/h", "#DIV/0!")
    ),
    *(
        (TANK_LINE, "tank_object_points.csv", text, "tank_object_points.csv")
        for text in (
            "id,X,Y\n1,2,3\n",
            "id,X,Y,Z\n1,2,3,x\n",
            "id,X,Y,Z\n1,2,3,inf\n",
            "id,X,Y,Z\n1,2,3,4\n1,2,3,5\n",
            "",
        )
    ),
    *(
        (
            "multimedia intersect tank.toml --json",
            "tank_image_points.csv",
            text,
            "tank_image_points.csv",
        )
        for text in (
            "camera,id,col,row\ncam9,1,2,3\n",
            "camera,id,col,row\ncam1,1,2,x\n",
            "camera,id,col,row\ncam1,1,2,inf\n",
            "camera,id,col,row\ncam1,1,1e300,3\n",
            "a,b\n1,2\n",
        )
    ),
    *(
        (CLOUD_LINE, "cloud.csv", text, "cloud.csv")
        for text in (
            "X,Y\n1,2\n",
            "X,Y,Z\n1,2,x\n",
            "X,Y,Z\n",
            "X [mm],Y [mm],Z [mm]\n1,2,3\n",
            "X,Y,Z\n" + "1,2,-9999\n" * 20 + "1,2,-3\n" * 20,
            "X,Y,Z\n1,2,inf\n",
            "X,Y,Z\n1,2,-1e300\n",
            "X,Y,Z\n1,inf,-1\n",
            b"X,Y,Z\n1,2,\xff\xfe\x00\n",
        )
    ),
    *(
        (PLY_LINE, "cloud.ply", text, "cloud.ply")
        for text in (
            "ply\n",
            "ply\nformat\n",
            "ply\nformat ascii 2.0\n",
            PLY.format("", ""),
            PLY.format("property float x\n", "1\n2\n3\n"),
            PLY.format(XYZ, "1 2 3\n"),
            PLY.format(XYZ, "1 2 x\n" * 3),
            PLY.format(XYZ, "1 2 inf\n" * 3),
            PLY.format(XYZ, "1 2 -1e30\n" * 3),
            PLY.format(XYZ, "1 2\n" * 3),
            PLY.format(XYZ, "").replace("vertex 3", "vertex -3"),
            PLY.format(XYZ, "").replace("vertex 3", "vertex 99999999999999999999"),
            PLY.format(XYZ, "").replace("vertex 3", "vertex"),
            PLY.format("property\n", ""),
            PLY.format("property float\n", ""),
            PLY.format("property quaternion x\n", ""),
            PLY.format("property list uchar int x\n", ""),
            PLY.format(XYZ + XYZ, "1 2 3\n" * 3),
            PLY.format(XYZ, "").replace("end_header\n", ""),
            PLY.format(XYZ, "").replace("ascii", "binary_little_endian"),
            PLY.format(XYZ, "").replace("ascii", "binary_middle_endian"),
        )
    ),
    *(
        (
            f"multimedia bathymetry cloud.csv --out o.csv {WATER} --cameras eyes.csv",
            "eyes.csv",
            text,
            "eyes.csv|A|camera",
        )
        for text in (
            "id,X,Y\nA,1,2\n",
            "id,X,Y,Z\nA,1,2,inf\n",
            "id,X,Y,Z\nA,1,2,-50\n",
            "id,X,Y,Z\nA,1,2,1e300\n",
            "id,X,Y,Z\nA,1,2,30\nA,1,2,31\n",
            "id,X,Y,Z\n",
        )
    ),
    *(
        (f"{LIDAR} {WATER} --trajectory flight.csv", "flight.csv", text, "flight.csv|time")
        for text in (
            "time,X,Y,Z\n0,0,0,50\n",
            "time,X,Y,Z\n9,0,0,50\n0,0,0,50\n",
            "time,X,Y,Z\n0,0,0,50\n1,0,0,50\n",
            "time,X,Y,Z\n0,0,0,50\n0,0,0,50\n",
        )
    ),
    *(
        (
            f"multimedia bathymetry rays.csv --rays --out o.csv {WATER}",
            "rays.csv",
            text,
            "rays.csv|ray|A",
        )
        for text in (
            "id,X0,Y0,Z0,DX,DY\nA,0,0,30,0,0\n",
            "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,30,0,0,0\n",
            "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,30,0,0,1\nA,1,0,30,0,0,1\n",
            "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,30,0,0,inf\n",
            "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,-30,0,0,-1\nA,1,0,-30,0,0,-1\n",
        )
    ),
    *(
        (
            "multimedia bathymetry cloud.csv --out o.csv --index 1.34 --water-level water.json",
            "water.json",
            text,
            "water.json|level|slope|normal",
        )
        for text in (
            "{}",
            "[]",
            '{"level": "x", "slope": [0, 0], "centre": [0, 0]}',
            '{"level": NaN, "slope": [0, 0], "centre": [0, 0]}',
            '{"level": 1e300, "slope": [0, 0], "centre": [0, 0]}',
            '{"level": 1, "slope": [0], "centre": [0, 0]}',
            '{"level": 1, "slope": [1e300, 0], "centre": [0, 0]}',
            '{"level": true, "slope": [0, 0], "centre": [0, 0]}',
            '{"level": ' + str(BIG) + ', "slope": [0, 0], "centre": [0, 0]}',
        )
    ),
    *(
        (f"{ALIGN} --control control.csv", "control.csv", text, "control.csv|P0|control|scale")
        for text in (
            "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\nP0,0,0,1,1,1,1\n",
            "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\n"
            + "".join(f"P{k},{k},0,{k},1,{k},1\n" for k in range(5)),
            "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\nP0,inf,0,1,1,1,1\n",
            "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\nP0,0,0,9999,1,1,1\n",
        )
    ),
    (f"{ALIGN} --control control.csv", "control.csv", row("control.csv", "P0,0,0,0,1,1,1,1"), "P0"),
    (LINES, "lines.csv", "line,col [px],row [px]\n1,2,3\n", "lines.csv"),
    (LINES, "lines.csv", "line,col [px],row [px]\n1,2,inf\n", "lines.csv"),
    (
        LINES,
        "lines.csv",
        "line,col [px],row [px]\n" + "1,2,3\n2,2,3\n3,3,3\n" * 4,
        "lines.csv|line",
    ),
    *(
        (
            "bifocal export result.csv --out o" + ending,
            "result.csv",
            lambda folder: (folder / "result.csv").read_text() + "Q,1e300,0,1e300,1e300\n",
            "result.csv|Q",
        )
        for ending in (".dxf", ".ply", ".las", ".csv", ".geojson", ".xlsx")
    ),
    *(
        ("bifocal export result.csv --out o.dxf", "result.csv", text, "result.csv")
        for text in (
            "id,X [m],Y [m],r [m]\n",
            "id,X [m]\nA,1\n",
            "id,X [m],Y [m],r [m]\nA,x,2,3\n",
            "id,X [m],Y [m],r [m]\nA,inf,2,3\n",
        )
    ),
    *(
        ("multimedia openptv ptv --out o.toml", "ptv/" + name, text, "cam1|ptv.par|calblock|ptv")
        for name, text in (
            ("parameters/ptv.par", ""),
            ("parameters/ptv.par", "x\n" * 30),
            ("parameters/ptv.par", "9999999999\n" * 30),
            ("parameters/ptv.par", "nan\n" * 30),
            ("cal/cam1.tif.ori", ""),
            ("cal/cam1.tif.ori", "nan " * 30),
            ("cal/cam1.tif.ori", "x " * 30),
            ("cal/cam1.tif.ori", "0 " * 30),
            ("cal/cam1.tif.ori", "1e300 " * 30),
            ("cal/cam1.tif.addpar", "x"),
            ("cal/cam1.tif.addpar", "nan " * 7),
            ("cal/cam1.tif.addpar", "1"),
            ("cal/cam1.tif.addpar", "1e300 " * 7),
            ("cal/cam1.tif_targets", ""),
            ("cal/cam1.tif_targets", "3\n1 2\n"),
            ("cal/cam1.tif_targets", "-3\n"),
            ("cal/cam1.tif_targets", "x\n"),
            ("cal/cam1.tif_targets", "9" * 5000),
            ("cal/cam1.tif_targets", "1\n0 nan nan 1 1 1 1 0\n"),
            ("cal/calblock.txt", ""),
            ("cal/calblock.txt", "1 2 3\n"),
            ("cal/calblock.txt", "1 x y z\n"),
            ("cal/calblock.txt", "1 nan 0 0\n"),
            ("cal/calblock.txt", "1 1e300 0 0\n2 1 1 1\n"),
        )
    ),
    *(
        ("bifocal undistort far.jpg --lens cameras.txt", "cameras.txt", text, "cameras.txt")
        for text in (
            "1 PINHOLE 240 160 0 0 120 80\n",
            "1 PINHOLE 240 160 x 350 120 80\n",
            "1 PINHOLE 240 160 nan nan 120 80\n",
            "1 PINHOLE 240 160\n",
            "1 SUPERLENS 240 160 1 2 3\n",
            "# only a comment\n",
            "1 OPENCV 240 160 350 350 120 80 inf 0 0 0\n",
        )
    ),
    *(
        ("bifocal undistort far.jpg --lens lens.xml", "lens.xml", text, "lens.xml")
        for text in (
            "<x/>",
            "<calibration>",
            "<calibration><f>0</f></calibration>",
            "not xml",
            '<!DOCTYPE a [<!ENTITY b "c">]><calibration>&b;</calibration>',
            "<calibration><projection>frame</projection><width>240</width><height>160</height>"
            "<f>nan</f></calibration>",
            '<!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
            "]><calibration>&b;</calibration>",
        )
    ),
    *(
        ("bifocal undistort far.jpg --lens lens.yml", "lens.yml", text, "lens.yml")
        for text in (
            "%YAML:1.0\n",
            "%YAML:1.0\n---\ncamera_matrix: 3\n",
            "a: [" * 2000,
            "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
            "   data: [ .Nan, 0., 1., 0., 1., 1., 0., 0., 1. ]\n",
        )
    ),
    *(
        ("bifocal survey street.toml --dry-run", "street.toml", content, "street.toml")
        for content in (
            "distance1 = " + "9" * 5000,
            "a = " + "[" * 100_000,
            swapped("street.toml", '"wall"', '" "'),
            swapped("street.toml", '"wall"', '"w\\u0000"'),
            swapped("street.toml", "[[pair]]", "[pair]"),
        )
    ),
    (
        "bifocal survey street.toml --dry-run", "street.toml",
        swapped("street.toml", '"far.jpg"', '"far\\u0000.jpg"'), "must name its photos",
    ),
    *(
        ("multimedia convert aquacal.json o.toml", "aquacal.json",
         edited("aquacal.json", "cameras", "c", *path, value=value), "camera c|sensor")
        for path, value in (
            (("intrinsics", "K"), [[0, 0, 100], [0, 0, 80], [0, 0, 1]]),
            (("intrinsics", "dist_coeffs"), [0] * 99), (("intrinsics", "image_size"), [2.5, 3]),
            (("extrinsics", "t"), 3), (("extrinsics", "t"), [1, 2]),
        )
    ),
    (
        "multimedia convert lens.yml o.toml", "lens.yml",
        swapped("lens.yml", "-0.05, 0.01, 0., 0., 0. ]\n", "-0.05, 0.0"), "distortion.*damaged",
    ),
    (FACADE + " --check bad.csv", "bad.csv", "a,b\n1,2\n", "bad.csv"),
]  # fmt: skip
