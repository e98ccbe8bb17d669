"""The demo's sample pair, and at half its size, with tables of points; truth is its scene's."""

from __future__ import annotations

import csv
from pathlib import Path

from PIL import Image

from bifocal import SAMPLE
from tests.scenes import demo_scene

FAR, NEAR = SAMPLE / "far.jpg", SAMPLE / "near.jpg"
CONTROL = frozenset(f"T{number:02}" for number in (1, 4, 5, 7, 10, 13, 16, 19, 20, 23, 31, 32))
_HEADINGS = ["id", "X [m]", "Y [m]", "r [m]", "col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]"]


def write_small_photos(folder: Path) -> tuple[Path, Path]:
    """Write both photos at half their size, which take a quarter of the time."""
    for photo in (FAR, NEAR):
        with Image.open(photo) as image:
            half = (image.width // 2, image.height // 2)
            small = image.resize(half, Image.Resampling.BOX)
            small.save(folder / photo.name, quality=95, exif=image.getexif())
    return folder / FAR.name, folder / NEAR.name


def write_tables(folder: Path, *, small: bool = False) -> tuple[Path, Path]:
    """Write ``control.csv`` and ``check.csv``: places from the scene, pixels as picked."""
    places = {target.name: target.position for target in demo_scene().targets}
    with (SAMPLE / "targets.csv").open(encoding="utf-8") as file:
        picks = list(csv.DictReader(file))
    paths = folder / "control.csv", folder / "check.csv"
    for path, is_control in zip(paths, (True, False), strict=True):
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_HEADINGS)
            for pick in picks:
                if (pick["id"] in CONTROL) == is_control:
                    place = (*places[pick["id"]], pick["r measured [m]"])
                    pixels = [float(pick[name]) for name in _HEADINGS[4:]]
                    if small:
                        pixels = [v / 2 - 0.25 for v in pixels]
                    writer.writerow([pick["id"], *place, *(f"{v:.3f}" for v in pixels)])
    return paths
