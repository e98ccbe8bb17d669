"""Wavy, raster and mesh surfaces from the command line, against Fermat's principle.

The truth is the stationary optical path between camera and point, found by scipy: no refraction
formula, no normal, nothing of the code under test.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from scipy.optimize import minimize

from multimedia import GeometryError, Plane, WaveSurface, read_project
from multimedia.bathymetry.correction_job import Outcome
from tests.builders.commands import multimedia_command as main

INDEX = 1.34
RNG = np.random.default_rng(12)
BOTTOM = RNG.uniform((-1.5, -1.5, -3.0), (1.5, 1.5, -1.0), (5, 3))
EYES = np.array([(-2.0, -0.5, 6.0), (2.0, 0.4, 6.5), (0.3, 1.9, 5.5)])


def waves(x, y):
    """Two waves as the options below say them: from +Y clockwise, phase 0 a crest."""
    number, turn = 2 * np.pi / 2.0, np.radians(30.0)
    first = 0.03 * np.cos(number * (x * np.sin(turn) + y * np.cos(turn)))
    number, turn = 2 * np.pi / 0.9, np.radians(100.0)
    return first + 0.004 * np.cos(number * (x * np.sin(turn) + y * np.cos(turn)) + np.radians(70))


def bowl(x, y):
    """A quadratic, which the cubic convolution of a raster reproduces."""
    return 0.02 + 0.01 * x - 0.015 * y + 0.006 * x * x - 0.004 * x * y + 0.003 * y * y


def tilted(x, y):
    """A plane, which a mesh holds exactly."""
    return 0.05 + 0.02 * x - 0.03 * y


SURFACES = {"waves": waves, "raster": bowl, "grid": bowl, "ply": tilted, "obj": tilted}
WAVES = [[0.03, 2.0, 30.0], [0.004, 0.9, 100.0, 70.0]]


def shot(eye, point, height):
    """Return the unit direction in which the camera sees a point: the stationary optical path."""

    def path(xy):
        gate = np.array([*xy, height(*xy)])
        return np.linalg.norm(gate - eye) + INDEX * np.linalg.norm(point - gate)

    start = (eye + (point - eye) * (eye[2] / (eye[2] - point[2])))[:2]
    xy = minimize(path, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 0}).x

    def slope(place, step=1e-4):
        ways = step * np.eye(2)
        return np.array([
            (8 * (path(place + w) - path(place - w)) - path(place + 2 * w) + path(place - 2 * w))
            / (12 * step) for w in ways
        ])  # fmt: skip

    for _ in range(4):  # Newton on the slope of the path: stationary to 1e-12
        turn = np.column_stack([(slope(xy + d) - slope(xy - d)) / 2e-3 for d in 1e-3 * np.eye(2)])
        xy = xy - np.linalg.solve(turn, slope(xy))
    gate = np.array([*xy, height(*xy)])
    return (gate - eye) / np.linalg.norm(gate - eye)


def write_surface(kind: str, folder: Path) -> str:
    """Write the surface's file and return its name; a height for waves."""
    if kind == "waves":
        return "0"
    side = np.linspace(-4, 4, 81)
    x, y = np.meshgrid(side, side[::-1])
    heights = SURFACES[kind](x, y)
    if kind == "raster":
        with rasterio.open(
            folder / "water.tif", "w", driver="GTiff", width=81, height=81, count=1,
            dtype="float64", transform=Affine(0.1, 0, -4.05, 0, -0.1, 4.05), nodata=-9999,
        ) as out:  # fmt: skip
            out.write(heights, 1)
        return "water.tif"
    if kind == "grid":
        head = "ncols 81\nnrows 81\nxllcorner -4.05\nyllcorner -4.05\ncellsize 0.1\n"
        rows = "\n".join(" ".join(f"{v:.12f}" for v in row) for row in heights)
        (folder / "water.asc").write_text(f"{head}NODATA_value -9999\n{rows}\n")
        return "water.asc"
    corner = np.arange(80 * 81).reshape(80, 81)[:, :-1].ravel()
    cells = np.stack([[corner, corner + 1, corner + 82], [corner, corner + 82, corner + 81]])
    faces = cells.transpose(0, 2, 1).reshape(-1, 3)
    points = np.column_stack([x.ravel(), y.ravel(), heights.ravel()])
    lines = [" ".join(f"{v:.12f}" for v in p) for p in points]
    if kind == "obj":
        text = "# water\n" + "".join(f"v {line}\n" for line in lines)
        text += "".join(f"f {a + 1}//1 {b + 1}//1 {c + 1}//1\n" for a, b, c in faces)
        (folder / "water.obj").write_text(text)
        return "water.obj"
    text = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
    text += "".join(f"property double {axis}\n" for axis in "xyz")
    text += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    text += "".join(f"{line}\n" for line in lines)
    text += "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)
    (folder / "water.ply").write_text(text)
    return "water.ply"


def section(kind: str, name: str) -> str:
    """Return the media of a project file with the surface."""
    said = {
        "waves": f"kind = 'waves', level = 0.0, waves = {WAVES}",
        "raster": f"kind = 'raster', file = '{name}'", "grid": f"kind = 'raster', file = '{name}'",
    }.get(kind, f"kind = 'mesh', file = '{name}'")  # fmt: skip
    return f"[media.sea]\nindices = [1.0, {INDEX}]\nsurfaces = [{{ {said} }}]\n"


@pytest.mark.parametrize("kind", SURFACES)
def test_measured_rays_meet_in_the_true_point(kind: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    given = write_surface(kind, tmp_path)
    rows = [
        [f"p{k}", *eye, *shot(eye, point, SURFACES[kind])]
        for k, point in enumerate(BOTTOM) for eye in EYES
    ]  # fmt: skip
    with Path("rays.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["id", "X0", "Y0", "Z0", "DX", "DY", "DZ"], *rows])
    said = [w for wave in WAVES for w in ("--wave", ",".join(map(str, wave)))]
    words = ["bathymetry", "rays.csv", "--rays", "--water-level", given, "--index", str(INDEX)]
    words += said if kind == "waves" else []
    result = CliRunner().invoke(main, [*words, "--out", "points.csv"])
    assert result.exit_code == 0, result.output
    with Path("points.csv").open() as file:
        found = [[float(row[axis]) for axis in ("X", "Y", "Z")] for row in csv.DictReader(file)]
    assert np.abs(np.array(found) - BOTTOM).max() < 2e-6  # shot to 1e-9 rad, printed to 1e-6


@pytest.mark.parametrize(
    "kind", ["waves", *(pytest.param(k, marks=pytest.mark.acceptance) for k in ("raster", "ply"))]
)
def test_a_project_looks_through_the_surface(kind: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    given = write_surface(kind, tmp_path)
    head = 'format = "multimedia-project/1"\nobject_points = "b.csv"\nimage_points = "i.csv"\n'
    cameras, seen = "", []
    for name, eye in zip("ABC", EYES, strict=True):
        cameras += f'[[camera]]\nname = "{name}"\nmedia = "sea"\nc = 20.0\n'
        cameras += f"centre = {eye.tolist()}\nomega = 0.0\nphi = 0.0\nkappa = 0.0\n"
        for k, point in enumerate(BOTTOM):
            ray = shot(eye, point, SURFACES[kind])
            x, y = -20.0 * ray[:2] / ray[2]  # looking straight down, x along X
            seen.append([name, f"p{k}", repr(float(x)), repr(float(y))])
    Path("sea.toml").write_text(f"{head}{section(kind, given)}{cameras}")
    with Path("b.csv").open("w", newline="") as file:
        csv.writer(file).writerows(
            [["id", "X [m]", "Y [m]", "Z [m]"], *([f"p{k}", *p] for k, p in enumerate(BOTTOM))]
        )
    with Path("i.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["camera", "id", "x [mm]", "y [mm]"], *seen])
    result = CliRunner().invoke(main, ["project", "sea.toml", "--out", "seen.csv"])
    assert result.exit_code == 0, result.output
    with Path("seen.csv").open() as file:
        rows = {(r["camera"], r["id"]): r for r in csv.DictReader(file)}
    for name, point, x, y in seen:
        row = rows[name, point]
        assert abs(float(row["x [mm]"]) - float(x)) < 2e-6
        assert abs(float(row["y [mm]"]) - float(y)) < 2e-6
    result = CliRunner().invoke(main, ["intersect", "sea.toml", "--out", "xyz.csv"])
    assert result.exit_code == 0, result.output
    (tmp_path / "far").mkdir()
    words = ["resect", "sea.toml", "--camera", "A", "--json", "--out", "far/oriented.toml"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    first = json.loads(result.stdout)["cameras"][0]
    assert [first[a] for a in ("X0", "Y0", "Z0")] == pytest.approx(EYES[0].tolist(), abs=1e-5)
    # Written anew elsewhere, the project finds the surface again.
    again = read_project(tmp_path / "far/oriented.toml")
    surface = read_project("sea.toml").media["sea"].surfaces[0]
    xy = RNG.uniform(-1, 1, (20, 2))
    assert (
        np.abs(again.media["sea"].surfaces[0].height_at(xy) - surface.height_at(xy)).max() < 1e-12
    )


def test_what_a_surface_does_not_cover_is_said(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_surface("raster", tmp_path)
    Path("cloud.csv").write_text("X,Y,Z\n0,0,-1\n1,1,-2\n9,0,-1\n")
    words = ["bathymetry", "cloud.csv", "--water-level", "water.tif", "--index", "1.34", "--out"]
    result = CliRunner().invoke(main, [*words, "some.csv"])
    assert result.exit_code == 0
    assert "1 points lie outside the modelled water surface and were left as given" in result.stderr
    Path("cloud.csv").write_text("X,Y,Z\n90,0,-1\n91,1,-2\n")
    result = CliRunner().invoke(main, [*words, "none.csv"])
    assert result.exit_code == 1
    assert "the water surface covers none of the points: 2 of 2 lie outside" in result.stderr
    assert not Path("none.csv").exists()
    head = 'format = "multimedia-project/1"\nobject_points = "b.csv"\n'
    camera = '[[camera]]\nmedia = "sea"\nc = 20.0\ncentre = [0.0, 0.0, 6.0]\n'
    camera += "omega = 0.0\nphi = 0.0\nkappa = 0.0\n"
    Path("sea.toml").write_text(f"{head}{section('raster', 'water.tif')}{camera}")
    Path("b.csv").write_text("id,X [m],Y [m],Z [m]\nin,0,0,-1\nout,9,0,-1\n")
    result = CliRunner().invoke(main, ["project", "sea.toml", "--out", "-"])
    with_status = {row["id"]: row["status"] for row in csv.DictReader(result.stdout.splitlines())}
    assert with_status["in"] == "ok"
    assert "interface" in with_status["out"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--water-level", "0", "--wave", "0.05"), "a wave is amplitude, length and, if wanted"),
        (("--water-level", "0", "--wave", "0.05,four"), "expected AMPLITUDE,LENGTH"),
        (("--water-level", "0", "--wave", "-0.05,4"), "amplitude and length of a wave must be abo"),
        (("--water-level", "water.tif", "--wave", "0.05,4"), "waves are added to a height, not to"),
        (("--water-level", "bad.obj"), "bad.obj, line 4: 'f 1 2 9' is no vertex or face"),
        (("--water-level", "dots.obj"), "dots.obj: holds no faces"),
        (("--water-level", "upright.obj"), "upright.obj: triangles: 1 of 1 triangles have no ext"),
        (("--water-level", "folded.obj"), "folded.obj: triangles: 1 edges have two triangles on"),
        (("--water-level", "typo.asc"), "typo.asc, line 7: '0.l' is no height"),
        (("--water-level", "nowhere.tif"), "nowhere.tif: has no position"),
        (("--water-level", "water.stl"), "neither a height in metres nor a .tif or .asc raster"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_bad_surfaces_are_refused_in_one_sentence(words, message, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_surface("raster", tmp_path)
    Path("bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    Path("dots.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    Path("upright.obj").write_text("v 0 0 0\nv 1 0 0\nv 0.5 0 1\nf 1 2 3\n")
    Path("folded.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 4 2 1\n")
    head = "ncols 3\nnrows 3\nxllcorner -1\nyllcorner -1\ncellsize 1\n"
    Path("typo.asc").write_text(f"{head}0.1 0.1 0.1\n0.1 0.l 0.1\n0.1 0.1 nan\n")
    with rasterio.open(
        "nowhere.tif", "w", driver="GTiff", width=4, height=4, count=1, dtype="float32"
    ) as out:
        out.write(np.arange(16, dtype=np.float32).reshape(4, 4), 1)
    Path("cloud.csv").write_text("X,Y,Z\n0,0,-1\n1,1,-2\n")
    command = ["bathymetry", "cloud.csv", *words, "--index", "1.34", "--out", "bed.csv"]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 1
    assert message in result.stderr
    assert not Path("bed.csv").exists()


def test_bad_surfaces_of_a_project_are_named(tmp_path) -> None:
    head = 'format = "multimedia-project/1"\n'
    camera = '[[camera]]\nmedia = "sea"\nc = 20.0\ncentre = [0.0, 0.0, 6.0]\n'
    camera += "omega = 0.0\nphi = 0.0\nkappa = 0.0\n"
    for said, message in (
        ("kind = 'raster'", r"media.sea, surface 1: the key 'file' is missing"),
        ("kind = 'raster', file = 'no.tif'", r"no\.tif: no such raster file"),
        ("kind = 'mesh', file = 'no.stl'", r"no\.stl"),
        ("kind = 'waves', level = 0.0, waves = 3", "waves must be a list of"),
        ("kind = 'waves', level = 0.0, waves = []", "there are no waves"),
        ("kind = 'waves', level = 0.0, waves = [[0.1, 2.0]], moves_with_camera = true",
         "a WaveSurface stands still in the object frame"),
    ):  # fmt: skip
        media = f"[media.sea]\nindices = [1.0, 1.34]\nsurfaces = [{{ {said} }}]\n"
        (tmp_path / "sea.toml").write_text(head + media + camera)
        with pytest.raises(ValueError, match=message):
            read_project(tmp_path / "sea.toml")


def test_points_that_no_rays_reach_are_not_said_to_be_dry() -> None:
    wavy = WaveSurface.sinusoid(0.0, amplitude=0.05, wavelength=4.0)
    for surface, more in ((wavy, r"oblique rays out with --max-angle"), (Plane.level(0.0), "")):
        outcome = Outcome(counts={"failed": 2}, lowest=-2.0, highest=-1.0)
        with pytest.raises(GeometryError, match=rf"none of 2 points could be corrected.*{more}"):
            outcome.judge(surface, allow_dry=False)
        outcome = Outcome(counts={"failed": 1, "rays": 1}, lowest=-2.0, highest=-1.0, _wet=1)
        outcome.judge(surface, allow_dry=False)
        assert ("--max-angle" in outcome.remarks[0]) == bool(more)
