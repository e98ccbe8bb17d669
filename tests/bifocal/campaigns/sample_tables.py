"""The demo's sample pair with tables of control and check points; truth is its scene's."""

from __future__ import annotations

import csv
from pathlib import Path

from bifocal.demo import SAMPLE
from tests.scenes import demo_scene

FAR, NEAR = SAMPLE / "far.jpg", SAMPLE / "near.jpg"
CONTROL = frozenset(f"T{number:02}" for number in (1, 4, 5, 7, 10, 13, 16, 19, 20, 23, 31, 32))
_HEADINGS = ["id", "X [m]", "Y [m]", "r [m]", "col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]"]


def write_tables(folder: Path, *, reduction: int = 1) -> tuple[Path, Path]:
    """Write ``control.csv`` and ``check.csv``: places from the scene, pixels as picked.

    Pixels are those of photos made smaller by a whole number.
    """
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
                    pixels = (float(pick[name]) for name in _HEADINGS[4:])
                    small = ((pixel + 0.5) / reduction - 0.5 for pixel in pixels)
                    writer.writerow([pick["id"], *place, *(f"{v:.3f}" for v in small)])
    return paths


def write_survey(folder: Path) -> Path:
    """Write a survey of three pairs of small photos, and of two that are broken on purpose."""
    from PIL import Image

    folder.mkdir()
    control, check = write_tables(folder, reduction=2)
    for index, name in enumerate("abc"):
        for path, kind in ((FAR, "far"), (NEAR, "near")):
            photo = Image.open(path).reduce(2)
            # Three walls for the program: the same one in other light.
            photo = photo.point([min(255, round(v * (1 - 0.1 * index))) for v in range(256)] * 3)
            photo.save(folder / f"{name}_{kind}.png")
    (folder / "broken.png").write_bytes((folder / "a_far.png").read_bytes()[:20000])
    lines = ['scale = "1:100"', 'quality = "fast"', 'sensor_width = 22.7', "focal1 = 35",
             "focal2 = 19", 'products = ["relief", "points"]']  # fmt: skip
    for name in "abc":
        lines += ["[[pair]]", f'name = "{name}"', f'far = "{name}_far.png"']
        lines += [f'near = "{name}_near.png"', f'control = "{control.name}"']
        lines += [f'check = "{check.name}"']
    lines += ["[[pair]]", 'name = "cut off"', 'far = "broken.png"', 'near = "a_near.png"']
    lines += [f'control = "{control.name}"']
    lines += ["[[pair]]", 'name = "no control"', 'far = "b_far.png"', 'near = "b_near.png"']
    path = folder / "street.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
