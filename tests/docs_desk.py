"""The files that the pages' commands take for granted: small, valid, of the sample pair or made."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import ezdxf
import numpy as np
import openpyxl
from click.testing import CliRunner
from openpyxl.worksheet.worksheet import Worksheet
from PIL import Image

from bifocal import SAMPLE, WATER_SAMPLE, Pair, PhotoSet, ReliefMap
from tests.bifocal.campaigns import sample_tables
from tests.builders.commands import bifocal_command as main
from tests.builders.foreign_projects import (
    Shot,
    write_alicevision,
    write_colmap_text,
    write_metashape,
    write_opensfm,
)
from tests.scenes import demo_scene
from tests.scenes.arrays import ByteArray
from tests.scenes.make_sample import PIXEL

#: The sample's targets are called P1 to P32 here.
CONTROL = frozenset(f"P{int(name[1:])}" for name in sample_tables.CONTROL)
#: The photos are the sample's at half its size. [px]
SIZE = (768, 512)
#: The sample's far camera: 35 mm from 17.5 m. [mm/px]
PITCH = 2 * PIXEL * 35 / 17.5
HEADINGS = ("id", "X [m]", "Y [m]", "r [m]", "col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]")
#: Parts of both photos that stand for neighbouring pairs of one wall: first and last column.
PARTS = {"left": (0, 460), "middle": (154, 614), "right": (308, 768)}

STREET = """format = "bifocal-survey/1"
name = "street"
out = "results"
products = ["points"]
quality = "fast"

[[pair]]
name = "left"
far = "photos/left_far.jpg"
near = "photos/left_near.jpg"
control = "photos/left_far.csv"
"""


def make_desk(folder: Path) -> None:
    """Write photos, pairs, tables and workbooks of the façade, and what was made of them."""
    rows = _points()
    _pair(folder, "wall", (0, SIZE[0]), ("far.jpg", "near.jpg"))
    _table(folder / "points.csv", [row for row in rows if row[0] in CONTROL])
    _station(folder / "station_pair.csv", [row for row in rows if row[0] in CONTROL])
    _table(folder / "check.csv", [row for row in rows if row[0] not in CONTROL])
    for name, part in PARTS.items():
        _pair(folder, name, part, (f"{name}_far.jpg", f"{name}_near.jpg"))
        _table(folder / f"{name}.csv", _inside(rows, part))
    _set(folder, rows)
    wall = Pair.read(folder / "wall.pair.json")
    three = (wall.image1, wall.image2, replace(wall.image2, name="again"))
    PhotoSet(photos=three).write(folder / "porch.photos.json")
    _workbook(folder, rows)
    _pick_tables(folder, rows)
    _reef(folder)
    shutil.copytree(WATER_SAMPLE, folder / "under-water")
    _lenses(folder)
    _doors(folder)
    shutil.copyfile(folder / "middle_near.jpg", folder / "third.jpg")
    shutil.copyfile(folder / "points.csv", folder / "control.csv")
    for pair, name in (("a", "left"), ("b", "middle"), ("c", "right")):
        shutil.copyfile(folder / f"{name}.pair.json", folder / f"{pair}.pair.json")
        shutil.copyfile(folder / f"{name}.csv", folder / f"{pair}.csv")
    (folder / "photos").mkdir()
    for name in ("left", "right"):
        for side in ("far", "near"):
            shutil.copyfile(folder / f"{name}_{side}.jpg", folder / "photos" / f"{name}_{side}.jpg")
        shutil.copyfile(folder / f"{name}.csv", folder / "photos" / f"{name}_far.csv")
    (folder / "street.toml").write_text(STREET, encoding="utf-8")
    _projects(folder, rows)
    _products(folder)


def _projects(folder: Path, rows: list[list[float | str]]) -> None:
    """Write projects of other programs that hold the pair's photos, and picks in them."""
    shots = []
    for photo in PhotoSet.read(folder / "wall.pair.json").photos:
        inverse = np.linalg.inv(photo.plane_from_pixel)  # square to the wall: scale and middle
        focal = float(photo.distance * inverse[0, 0] / inverse[2, 2])
        middle = inverse[:2] @ [*photo.nadir, 1] / inverse[2, 2]
        place = np.array([*photo.nadir, photo.distance])
        shots.append(
            Shot(photo.file, SIZE, (focal, focal), tuple(middle), (0, 0, 0, 0, 0),
                 np.diag([1.0, -1, -1]), place)
        )  # fmt: skip
    xyz = np.array([row[1:4] for row in rows], dtype=float)
    write_colmap_text(folder / "colmap" / "sparse" / "0", shots, xyz)
    write_opensfm(folder / "reconstruction.json", shots, xyz)
    write_alicevision(folder / "cameras.sfm", shots, xyz)
    write_metashape(folder / "cameras.xml", shots)
    lines = ["id,photo,col [px],row [px]"]
    for name, *_, col1, row1, col2, row2 in [*rows, ["A", *rows[0][1:]], ["B", *rows[-1][1:]]]:
        lines += [f"{name},far.jpg,{col1},{row1}", f"{name},near.jpg,{col2},{row2}"]
    (folder / "picks.csv").write_text("\n".join([*lines, ""]))


def _products(folder: Path) -> None:
    """Write what the commands make of the pair, coarse: result, relief map, orthophotos."""
    pair = folder / "wall.pair.json"
    parts = {
        "left": "-5.2,-3.2,1.2,3.2",
        "middle": "-3.2,-3.2,3.2,3.2",
        "right": "-1.2,-3.2,5.2,3.2",
    }
    whole = f"relief {pair} --quality fast --gsd 0.04"
    lines = [
        f"solve {folder / 'survey.xlsx'} --out {folder / 'result.xlsx'}",
        f"{whole} --out {folder / 'relief.tif'}",
        f"ortho {pair} --relief {folder / 'relief.tif'} --out {folder / 'ortho.tif'}",
        f"relief {folder / 'left.pair.json'} --quality fast --out {folder / 'left_relief.tif'}",
    ]
    for name, bounds in parts.items():
        relief = folder / f"{name}_r.tif"
        lines += [f"{whole} --bounds={bounds} --out {relief}",
                  f"ortho {pair} --relief {relief} --out {folder / f'{name}.tif'}"]  # fmt: skip
    for line in lines:
        done = CliRunner().invoke(main, line.split())
        assert done.exit_code == 0, done.output
    _two_dates(folder)


def _two_dates(folder: Path) -> None:
    """Write the relief map of two dates, and where the wall stood still."""
    relief = ReliefMap.read(folder / "relief.tif")
    for year in (2019, 2024):
        noise = np.random.default_rng(year).normal(0, 0.001, relief.shape)
        replace(relief, r=relief.r + noise).write(folder / f"relief{year}.tif")
    ring = [[-5, -3], [5, -3], [5, 3], [-5, 3], [-5, -3]]
    still = {"type": "Polygon", "coordinates": [ring]}
    (folder / "still.geojson").write_text(json.dumps(still))


def _points() -> list[list[float | str]]:
    """Return every target: name, its place [m], pixels as picked in the halved photos."""
    places = {target.name: target.position for target in demo_scene().targets}
    with (SAMPLE / "targets.csv").open(encoding="utf-8") as file:
        picks = list(csv.reader(file))[1:]
    return [
        [
            f"P{int(name[1:])}",
            *places[name],
            float(relief),
            *(round(float(v) / 2 - 0.25, 3) for v in pixels),
        ]
        for name, *pixels, relief in picks
    ]


def _station(path: Path, rows: list[list[float | str]]) -> None:
    """Write points as a total station has them: E, N, H of a wall in azimuth 37.3 degrees."""
    along = np.array([np.sin(np.deg2rad(37.3)), np.cos(np.deg2rad(37.3))])
    lines = ["Punkt,E,N,H,col1,row1,col2,row2"]
    for name, x, y, r, *pixels in rows:
        east, north = [652345.0, 6862123.0] + x * along + r * along[::-1] * [1, -1]
        lines.append(
            ",".join([name, f"{east:.4f}", f"{north:.4f}", f"{250 + y:.4f}", *map(str, pixels)])
        )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _inside(rows: list[list[float | str]], part: tuple[int, int]) -> list[list[float | str]]:
    """Return the control points well inside a part of the photos, their columns counted there."""
    first, last = part
    moved = []
    for name, x, y, r, col1, row1, col2, row2 in rows:
        if name in CONTROL and all(first + 10 < col < last - 10 for col in (col1, col2)):
            moved.append([name, x, y, r, col1 - first, row1, col2 - first, row2])
    return moved


def _table(path: Path, rows: list[list[float | str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([HEADINGS, *rows])


def _pair(folder: Path, name: str, part: tuple[int, int], files: tuple[str, str]) -> None:
    """Write a part of the sample as photos with EXIF data, and its pair file."""
    pair = Pair.read(SAMPLE / "facade.pair.json")
    first, last = part
    # (column, row) of the halved and cut photo -> of the sample's.
    whole = np.array([[2, 0, 2 * first + 0.5], [0, 2, 0.5], [0, 0, 1.0]])
    sides = []
    for number, (side, photo, focal, file) in enumerate(
        zip(("far", "near"), (pair.image1, pair.image2), (35.0, 19.0), files, strict=True)
    ):
        with Image.open(SAMPLE / f"{side}.jpg") as image:
            small = image.resize(SIZE, Image.Resampling.BOX).crop((first, 0, last, SIZE[1]))
        exif = Image.Exif()
        exif[271], exif[272] = "Canon", "Canon EOS 300D DIGITAL"
        exif.get_ifd(34665).update({
            36867: f"2026:11:22 10:{first // 60:02}:{number:02}", 37386: focal,
            41486: 10 / PITCH, 41488: 3, 42036: "Canon EF-S 18-55mm f/3.5-5.6",
        })  # fmt: skip
        small.save(folder / file, quality=95, exif=exif)
        sides.append(replace(
            photo, file=file, plane_from_pixel=photo.plane_from_pixel @ whole,
            principal_distance=focal, image_size=(last - first, SIZE[1]),
        ))  # fmt: skip
    replace(pair, image1=sides[0], image2=sides[1]).write(folder / f"{name}.pair.json")


def _doors(folder: Path) -> None:
    """Write a door leaf as GeoJSON and as a drawing."""
    corners = [(0, 0), (1.1, 0), (1.1, 2.2), (0, 2.2)]
    ring = {"type": "Polygon", "coordinates": [[*corners, corners[0]]]}
    known = {"kind": "face", "name": "door", "relief": -0.24}
    door = {"type": "Feature", "properties": known, "geometry": ring}
    collection = {"type": "FeatureCollection", "features": [door]}
    (folder / "doors.geojson").write_text(json.dumps(collection), encoding="utf-8")
    drawing = ezdxf.new("R2010", units=6)
    drawing.modelspace().add_lwpolyline(
        corners, close=True, dxfattribs={"layer": "FACE", "elevation": -0.24}
    )
    drawing.saveas(folder / "doors.dxf")


def _set(folder: Path, rows: list[list[float | str]]) -> None:
    """Write the pair with a third photo as a set, and picks in all three."""
    pair = Pair.read(folder / "wall.pair.json")
    mid = replace(pair.image1, name="mid", file="", nadir=pair.image1.nadir + 1.5, distance=14.0)
    named = replace(pair.image1, name="far"), mid, replace(pair.image2, name="near")
    PhotoSet(photos=named).write(folder / "wall.photos.json")
    picks = [[row[0], *row[4:6], *mid.project(np.array(row[1:4], float)), *row[6:]] for row in rows]
    head = ["id", *(f"{axis}{k} [px]" for k in (1, 2, 3) for axis in ("col", "row"))]
    with (folder / "set_picks.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *picks])


def _workbook(folder: Path, rows: list[list[float | str]]) -> None:
    """Fill a survey workbook in as a surveyor does: set-up, picks [px], check, control."""
    path = folder / "survey.xlsx"
    assert CliRunner().invoke(main, ["template", str(path), "--rows", "30"]).exit_code == 0
    middle = ((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2)
    cells = {
        "d_2": 9.5, "delta_d": 8.0, "c_1": 35, "c_2": 19, "pitch": PITCH, "input_unit": "px",
        "nadir_1_col": middle[0], "nadir_1_row": middle[1], "nadir_2_col": middle[0],
        "nadir_2_row": middle[1], "photo_1": "far.jpg", "photo_2": "near.jpg",
    }  # fmt: skip
    book = openpyxl.load_workbook(path)
    for name, value in cells.items():
        sheet, place = (
            book.defined_names[name].attr_text.replace("$", "").replace("'", "").split("!")
        )
        book[sheet][place] = value
    named = [row for row in rows if row[0] in CONTROL]
    _type(book["Points"], [
        {"id": name, **dict(zip(("x1", "y1", "x2", "y2"), pixels, strict=True)),
         "code": "PLANE" if r == 0 else None}
        for name, _, _, r, *pixels in rows
    ])  # fmt: skip
    _type(book["Check"], [{"id": n, "X_ref": x, "Y_ref": y, "Z_ref": r} for n, x, y, r, *_ in rows])
    # The wall runs east, its foot 200 m above the sea.
    _type(book["Georeference"], [
        {"id": n, "E": 5000 + x, "N": 3000 - r, "H": 200 + y} for n, x, y, r, *_ in named
    ])  # fmt: skip
    book.save(path)


def _type(sheet: Worksheet, rows: list[dict[str, object]]) -> None:
    """Type rows below the keys of a sheet's table."""
    keys = next(row for row in sheet.iter_rows() if row[0].value == "id")
    columns = {cell.value: cell.column for cell in keys}
    for number, values in enumerate(rows, start=keys[0].row + 1):
        for key, value in values.items():
            sheet.cell(number, columns[key], value)


def _reef(folder: Path) -> None:
    """Write photos of the sample under water, through flat ports, and its targets as control."""
    for side in ("far", "near"):
        shutil.copyfile(WATER_SAMPLE / f"{side}.jpg", folder / f"reef_{side}.jpg")
    with (WATER_SAMPLE / "targets.csv").open(encoding="utf-8", newline="") as file:
        names, *values = zip(*list(csv.reader(file))[1:], strict=True)
    seen = np.array(values, dtype=np.float64).T
    place = Pair.read(WATER_SAMPLE / "facade.pair.json").intersect(seen[:, :2], seen[:, 2:4]).xyz
    rows = zip(names, place.round(4).tolist(), seen.tolist(), strict=True)
    _table(folder / "reef.csv", [[name, *at[:2], own[4], *own[:4]] for name, at, own in rows])


def _pick_tables(folder: Path, rows: list[list[float | str]]) -> None:
    """Write tables of picks as other programs leave them: lists per photo, odd columns, DXF."""
    for side, first in (("far", 0), ("near", 2)):
        drawing = ezdxf.new("R2010")
        lines = ["id,col,row"]
        for name, _, _, _, *pixels in rows:
            column, row = pixels[first : first + 2]
            lines.append(f"{name},{column},{row}")
            drawing.modelspace().add_point((column, -row))
            drawing.modelspace().add_text(str(name), height=4).set_placement((column + 1, -row))
        (folder / f"{side}.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
        drawing.saveas(folder / f"{side}.dxf")
    shutil.copyfile(folder / "survey.xlsx", folder / "setup.xlsx")
    _empty_points(folder / "setup.xlsx")
    bare = openpyxl.Workbook()
    for name, _, _, _, *pixels in rows:
        # Pixels -> mm from the nadir, y up.
        mm = [sign * (v - (size - 1) / 2) * PITCH
              for v, size, sign in zip(pixels, SIZE * 2, (1, -1) * 2, strict=True)]  # fmt: skip
        bare.active.append([name, *mm])
    bare.save(folder / "noheader.xlsx")
    polar = [("P1", 4.242424, "a", 4.470588, 90.0), ("P2", 4.0, "b", 4.0, 0.0)]
    old = openpyxl.Workbook()
    for line in [("no", "distance far", "remark", "distance near", "theta"), *polar]:
        old.active.append(line)
    old.save(folder / "old.xlsx")
    lines = [f"{n},{s1},{s2},{theta}" for n, s1, _, s2, theta in polar]
    (folder / "distances.csv").write_text("\n".join(["id,s1,s2,theta", *lines, ""]))


def _empty_points(path: Path) -> None:
    """Leave nothing but the set-up in a workbook."""
    book = openpyxl.load_workbook(path)
    for sheet in ("Points", "Check", "Georeference"):
        keys = next(row for row in book[sheet].iter_rows() if row[0].value == "id")
        for row in book[sheet].iter_rows(min_row=keys[0].row + 1):
            for cell in row:
                if not str(cell.value).startswith("="):
                    cell.value = None
    book.save(path)


def _lenses(folder: Path) -> None:
    """Write lens files, photos of boards, a façade of straight edges, points along lines."""
    width, height = SIZE
    for name, focal in (("tele", 35), ("wide", 19), ("lens35", 35)):
        size = focal / PITCH
        lens = {
            "format": "bifocal-lens/1", "model": "opencv", "image_size": [width, height],
            "camera_matrix": [[size, 0, (width - 1) / 2], [0, size, (height - 1) / 2], [0, 0, 1]],
            "coefficients": [0.0, 0, 0, 0, 0],
        }  # fmt: skip
        (folder / f"{name}.json").write_text(json.dumps(lens), encoding="utf-8")
    shutil.copyfile(folder / "far.jpg", folder / "facade.jpg")
    lines = [
        f"{number},{column},{20 + 90 * number + 2e-5 * (column - width / 2) ** 2}"
        for number in range(4) for column in range(10, width, 20)
    ]  # fmt: skip
    (folder / "lines.csv").write_text("\n".join(["line,col [px],row [px]", *lines, ""]))
    squares = np.indices((7, 10)).sum(axis=0) % 2 * 220 + 20
    chess = np.kron(squares, np.ones((60, 60))).astype(np.uint8)
    marks = cv2.aruco.CharucoBoard(
        (8, 11), 1.0, 0.7, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    )
    _board_photos(
        folder, "board", cv2.copyMakeBorder(chess, *[60] * 4, cv2.BORDER_CONSTANT, value=240)
    )
    _board_photos(folder, "charuco", marks.generateImage((640, 880), marginSize=20))


def _board_photos(folder: Path, name: str, board: ByteArray) -> None:
    """Write photos of a board in different directions, taken without distortion."""
    rng = np.random.default_rng(5)
    high, wide = board.shape
    corners = np.array([[0, 0, 0], [wide, 0, 0], [wide, high, 0], [0, high, 0]], float)
    for number in range(4):
        turn, _ = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))
        place = (corners - [wide / 2, high / 2, 0]) @ turn.T + [*rng.uniform(-90, 90, 2), 1500]
        pixels = place[:, :2] / place[:, 2:] * 700 + [319.5, 239.5]
        carry = cv2.getPerspectiveTransform(
            corners[:, :2].astype(np.float32), pixels.astype(np.float32)
        )
        seen = cv2.warpPerspective(board, carry, (640, 480), borderValue=120)
        cv2.imwrite(str(folder / f"{name}{number}.jpg"), cv2.GaussianBlur(seen, (0, 0), 0.8))
