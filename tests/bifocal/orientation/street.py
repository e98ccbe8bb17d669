"""Overlapping pairs of one rendered façade, with control and check tables; truth is the scene's."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from tests.scenes import NamedPoint, SetupErrors, bifocal_cameras, demo_scene, render

#: Targets that hold the frame: near the ends of the wall, high and low.
CONTROL = frozenset({"T01", "T04", "T07", "T10", "T13", "T16", "T19", "T31"})
HEADINGS = ("id", "X [m]", "Y [m]", "r [m]", "col1", "row1", "col2", "row2")


def write_street(folder: Path, middles: tuple[float, ...] = (-2.4, 0.0, 2.4)) -> list[Path]:
    """Write photos, nominal pair files, ``NAME_control.csv`` and ``NAME_check.csv`` of each pair.

    The cameras stand a little off and a little turned; the pair files say where they should have
    stood, each in its own frame with its nadir as origin.
    """
    rng = np.random.default_rng(7)
    paths = []
    for number, middle in enumerate(middles):
        name = "abcdefgh"[number]
        cameras = bifocal_cameras(
            size=(720, 600), pixel=0.0085, nadir=(middle, 0.0), rng=rng,
            errors=SetupErrors(principal_point=0.0, focal=0.0),
        )  # fmt: skip
        shot = render(demo_scene(), cameras, rng=rng, gsd=0.1)
        pair = shot.nominal
        for side, image in (("far", shot.image1), ("near", shot.image2)):
            Image.fromarray(image).save(folder / f"{name}_{side}.png")
        shift = np.array([[1.0, 0, -middle], [0, 1, 0], [0, 0, 1]])
        photos = [
            replace(photo, file=f"{name}_{side}.png", nadir=photo.nadir - [middle, 0.0],
                    plane_from_pixel=shift @ photo.plane_from_pixel)
            for photo, side in ((pair.image1, "far"), (pair.image2, "near"))
        ]  # fmt: skip
        path = folder / f"{name}.pair.json"
        replace(pair, image1=photos[0], image2=photos[1]).write(path)
        seen = [target for target in shot.targets if target.seen]
        for role in ("control", "check"):
            chosen = [t for t in seen if (t.name in CONTROL) == (role == "control")]
            write_table(folder / f"{name}_{role}.csv", chosen, rng)
        paths.append(path)
    return paths


def write_table(path: Path, targets: list[NamedPoint], rng: np.random.Generator) -> None:
    """Write a table of points: exact places, pixels as picked."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(HEADINGS)
        for t in targets:
            picks = np.r_[t.pixel1, t.pixel2] + rng.normal(0, 0.15, 4)
            writer.writerow([t.name, *(f"{v:.4f}" for v in t.xyz), *(f"{v:.3f}" for v in picks)])
