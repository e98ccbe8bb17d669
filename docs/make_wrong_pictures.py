"""Write the pictures of docs/what-goes-wrong.md: `python docs/make_wrong_pictures.py [FOLDER]`.

The sample pair, whose truth is known, looked at with what goes wrong put in on purpose.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from bifocal import Pair, Photo, ReliefMap, dense_relief
from bifocal.demo import SAMPLE

HERE = Path(__file__).parent
#: Every so many pixels of the truth, noise of a pick [px], and what is put in: degrees, a share.
STEP, NOISE, TILT, LARGER = 4, 0.5, 0.3, 1.01
#: The glass of the lower right window: rows, columns of the truth, and its relief at most. [m]
GLASS = (slice(528, 749), slice(1111, 1280), -0.25)
#: Where the mirror image of the street stands [m], from where on the wall it is copied [px].
MIRRORED, COPIED = -2.5, (-700, -300)
#: From one lower window to the other [px of the far photo]; a wrong pick [px]; a wrong scale.
APART, MISPICKED, TOO_LARGE = 854, 12.0, 1.02


def grey(name: str) -> np.ndarray:
    """Return a photo of the sample in grey values."""
    return np.asarray(Image.open(SAMPLE / name).convert("L"))


def relief_with(pair: Pair, seen: Pair, xyz: np.ndarray, noise: float = 0.0) -> np.ndarray:
    """Return the relief that a pair finds for points that another saw."""
    rng = np.random.default_rng(1)
    pixels = [p + rng.normal(0, noise, p.shape) for p in seen.project(xyz.reshape(-1, 3))]
    return pair.intersect(*pixels).xyz[:, 2].reshape(xyz.shape[:2])


def tilted(pair: Pair) -> Pair:
    """Return the pair as if its far camera were turned a little about the vertical."""
    photo = pair.image1
    slope = np.tan(np.radians(TILT)) / photo.distance
    bent = np.array([[1, 0, 0], [0, 1, 0], [slope, 0, 1]]) @ photo.plane_from_pixel
    return replace(pair, image1=replace(photo, plane_from_pixel=bent))


def larger(pair: Pair) -> Pair:
    """Return the pair with the far photo taken for larger on the wall than it is."""
    photo = pair.image1
    grown = np.diag([LARGER, LARGER, 1.0]) @ photo.plane_from_pixel
    return replace(pair, image1=replace(photo, plane_from_pixel=grown))


def overlay(pair: Pair) -> np.ndarray:
    """Return both photos on the wall, the near one turned by half a degree, as red and cyan."""
    far, near = grey("far.jpg"), grey("near.jpg")
    turn = cv2.getRotationMatrix2D((near.shape[1] / 2, near.shape[0] / 2), 0.5, 1.0)
    near = cv2.warpAffine(near, turn, near.shape[::-1])
    carry = np.linalg.inv(pair.image1.plane_from_pixel) @ pair.image2.plane_from_pixel
    near = cv2.warpPerspective(near, carry, far.shape[::-1])
    return np.dstack([far, near, near])[150:850, 500:1500]


def mirroring(photo: Photo, name: str, truth: ReliefMap) -> np.ndarray:
    """Return a photo whose window shows what stands across the street, in front of the wall."""
    image = np.asarray(Image.open(SAMPLE / name).convert("RGB")).copy()
    rows, columns = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    seen = np.dstack([columns, rows, np.ones_like(rows)]) @ photo.plane_from_pixel.T
    seen = seen[..., :2] / seen[..., 2:]
    pixel_from_plane = np.linalg.inv(truth.plane_from_pixel)

    def at(relief: float) -> np.ndarray:
        # Where the ray meets the plane of that relief, as (column, row) of the truth.
        place = photo.nadir + (seen - photo.nadir) * (photo.distance - relief) / photo.distance
        return (place @ pixel_from_plane[:2, :2].T + pixel_from_plane[:2, 2]).astype(np.float32)

    glass = np.zeros(truth.shape, np.float32)
    window, least = GLASS[:2], GLASS[2]
    glass[window] = truth.r[window] < least
    share = 0.8 * cv2.remap(glass, *cv2.split(at(float(truth.r[window].min()))), cv2.INTER_LINEAR)
    street = np.asarray(Image.open(SAMPLE / "far.jpg").convert("RGB"))
    shown = cv2.remap(street, *cv2.split(at(MIRRORED) + np.float32(COPIED)), cv2.INTER_LINEAR)
    return (image * (1 - share[..., None]) + shown * share[..., None]).astype(np.uint8)


def draw_mirror(axes: Axes, pair: Pair, truth: ReliefMap) -> None:
    """Draw what the program measures through a window that mirrors the street."""
    far = mirroring(pair.image1, "far.jpg", truth)
    near = mirroring(pair.image2, "near.jpg", truth)
    relief = dense_relief(pair, far, near, gsd=0.015, bounds=(0.9, -2.4, 5.2, 0.6))
    image = axes.imshow(relief.r, cmap="RdBu_r", vmin=-3, vmax=3)
    bar = axes.figure.colorbar(image, ax=axes, fraction=0.035, pad=0.02)
    bar.set_label("relief [m]", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    axes.set_title("glass mirrors the street: metres deep", fontsize=9)


def draw_repeated(axes: Axes) -> None:
    """Draw a photo on itself, one window apart: what pairs of a street joined wrongly show."""
    photo = grey("far.jpg")
    here, there = photo[430:830, APART : APART + 600], photo[430:830, :600]
    axes.imshow(np.dstack([here, there, there]))
    axes.set_title("joined a window apart: the window fits, nothing else", fontsize=9)


def draw_check_point(axes: Axes, pair: Pair) -> None:
    """Draw how far points lie from where they are, one of them picked beside itself."""
    with (SAMPLE / "targets.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    picks = np.array([[float(v) for v in row[1:5]] for row in rows])
    names = [row[0] for row in rows]
    true = pair.intersect(picks[:, :2], picks[:, 2:]).xyz
    wrong = names.index("T18")
    picks[wrong, [0, 2]] += MISPICKED
    moved = pair.intersect(picks[:, :2], picks[:, 2:]).xyz - true
    rng = np.random.default_rng(2)
    shift = moved[:, :2] + rng.normal(0, 0.004, (len(rows), 2))
    axes.imshow(grey("far.jpg"), cmap="gray", alpha=0.5)
    axes.quiver(
        picks[:, 0],
        picks[:, 1],
        shift[:, 0],
        shift[:, 1],
        angles="xy",
        scale=0.6,
        color=["C3" if k == wrong else "C0" for k in range(len(rows))],
        width=0.006,
    )
    axes.annotate(
        f"{names[wrong]}: {1000 * np.hypot(*shift[wrong]):.0f} mm",
        picks[wrong, :2],
        xytext=(4, 10),
        textcoords="offset points",
        color="C3",
        ha="left",
        fontsize=9,
    )
    axes.set_title("a check point far off, alone: its pixel is wrong", fontsize=9)


def draw_too_large(axes: Axes) -> None:
    """Draw a grid of metres as a focal length 2 % too short makes it."""
    photo = grey("far.jpg")
    height, width = photo.shape
    axes.imshow(photo, cmap="gray", alpha=0.5)
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    half = np.array([600.0, 380.0])
    for size, colour, style in ((1.0, "C0", "-"), (TOO_LARGE, "C3", "--")):
        low, high = middle - half * size, middle + half * size
        axes.plot([low[0], high[0], high[0], low[0], low[0]],
                  [low[1], low[1], high[1], high[1], low[1]], style, color=colour)  # fmt: skip
    axes.text(
        *middle,
        f"blue: true size\nred: {100 * (TOO_LARGE - 1):.0f} % too large",
        ha="center",
        color="black",
        fontsize=9,
        bbox={"fc": "white", "ec": "none"},
    )
    axes.set_title("nominal focal length: all lengths alike too large", fontsize=9)


def draw_one_by_one(pair: Pair, truth: ReliefMap) -> Figure:
    """Return the picture of the faults that are not in the relief map as a whole."""
    figure = Figure(figsize=(10, 7), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes in (panels := figure.subplots(2, 2)).flat:
        axes.set_axis_off()
    draw_mirror(panels[0, 0], pair, truth)
    draw_repeated(panels[0, 1])
    draw_check_point(panels[1, 0], pair)
    draw_too_large(panels[1, 1])
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure as JPEG."""
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    picture.save(path, quality=84, optimize=True)


def draw_relief(pair: Pair, truth: ReliefMap) -> Figure:
    """Return the picture of what orientation, noise and hidden parts do to a relief map."""
    rows, columns = np.mgrid[0 : truth.shape[0] : STEP, 0 : truth.shape[1] : STEP]
    matrix = truth.plane_from_pixel
    x, y = (matrix[k, 0] * columns + matrix[k, 1] * rows + matrix[k, 2] for k in (0, 1))
    xyz = np.dstack([x, y, truth.r[rows, columns]])
    panels = [
        ("as it is", xyz[..., 2]),
        (f"far camera turned by {TILT}° unnoticed", relief_with(tilted(pair), pair, xyz)),
        ("scale of the far photo wrong by 1 %", relief_with(larger(pair), pair, xyz)),
        ("picks of 0.5 px: noise about the nadir", relief_with(pair, pair, xyz, NOISE)),
    ]
    figure = Figure(figsize=(10, 5.6), dpi=110)
    FigureCanvasAgg(figure)
    for k, (title, relief) in enumerate(panels):
        axes = figure.add_axes((0.01 + 0.335 * (k % 3), 0.57 - 0.53 * (k // 3), 0.32, 0.38))
        image = axes.imshow(relief, cmap="RdBu_r", vmin=-0.6, vmax=0.6)
        axes.set_title(title, fontsize=9)
        axes.set_axis_off()
    axes = figure.add_axes((0.345, 0.04, 0.32, 0.38))
    axes.imshow(overlay(pair))
    axes.set_title("overlay of both photos: one is turned", fontsize=9)
    axes.set_axis_off()
    axes = figure.add_axes((0.68, 0.04, 0.32, 0.38))
    seen = np.asarray(Image.open(SAMPLE / "seen.png").convert("L"))
    axes.imshow(np.where(seen > 0, 235, 0), cmap="gray", vmin=0, vmax=255)
    axes.set_title("black: not seen by both cameras", fontsize=9)
    axes.set_axis_off()
    bar = figure.colorbar(image, cax=figure.add_axes((0.06, 0.525, 0.22, 0.015)),
                          orientation="horizontal", extend="both")  # fmt: skip
    bar.set_label("relief [m]", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    return figure


def main(folder: Path) -> None:
    """Write both pictures into a folder."""
    pair = Pair.read(SAMPLE / "facade.pair.json")
    truth = ReliefMap.read(SAMPLE / "truth.tif")
    save(draw_relief(pair, truth), folder / "what-goes-wrong.jpg")
    save(draw_one_by_one(pair, truth), folder / "what-goes-wrong-one-by-one.jpg")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "images")
