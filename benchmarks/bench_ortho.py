"""Orthophoto of 24 megapixels against its own building blocks, and against orthority if given.

    python benchmarks/bench_ortho.py [--oty /path/to/oty]

Every run is a process of its own: CPU seconds (user + system) and peak memory. orthority 0.7 is
best installed in an environment of its own; it gets the same photo and relief, the wall
declared a map in a projected system, which it insists on.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import rasterio

from bifocal import Pair, Photo
from bifocal.files.geotiff import create_raster
from bifocal.files.images import write_image
from bifocal.model.grid import Grid

WIDTH, HEIGHT, GSD, D1, D2 = 6000, 4000, 0.00197, 17.5, 9.5


def relief_of(grid: Grid) -> np.ndarray:
    """Pilasters, windows, and a cornice that ramps out to 0.8 m."""
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    r = np.zeros(x.shape, np.float32)
    r[np.abs((x + 0.98) % 1.96 - 0.98) < 0.2] = 0.3
    r[(np.abs(x % 1.96 - 0.98) < 0.4) & (np.abs(y % 2.6 - 1.3) < 0.7)] = -0.4
    return np.where(y > 3.2, np.minimum((y - 3.2) * 1.2, 0.8).astype(np.float32), r)


def make_wall(folder: Path) -> None:
    rng = np.random.default_rng(1)
    rough = rng.integers(0, 255, (HEIGHT // 4, WIDTH // 4, 3), dtype=np.uint8)
    photo = cv2.GaussianBlur(cv2.resize(rough, (WIDTH, HEIGHT)), (0, 0), 2)
    photo = cv2.add(photo, rng.integers(0, 4, photo.shape, dtype=np.uint8))
    write_image(folder / "far.tif", photo)
    matrix = [[GSD, 0, -GSD * (WIDTH - 1) / 2], [0, -GSD, GSD * (HEIGHT - 1) / 2], [0, 0, 1]]
    Pair(
        image1=Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=D1, file="far.tif"),
        image2=Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=D2, file="far.tif"),
    ).write(folder / "wall.pair.json")
    grid = Grid(
        x0=-GSD * (WIDTH - 1) / 2, y0=GSD * (HEIGHT - 1) / 2, gsd=GSD, width=WIDTH, height=HEIGHT
    )
    with create_raster(folder / "relief.tif", grid, bands=1, dtype=np.float32) as writer:
        writer.write(relief_of(grid))


def run(command: list[str], folder: Path) -> tuple[float, float]:
    """Return CPU seconds and peak megabytes of a command."""
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, command
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000


def check(folder: Path) -> None:
    """One pixel by hand: X = 4, Y = 1 seen at q = (X, Y) d / (d - r)."""
    with rasterio.open(folder / "ortho.tif") as file:
        column, row = round(4 / GSD + (WIDTH - 1) / 2), round((HEIGHT - 1) / 2 - 1 / GSD)
        found = file.read([1, 2, 3], window=((row, row + 1), (column, column + 1))).ravel()
    x, y = (column - (WIDTH - 1) / 2) * GSD, ((HEIGHT - 1) / 2 - row) * GSD
    r = relief_of(Grid(x0=x, y0=y, gsd=GSD, width=1, height=1))[0, 0]
    u = np.float32(x * D1 / (D1 - r) / GSD + (WIDTH - 1) / 2)
    v = np.float32((HEIGHT - 1) / 2 - y * D1 / (D1 - r) / GSD)
    photo = cv2.imread(str(folder / "far.tif"))[:, :, ::-1].copy()
    seen = cv2.remap(photo, np.array([[u]]), np.array([[v]]), cv2.INTER_CUBIC)[0, 0]
    assert np.abs(found.astype(int) - seen).max() <= 2, (found, seen)


def write_orthority_inputs(folder: Path) -> None:
    pitch = 0.001
    focal = D1 / GSD * pitch
    (folder / "int.yaml").write_text(
        f"cam:\n  type: pinhole\n  im_size: [{WIDTH}, {HEIGHT}]\n  focal_len: {focal}\n"
        f"  sensor_size: [{WIDTH * pitch}, {HEIGHT * pitch}]\n"
    )
    (folder / "ext.csv").write_text(
        "filename,x,y,z,omega,phi,kappa\nfar.tif,500000,5000000,17.5,0,0,0\n"
    )
    with rasterio.open(folder / "relief.tif") as file:
        profile, values = file.profile, file.read()
    half = (WIDTH * GSD / 2, HEIGHT * GSD / 2)
    profile["crs"] = "EPSG:32632"
    profile["transform"] = rasterio.Affine(GSD, 0, 500000 - half[0], 0, -GSD, 5000000 + half[1])
    with rasterio.open(folder / "dem.tif", "w", **profile) as file:
        file.write(values)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--oty", help="orthority's command")
    parser.add_argument("--make", type=Path, help="only make the wall in a folder")
    parser.add_argument("--check", type=Path, help="only check the orthophoto in a folder")
    arguments = parser.parse_args()
    oty = arguments.oty
    if arguments.make:
        make_wall(arguments.make)
        return
    if arguments.check:
        check(arguments.check)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # A child inherits its parent's peak memory: keep this process small while measuring.
        subprocess.run([sys.executable, __file__, "--make", name], check=True)
        own = [sys.executable, "-m", "bifocal", "ortho", "wall.pair.json", "--out", "ortho.tif"]
        own += ["--relief", "relief.tif", "--overwrite", "--no-overviews"]
        rows = {}
        for title, extra in (("no mask", ["--no-mask"]), ("hidden pixels masked", ["--mask"])):
            rows[title] = min(run(own + extra, folder) for _ in range(3))
        check_run = [sys.executable, __file__, "--check", name]
        subprocess.run(check_run, check=True)
        if oty:
            write_orthority_inputs(folder)
            theirs = [oty, "frame", "-ip", "int.yaml", "-ep", "ext.csv", "-d", "dem.tif", "-r"]
            theirs += [str(GSD), "-i", "cubic", "-nbo", "-cm", "deflate", "-o", "-c", "EPSG:32632"]
            rows["orthority, no mask"] = min(run([*theirs, "far.tif"], folder) for _ in range(3))
        base = rows["no mask"][0]
        print(f"{WIDTH * HEIGHT / 1e6:.0f} MP in and out, cubic, deflate, best of 3")
        for title, (seconds, memory) in rows.items():
            print(f"{title:24s} {seconds:6.2f} CPU s {memory:6.0f} MB  {seconds / base:5.2f} x")


if __name__ == "__main__":
    main()
