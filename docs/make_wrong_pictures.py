"""Write the picture of docs/what-goes-wrong.md: `python docs/make_wrong_pictures.py`.

The sample pair, whose truth is known, looked at with what goes wrong put in on purpose.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from bifocal import Pair
from bifocal.demo import SAMPLE
from bifocal.files.geotiff import read_relief

HERE = Path(__file__).parent
#: Every so many pixels of the truth, noise of a pick [px], and what is put in: degrees, a share.
STEP, NOISE, TILT, LARGER = 4, 0.5, 0.3, 1.01


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
    far, near = (np.asarray(Image.open(SAMPLE / f"{n}.jpg").convert("L")) for n in ("far", "near"))
    turn = cv2.getRotationMatrix2D((near.shape[1] / 2, near.shape[0] / 2), 0.5, 1.0)
    near = cv2.warpAffine(near, turn, near.shape[::-1])
    carry = np.linalg.inv(pair.image1.plane_from_pixel) @ pair.image2.plane_from_pixel
    near = cv2.warpPerspective(near, carry, far.shape[::-1])
    return np.dstack([far, near, near])[150:850, 500:1500]


def main() -> None:
    """Write docs/images/what-goes-wrong.jpg."""
    pair = Pair.read(SAMPLE / "facade.pair.json")
    truth = read_relief(SAMPLE / "truth.tif")
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
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    picture.save(HERE / "images" / "what-goes-wrong.jpg", quality=84, optimize=True)


if __name__ == "__main__":
    main()
