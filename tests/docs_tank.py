"""The files that the pages' commands on water take for granted: a tank, a bed, boards, tables."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import laspy
import numpy as np
import openpyxl
import rasterio
from click.testing import CliRunner

from multimedia import (
    Brown,
    Camera,
    Convention,
    FlatInterface,
    ImagePoints,
    Layers,
    ObjectPoints,
    Project,
    Sensor,
    project,
    read_project,
    write_experiment,
    write_project,
)
from multimedia.boards.workflow import find_boards
from tests.builders.commands import multimedia_command as main
from tests.multimedia.rendered_boards import Housing, chessboard, photo, poses
from tests.multimedia.tank import LAYERS, SENSOR, cameras, control
from tests.multimedia.targets.rendered_particles import drawn

#: OpenPTV counts from a point in the water. [mm]
LIFT = np.array([0, 0, 300.0])


#: A camera as MyPTV saves it: size, centre, angles, focal length, principal point, no polynomial.
MYPTV = """Tsai model camera
cam1
1280 1024
60.0 30.0 505.0
0.02 3.19 3.12
6000.0
12.0 -20.0
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
"""


def make_tank(folder: Path) -> None:
    """Write projects, an OpenPTV experiment with a frame of particles, exchange files, tables."""
    sensor = replace(SENSOR, origin=np.array([SENSOR.width, SENSOR.height]) / 2)
    lens = Brown(k1=2e-5, convention=Convention.OPENPTV)
    views = [replace(c, centre=c.centre + LIFT, sensor=sensor) for c in cameras(lens)]
    glass = FlatInterface(layers=LAYERS, point=LIFT, normal=(0, 0, 1))
    tank = _project(views, glass, control(40) + LIFT)
    write_project(folder / "tank.toml", tank)
    write_experiment(folder / "experiment", tank)
    _particles(folder, views, glass)
    shutil.copytree(folder / "experiment", folder / "test_cavity")
    # As in the published example, glass and water are interchanged in this one.
    swapped = folder / "test_cavity" / "parameters" / "ptv.par"
    swapped.write_text(swapped.read_text().replace("\n1.5\n1.337\n", "\n1.337\n1.5\n"))
    shutil.copytree(folder / "experiment" / "img", folder / "img")
    (folder / "res").mkdir()
    (folder / "myptv").mkdir()
    (folder / "myptv" / "cam1").write_text(MYPTV)
    _variants(folder, views, tank)
    xyz = control(8, seed=9)
    rows = [f"{k},{x:.4f},{y:.4f},{z:.4f}" for k, (x, y, z) in enumerate(xyz + LIFT)]
    (folder / "wand.csv").write_text("\n".join(["id,X [mm],Y [mm],Z [mm]", *rows, ""]))
    shutil.copyfile(folder / "tank_image_points.csv", folder / "frame.csv")
    cv2.imwrite(str(folder / "cam2.tif"), np.full((1024, 1280), 90, np.uint8))
    _shifted_points(folder)
    _boards(folder)


def _project(views, media, xyz: np.ndarray, unit: str = "mm") -> Project:
    """Return cameras, media, points and their exact images with a little noise. [mm]"""
    ids = tuple(str(k) for k in range(len(xyz)))
    rng = np.random.default_rng(3)
    seen = np.concatenate([project(camera, xyz, media) for camera in views])
    return Project(
        cameras=tuple(views), unit=unit, sigma_image=0.001, media={"tank": media},
        media_of=("tank",) * len(views), object_points=ObjectPoints(ids=ids, xyz=xyz),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in views for _ in ids), ids=ids * len(views),
            image=seen + rng.normal(0, 0.001, seen.shape),
        ),
    )  # fmt: skip


def _particles(folder: Path, views, glass: FlatInterface) -> None:
    """Write the targets of thirty particles, as frame 1 and as they turn from frame 10001 on.

    Of that frame there are images, too.
    """
    xyz = np.random.default_rng(7).uniform((-60, -50, 150), (60, 50, 250), (30, 3))
    (folder / "experiment" / "img").mkdir()
    (folder / "experiment" / "res").mkdir()
    for frame in (1, *range(10001, 10007)):
        turn = np.exp(0.05j * max(frame - 10001, 0)) * (xyz[:, 0] + 1j * xyz[:, 1])
        moved = np.column_stack([turn.real, turn.imag, xyz[:, 2]])
        for camera in views:
            pixels = camera.sensor.pixel_from_image(project(camera, moved, glass))
            lines = [f"{n} {x:.6f} {y:.6f} 9 3 3 99 -1" for n, (x, y) in enumerate(pixels)]
            path = folder / "experiment" / "img" / f"{camera.name}.{frame}_targets"
            path.write_text("\n".join([f"{len(lines)}", *lines, ""]))
            if frame == 10001:
                image = drawn(pixels - 0.5, (SENSOR.height, SENSOR.width), seed=1)
                cv2.imwrite(str(path.with_name(f"{camera.name}.{frame}.tif")), image)


def _variants(folder: Path, views, tank: Project) -> None:
    """Write a reef of which one length is known, a rig of AquaCal, a model of COLMAP."""
    # Metres, all lengths times such a factor that the first two points are half a metre apart.
    xyz = control(40)
    size = 0.5 / np.linalg.norm(xyz[1] - xyz[0])
    reef = [replace(c, centre=(c.centre - LIFT) * size) for c in views]
    water = FlatInterface(layers=Layers(indices=(1.0, 1.337), thicknesses=()))
    made = _project(reef, water, xyz * size, unit="m")
    names = ("A", "B", *made.object_points.ids[2:])
    write_project(folder / "reef.toml", replace(
        made, object_points=ObjectPoints(ids=names, xyz=xyz * size),
        image_points=replace(made.image_points, ids=names * len(reef)),
    ))  # fmt: skip
    middle, way = control(12, seed=5) + LIFT, 40.0 * np.array([0.64, 0.48, 0.6])
    wand = _project(views, tank.media["tank"], np.concatenate([middle - way, middle + way]))
    ends = tuple(f"{k}{end}" for end in "ab" for k in range(12))
    write_project(folder / "wand.toml", replace(
        wand, object_points=ObjectPoints(ids=(), xyz=np.empty((0, 3))),
        image_points=replace(wand.image_points, ids=ends * len(views)),
    ))  # fmt: skip
    brown = [replace(camera, distortion=Brown(k1=2e-5)) for camera in reef]
    write_project(folder / "rig.toml", _project(brown, water, xyz * size, unit="m"))
    for words in (
        ["convert", "rig.toml", "calibration.json", "--to", "aquacal"],
        ["convert", "tank.toml", "sparse/0", "--to", "colmap"],
    ):
        if "colmap" in words:
            (folder / "sparse").mkdir()
        words[1:3] = [str(folder / word) for word in words[1:3]]
        done = CliRunner().invoke(main, words)
        assert done.exit_code == 0, done.output
    assert read_project(folder / "tank.toml").unit == tank.unit


def _shifted_points(folder: Path) -> None:
    """Write tables of points in water, and the workbook of a tank filled in."""
    rows = [("A", 0.5, 0.0, -0.2), ("B", 0.0, 0.4, -0.1), ("C", 0.1, 0.3, -0.3)]
    text = ["id,X,Y,Z", *(",".join(map(str, row)) for row in rows)]
    (folder / "water_points.csv").write_text("\n".join([*text, ""]))
    mm = [(name, *(1000 * v for v in place)) for name, *place in rows]
    comma = [
        "id;X;Y;Z",
        *(";".join([n, *(f"{v:.1f}".replace(".", ",") for v in p)]) for n, *p in mm),
    ]
    (folder / "punti.csv").write_text("\n".join([*comma, ""]))
    book = openpyxl.Workbook()
    for row in [("id", "X", "Y", "Z"), *mm]:
        book.active.append(row)
    book.save(folder / "points.xlsx")
    words = ["shift", str(folder / "water_points.csv"), "--out", str(folder / "tank.xlsx")]
    media = ["--camera", "0.2,0.1,0.51", "--indices", "1,1.5,1.337", "--thicknesses", "0.01"]
    assert CliRunner().invoke(main, [*words, *media]).exit_code == 0


def _boards(folder: Path) -> None:
    """Write photos of a chessboard through the port of a housing, and the project of its points."""
    eye = Housing(width=480, height=360, pitch=0.008, c=2.8, k1=-4e-3)
    photos = []
    for k, (turn, shift) in enumerate(poses(4, (192, 120), near=300.0, far=560.0, seed=2)):
        photos.append(folder / f"dive{k}.png")
        image = photo(eye, chessboard(9, 6, 24.0), turn, shift, seed=k)
        cv2.imwrite(str(photos[-1]), image)
    camera = Camera(
        centre=np.zeros(3), rotation=np.eye(3), principal_distance=2.85, name="cam1",
        sensor=Sensor(width=eye.width, height=eye.height, pixel_size=np.array([0.008, 0.008])),
    )  # fmt: skip
    port = FlatInterface(
        layers=Layers(indices=(1.0, 1.5, 1.337), thicknesses=(8.0,)), point=(0, 0, -46.0),
        normal=(0, 0, 1.0), moves_with_camera=True,
    )  # fmt: skip
    housing = Project(cameras=(camera,), media={"port": port}, media_of=("port",), unit="mm")
    write_project(folder / "housing.toml", housing)
    find_boards(
        folder / "housing.toml", photos, folder / "boards.toml", pattern="chessboard", board=(9, 6),
        square=24.0,
    )  # fmt: skip


def make_bed(folder: Path) -> None:
    """Write a bed as raster and clouds, the water's tie points, cameras, echoes, rays."""
    rng = np.random.default_rng(13)
    smooth = np.sin(np.arange(60)[:, None] / 9) * np.cos(np.arange(80) / 7)
    form = {
        "driver": "GTiff",
        "width": 80,
        "height": 60,
        "count": 1,
        "dtype": "float32",
        "crs": "EPSG:32632",
        "transform": rasterio.Affine(0.5, 0, -20, 0, -0.5, 15),
    }
    for name, level in (("dem.tif", 1.8075), ("bed.tif", 101.2)):
        with rasterio.open(folder / name, "w", **form) as file:
            file.write((level - 1 + 0.6 * smooth)[None].astype("f4"))
    xyz = np.column_stack([rng.uniform(-5, 5, (400, 2)), rng.uniform(99, 102, 400)])
    text = [",".join(f"{v:.4f}" for v in row) for row in xyz]
    (folder / "cloud.csv").write_text("\n".join(["X,Y,Z", *text, ""]))
    las = laspy.create(point_format=1, file_version="1.2")
    las.header.scales, las.header.offsets = [1e-3] * 3, [0, 0, 0]
    las.x, las.y, las.z = xyz.T
    las.gps_time = np.arange(400.0)
    for name in ("cloud.las", "echoes.las"):
        las.write(folder / name)
    eyes = [
        f"{at},160,2026-06-01T10:0{k}:00" for k, at in enumerate(("A,-12,0", "B,12,0", "C,0,12"))
    ]
    (folder / "cameras.csv").write_text("\n".join(["id,X,Y,Z,time", *eyes, ""]))
    tide = "time,level\n2026-06-01T10:00:00,102.3\n2026-06-01T10:20:00,102.5\n"
    (folder / "tide.csv").write_text(tide)
    made = [f"{x:.3f} {y:.3f} {0.8 + 0.3 * np.sin(x):.3f}" for x, y in rng.uniform(-9, 9, (60, 2))]
    (folder / "multibeam.xyz").write_text("\n".join([*made, ""]))
    book = openpyxl.Workbook()
    for row in [
        ("id", "X", "Y", "Z"),
        *((f"s{k}", *map(float, p)) for k, p in enumerate(xyz[:40])),
    ]:
        book.active.append(row)
    book.save(folder / "check.xlsx")
    (folder / "flight.csv").write_text("time,X,Y,Z\n0,-9,0,150\n200,0,0,150\n400,9,0,150\n")
    ties = xyz.copy()
    ties[:150, 2] = rng.normal(1.8075, 0.005, 150)
    ties[150:, 2] = rng.uniform(0, 1.4, 250)
    high = [",".join(f"{v:.4f}" for v in row) for row in ties + np.array([0, 0, 100.5925])]
    (folder / "high_tiepoints.csv").write_text("\n".join(["X,Y,Z", *high, ""]))
    text = [",".join(f"{v:.4f}" for v in row) for row in ties]
    (folder / "tiepoints.csv").write_text("\n".join(["X,Y,Z", *text, ""]))
    names = "".join(f"property float {axis}\n" for axis in "xyz")
    body = "\n".join(text).replace(",", " ")
    head = f"ply\nformat ascii 1.0\nelement vertex 400\n{names}end_header\n"
    (folder / "tiepoints.ply").write_text(f"{head}{body}\n")
    rays = [f"{i},{x},0,30,{-x + 0.1 * i},{0.2 * i},-33" for i in range(5) for x in (-2, 2)]
    (folder / "rays.csv").write_text("\n".join(["id,X0,Y0,Z0,DX,DY,DZ", *rays, ""]))
