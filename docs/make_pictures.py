"""Write pictures of the docs: `python docs/make_pictures.py bifocal-demo`.

Those of a demo from its folder; without one only when a third photo pays.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from bifocal import Photo, PhotoSet
from bifocal.reports.view_workflow import view_relief

HERE = Path(__file__).parent
PANELS = (
    ("near.jpg", "two photos (here the near one)"),
    ("relief.png", "relief map"),
    ("ortho.png", "orthophoto to scale"),
)
WIDTH = 620


def panel(path: Path, label: str) -> Image.Image:
    """Return one picture at the common width with its label below."""
    picture = Image.open(path).convert("RGBA")
    white = Image.new("RGBA", picture.size, "white")
    picture = Image.alpha_composite(white, picture).convert("RGB")
    picture = picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.LANCZOS)
    height = round(WIDTH * 2 / 3)
    sheet = Image.new("RGB", (WIDTH, height + 40), "white")
    sheet.paste(picture, (0, (height - picture.height) // 2))
    ImageDraw.Draw(sheet).text(
        (WIDTH / 2, height + 20), label, fill="#1b2733", anchor="mm",
        font=ImageFont.load_default(22),
    )  # fmt: skip
    return sheet


#: Cameras from above: X along the wall, distance from it [m], name, colour.
FAR, NEAR, MID = (0.0, 17.5, "35 mm", "#1b2733"), (0.0, 9.5, "19 mm", "#1b2733"), (
    0.0, 14.0, "28 mm", "#c77700")  # fmt: skip
ASIDE = tuple((step, 9.5, f"19 mm, {step:g} m aside", colour) for step, colour in (
    (0.75, "#7fb3d5"), (1.5, "#2e75b6"), (3.0, "#163f66")))  # fmt: skip


def sigma_along(stations: list[tuple[float, float, str, str]], x: np.ndarray) -> np.ndarray:
    """Return sigma of r along the wall through the nadir: picks of 0.5 px of 3.69 mm. [m]"""
    pixel = 0.00369
    photos = PhotoSet(photos=tuple(
        Photo(name=str(k), plane_from_pixel=[[pixel, 0, at], [0, -pixel, 0], [0, 0, 1]],
              nadir=(at, 0), distance=d) for k, (at, d, *_) in enumerate(stations)
    ))  # fmt: skip
    xyz = np.column_stack([x, 0 * x, 0 * x])
    return photos.intersect(photos.project(xyz), sigma_px=0.5).sigma[:, 2]


def third_photo(path: Path) -> None:
    """Draw where a third photo may stand, and what sigma of r it gives along the wall."""
    mpl.rcParams["svg.hashsalt"] = "bifocal"
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    plan, curves = figure.subplots(1, 2, width_ratios=(1, 1.5))
    plan.plot([-5.7, 5.7], [0, 0], color="black", lw=4, solid_capstyle="butt")
    for x, d, name, colour in (FAR, NEAR, MID, *ASIDE):
        plan.plot([x], [d], "^", color=colour, ms=9)
        label, side = (f"{x:g}", "center") if x else (name, "right")
        place = (x, d + (0.9 if x < 1 else -0.9)) if x else (-0.6, d)
        plan.annotate(label, place, fontsize=8, color=colour, ha=side, va="center")  # fmt: skip
    plan.set(aspect="equal", xlim=(-6, 8.5), ylim=(-0.6, 19), xlabel="X [m]",
             ylabel="distance from the wall [m]")  # fmt: skip
    x = np.linspace(-5.7, 5.7, 1141)
    pair = [FAR, NEAR]
    drawn = [(pair, "35 and 19 mm: the pair", "#1b2733", "-"),
             ([*pair, MID], "with 28 mm on the same axis", MID[3], "--")]  # fmt: skip
    drawn += [([*pair, one], f"with {one[2]}", one[3], "-") for one in ASIDE]
    for stations, label, colour, style in drawn:
        curves.plot(x, 1000 * sigma_along(stations, x), style, label=label, color=colour)
    curves.set(ylim=(0, 60), xlim=(-5.7, 5.7), xlabel="X, through the nadir [m]",
               ylabel="sigma of r [mm]")  # fmt: skip
    curves.legend(fontsize=8, loc="upper left")
    figure.savefig(path, metadata={"Date": None})


def main(folder: Path | None) -> None:
    """Write docs/images/third-photo.svg, demo.jpg, and the relief in three dimensions."""
    third_photo(HERE / "images" / "third-photo.svg")
    if folder is None:
        return
    view_relief(
        folder / "relief.tif", HERE / "relief-3d.html", ortho=folder / "ortho.tif",
        title="The sample façade", overwrite=True,
    )  # fmt: skip
    panels = [panel(folder / name, label) for name, label in PANELS]
    sheet = Image.new("RGB", (len(panels) * (WIDTH + 12) - 12, panels[0].height), "white")
    for k, picture in enumerate(panels):
        sheet.paste(picture, (k * (WIDTH + 12), 0))
    (HERE / "images").mkdir(exist_ok=True)
    sheet.save(HERE / "images" / "demo.jpg", quality=86, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
