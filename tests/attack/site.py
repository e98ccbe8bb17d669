"""A folder with one small, valid file of every kind that the commands take."""

from __future__ import annotations

import json
import shutil
import zipfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import laspy
import numpy as np
import rasterio
from click.testing import CliRunner
from PIL import Image

from multimedia import (
    Brown,
    Convention,
    FlatInterface,
    ImagePoints,
    ObjectPoints,
    Project,
    project,
    write_experiment,
    write_project,
)
from tests.builders.commands import bifocal_command, multimedia_command
from tests.builders.foreign_projects import (
    make_shots,
    render,
    to_world,
    wall_points,
    write_alicevision,
    write_bundler,
    write_colmap_binary,
    write_colmap_text,
    write_metashape,
    write_nerf,
    write_openmvg,
    write_opensfm,
    write_reality_table,
    write_reality_xmp,
    write_visualsfm,
)
from tests.multimedia.tank import LAYERS, SENSOR, cameras, control

PROGRAMS = {"bifocal": bifocal_command, "multimedia": multimedia_command}

#: Columns, rows and metres per pixel of the photos and rasters.
WIDTH, HEIGHT, GSD = 240, 160, 0.048

YAML = """%YAML:1.0
---
image_width: 240
image_height: 160
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 350., 0., 120., 0., 350., 80., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.05, 0.01, 0., 0., 0. ]
"""
XML = """<?xml version="1.0" encoding="UTF-8"?>
<calibration><projection>frame</projection><width>240</width><height>160</height><f>350</f>
<cx>0</cx><cy>0</cy><k1>-0.05</k1><k2>0.01</k2></calibration>
"""
#: A survey file, and a calibration of AquaCal.
STREET = """[[pair]]
name = "wall"
far = "far.jpg"
near = "near.jpg"
distance1 = 17.5
distance2 = 9.5
focal1 = 35
focal2 = 19
sensor_width = 22.7
"""
AQUACAL = {
    "cameras": {"c": {
        "intrinsics": {
            "K": [[300, 0, 100], [0, 300, 80], [0, 0, 1]], "dist_coeffs": [0] * 5,
            "image_size": [200, 160],
        },
        "extrinsics": {"R": np.eye(3).tolist(), "t": [0, 0, 0]}, "water_z": 1.0,
    }},
    "interface": {"normal": [0, 0, -1], "n_air": 1, "n_water": 1.33},
}  # fmt: skip
ODS = """<?xml version="1.0" encoding="UTF-8"?>
<office:document-content xmlns:office="o" xmlns:table="t" xmlns:text="x">
<office:body><office:spreadsheet><table:table table:name="Points">{rows}</table:table>
</office:spreadsheet></office:body></office:document-content>"""


#: A scene in Meshroom's cache of a project.
MESHROOM = "MeshroomCache/StructureFromMotion/a1/cameras.sfm"


def make_site(folder: Path) -> None:
    """Write the files; `solve` makes those that only it can write."""
    rng = np.random.default_rng(13)
    _photos_and_pair(folder, rng)
    _point_tables(folder, rng)
    _rasters_and_clouds(folder, rng)
    _tank(folder)
    _projects(folder)
    for name in ("survey.xlsx", "result.csv"):
        words = ["solve", str(folder / "survey.csv"), *GEOMETRY, "--out", str(folder / name)]
        result = CliRunner().invoke(PROGRAMS["bifocal"], words)
        assert result.exit_code == 0, result.output


#: Options of `solve` that describe the pair of the tables.
GEOMETRY = ("--d1", "17.5", "--d2", "9.5", "--c1", "35", "--c2", "19")


def _photos_and_pair(folder: Path, rng: np.random.Generator) -> None:
    # A flat wall looks the same in both photos of a bifocal pair.
    spots = Image.fromarray(rng.integers(0, 255, (HEIGHT // 4, WIDTH // 4, 3), dtype=np.uint8))
    wall = np.asarray(spots.resize((WIDTH, HEIGHT), Image.Resampling.BICUBIC), dtype=float)
    for name in ("far.jpg", "near.jpg"):
        seen = np.clip(wall + rng.normal(0, 6, wall.shape), 0, 255).astype(np.uint8)
        Image.fromarray(seen).save(folder / name, quality=90)
    x, y = GSD * (WIDTH - 1) / 2, GSD * (HEIGHT - 1) / 2
    homography = [[GSD, 0, -x], [0, -GSD, y], [0, 0, 1]]
    photo = {"plane_from_pixel": homography, "nadir": [0, 0]}
    pair = {
        "format": "bifocal-pair/1",
        "image1": {"file": "far.jpg", **photo, "distance": 17.5, "principal_distance": 35},
        "image2": {"file": "near.jpg", **photo, "distance": 9.5, "principal_distance": 19},
    }
    three = [dict(pair[key], name=key) for key in ("image1", "image2")]
    three.append({**three[1], "name": "beside", "distance": 10.0, "nadir": [0.1, 0]})
    photos = {"format": "bifocal-photos/1", "photos": three}
    lens = {
        "format": "bifocal-lens/1", "model": "opencv", "image_size": [WIDTH, HEIGHT],
        "camera_matrix": [[350, 0, 120], [0, 350, 80], [0, 0, 1]],
        "coefficients": [-0.05, 0.01, 0, 0, 0],
    }  # fmt: skip
    (folder / "cameras.txt").write_text("1 OPENCV 240 160 350 350 120 80 -0.05 0.01 0 0\n")
    (folder / "lens.yml").write_text(YAML)
    (folder / "street.toml").write_text(STREET)
    (folder / "aquacal.json").write_text(json.dumps(AQUACAL))
    (folder / "lens.xml").write_text(XML)
    files = {"wall.pair.json": pair, "wall.photos.json": photos, "lens.json": lens}
    for name, content in files.items():
        (folder / name).write_text(json.dumps(content, indent=1), encoding="utf-8")


def _point_tables(folder: Path, rng: np.random.Generator) -> None:
    """Write picks in mm and px, control, lines, lengths; r = d1 d2 (s2 - s1) / (...) by Eq. (5)."""
    xy, relief = rng.uniform((-4, -3), (4, 3), (12, 2)), rng.uniform(-0.5, 0.5, (12, 1))
    mm1, mm2 = (c * xy / (d - relief) for c, d in ((35, 17.5), (19, 9.5)))
    px1, px2 = (
        (d / c * mm * (1, -1)) / GSD + ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
        for mm, c, d in ((mm1, 35, 17.5), (mm2, 19, 9.5))
    )
    ids = [f"P{k}" for k in range(12)]
    _csv(folder / "survey.csv", "id,x1 [mm],y1 [mm],x2 [mm],y2 [mm]", ids, mm1, mm2)
    px = "col1 [px],row1 [px],col2 [px],row2 [px]"
    _csv(folder / "picks.csv", f"id,{px}", ids, px1, px2)
    centre = np.array([WIDTH - 1, HEIGHT - 1]) / 2
    px3 = ((0.1, 0) + (xy - (0.1, 0)) * 10 / (10 - relief)) * (1, -1) / GSD + centre
    _csv(folder / "picks3.csv", f"id,{px},col3 [px],row3 [px]", ids, px1, px2, px3)
    _csv(folder / "control.csv", f"id,X [m],Y [m],r [m],{px}", ids, xy, relief, px1, px2)
    _csv(folder / "lengths.csv", "from,to,length [m]", ["P0"], [["P1"]],
         [[f"{np.linalg.norm(xy[0] - xy[1]):.4f}"]])  # fmt: skip
    bow = [
        (line, x, 5 + 48 * line + 1e-4 * (x - 120) ** 2) for line in range(4) for x in range(240)
    ]
    _csv(folder / "lines.csv", "line,col [px],row [px]", [str(a) for a, *_ in bow],
         [rest for _, *rest in bow])  # fmt: skip
    rows = [["id", "x1 [mm]", "y1 [mm]", "x2 [mm]", "y2 [mm]"]]
    rows += [[i, *a, *b] for i, a, b in zip(ids, mm1.tolist(), mm2.tolist(), strict=True)]
    cells = "".join(
        f"<table:table-row>{''.join(map(ods_cell, row))}</table:table-row>" for row in rows
    )
    with zipfile.ZipFile(folder / "survey.ods", "w") as package:
        package.writestr("content.xml", ODS.format(rows=cells))


def ods_cell(value: object) -> str:
    """Return one cell of `ODS`."""
    if isinstance(value, str):
        return (f'<table:table-cell office:value-type="string"><text:p>{value}</text:p>'
                "</table:table-cell>")  # fmt: skip
    return f'<table:table-cell office:value-type="float" office:value="{value}"/>'


def _csv(path: Path, heading: str, ids: list[str], *columns: object) -> None:
    parts = [[list(map(str, np.ravel(row))) for row in column] for column in columns]
    lines = [",".join([name, *(text for part in parts for text in part[k])])
             for k, name in enumerate(ids)]  # fmt: skip
    path.write_text("\n".join([heading, *lines, ""]), encoding="utf-8")


def _rasters_and_clouds(folder: Path, rng: np.random.Generator) -> None:
    corner = rasterio.Affine(GSD, 0, -GSD * WIDTH / 2, 0, -GSD, GSD * HEIGHT / 2)
    form = {"driver": "GTiff", "width": WIDTH, "height": HEIGHT, "transform": corner}
    smooth = np.sin(np.arange(HEIGHT)[:, None] / 9) * np.cos(np.arange(WIDTH) / 7)
    with rasterio.open(folder / "relief.tif", "w", count=3, dtype="float32", **form) as file:
        layers = (0.2 * smooth, 0.01 + 0 * smooth, 1 + 0 * smooth)
        file.write(np.stack(layers).astype("f4"))
    shutil.copy(folder / "relief.tif", folder / "relief2.tif")
    ring = [[-9, -9], [9, -9], [9, 9], [-9, 9], [-9, -9]]
    still = {"type": "Polygon", "coordinates": [ring]}
    (folder / "still.geojson").write_text(json.dumps(still), encoding="utf-8")
    wall = rng.integers(1, 250, (4, HEIGHT, WIDTH), dtype=np.uint8)  # seen by both
    for name in ("ortho1.tif", "ortho2.tif"):
        with rasterio.open(folder / name, "w", count=4, dtype="uint8", **form) as file:
            file.write(wall + rng.integers(0, 5, wall.shape, dtype=np.uint8))
            file.colorinterp = [rasterio.enums.ColorInterp[c]
                                for c in ("red", "green", "blue", "alpha")]  # fmt: skip
    with rasterio.open(folder / "dem.tif", "w", count=1, dtype="float32", **form) as file:
        file.write((-2 + 0.5 * smooth)[None].astype("f4"))
    xyz = np.column_stack([rng.uniform(-5, 5, (400, 2)), rng.uniform(-3, -1, 400)])
    xyz[:200, 2] = rng.normal(0.5, 0.01, 200)
    text = "\n".join(" ".join(f"{v:.4f}" for v in row) for row in xyz)
    names = "".join(f"property float {axis}\n" for axis in "xyz")
    (folder / "cloud.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 400\n{names}end_header\n{text}\n"
    )
    (folder / "mesh.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 4\n{names}element face 2\n"
        "property list uchar int vertex_indices\nend_header\n"
        "-9 -9 1\n9 -9 1\n9 9 1\n-9 9 1\n3 0 1 2\n3 0 2 3\n"
    )
    (folder / "mesh.obj").write_text("v -9 -9 1\nv 9 -9 1\nv 9 9 1\nv -9 9 1\nf 1 2 3\nf 1 3 4\n")
    (folder / "cloud.csv").write_text("X,Y,Z\n" + text.replace(" ", ",") + "\n")
    las = laspy.create(point_format=1, file_version="1.2")
    las.header.scales, las.header.offsets = [1e-3] * 3, [0, 0, 0]
    las.x, las.y, las.z = xyz.T
    las.gps_time = np.arange(400.0)
    for name in ("cloud.las", "cloud.laz"):
        las.write(folder / name)
    (folder / "eyes.csv").write_text("id,X,Y,Z\nA,-2,0,30\nB,2,0,30\nC,0,2,30\n")
    (folder / "flight.csv").write_text("time,X,Y,Z\n0,-9,0,50\n200,0,0,50\n400,9,0,50\n")
    (folder / "water.json").write_text(
        CliRunner().invoke(PROGRAMS["multimedia"],
                           ["waterlevel", str(folder / "cloud.csv"), "--json"]).stdout
    )  # fmt: skip
    rays = [f"{i},{x},0,30,{-x + 0.1 * i},{0.2 * i},-33" for i in range(5) for x in (-2, 2)]
    (folder / "rays.csv").write_text("id,X0,Y0,Z0,DX,DY,DZ\n" + "\n".join(rays) + "\n")
    (folder / "shift.csv").write_text("id,X,Y,Z\nA,0.5,0,-0.2\nB,0,0.4,-0.1\nC,0.1,0.3,-0.3\n")


def _tank(folder: Path) -> None:
    """Write the project of a tank, and as OpenPTV's folder, which wants the origin in the water."""
    lift = np.array([0, 0, 300.0])
    sensor = replace(SENSOR, origin=np.array([SENSOR.width, SENSOR.height]) / 2)
    lens = Brown(k1=2e-5, convention=Convention.OPENPTV)
    views = [replace(c, centre=c.centre + lift, sensor=sensor) for c in cameras(lens)]
    glass, points = FlatInterface(layers=LAYERS, point=lift, normal=(0, 0, 1)), control(16) + lift
    ids = tuple(f"{k}" for k in range(16))
    whole = Project(
        cameras=tuple(views), unit="mm", sigma_image=0.001, media={"tank": glass},
        media_of=("tank",) * 4, object_points=ObjectPoints(ids=ids, xyz=points),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in views for _ in ids), ids=ids * 4,
            image=np.concatenate([project(c, points, glass) for c in views]),
        ),
    )  # fmt: skip
    _boards(folder)
    write_project(folder / "tank.toml", whole)
    write_experiment(folder / "ptv", whole)


def _projects(folder: Path) -> None:
    """Write a project of each program known, with its photos, and picks in them."""
    shots, xyz = make_shots(), to_world(wall_points(120))
    render(shots, folder / "project")
    for write, name in (
        (write_colmap_text, "text"), (write_colmap_binary, "binary"),
        (write_opensfm, "reconstruction.json"), (write_alicevision, "cameras.sfm"),
        (partial(write_openmvg, nested=True), "sfm_data.json"), (write_bundler, "bundle.out"),
        (write_nerf, "transforms.json"), (write_reality_xmp, ""), (write_visualsfm, "model.nvm"),
        (write_reality_table, "cameras.csv"), (write_alicevision, MESHROOM),
    ):  # fmt: skip
        (folder / "project" / name).parent.mkdir(parents=True, exist_ok=True)
        write(folder / "project" / name, shots, xyz)
    write_metashape(folder / "project" / "cameras.xml", shots)
    places = {"A": (-1.5, -1, 0), "B": (1.5, -1, 0), "C": (1.4, 1.1, 0)}
    rows = [
        f"{name},{shot.file},{','.join(map(str, shot.pixels(to_world(np.array([place])))[0]))}"
        for name, place in places.items() for shot in shots[:3]
    ]  # fmt: skip
    (folder / "project.csv").write_text("\n".join(["id,photo,col [px],row [px]", *rows, ""]))
    rows = [f"{name},{x},{y},{r}" for name, (x, y, r) in places.items()]
    (folder / "corners.csv").write_text("\n".join(["id,X [m],Y [m],r [m]", *rows, ""]))


def _boards(folder: Path) -> None:
    """Write three photos of a chessboard, of the first camera of the tank."""
    squares = np.kron(np.indices((7, 10)).sum(0) % 2, np.ones((60, 60)))
    board = np.pad(np.where(squares > 0, 20, 235), 60, constant_values=235).astype(np.uint8)
    height, width = board.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    for number, (x, y) in enumerate(((0, 0), (120, 40), (-60, 90)), start=1):
        seen = [[200 + x / 2, 150 + y], [980, 160 + y / 2], [1000 - x, 760], [220, 740 - y]]
        turn = cv2.getPerspectiveTransform(corners, np.array(seen, np.float32))
        image = cv2.warpPerspective(board, turn, (1280, 1024), borderValue=(128,))
        cv2.imwrite(str(folder / f"cam1_{number}.png"), image)
