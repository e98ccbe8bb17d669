"""The demo's sample pair with tables of control and check points; truth is its scene's."""

from __future__ import annotations

import csv
from pathlib import Path

from bifocal.demo import SAMPLE
from tests.scenes import demo_scene

FAR, NEAR = SAMPLE / "far.jpg", SAMPLE / "near.jpg"
CONTROL = frozenset(
    ["T01", "T04", "T05", "T07", "T10", "T13", "T16", "T19", "T20", "T23", "T31", "T32"]
)
_HEADINGS = ["id", "X [m]", "Y [m]", "r [m]", "col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]"]


def write_tables(folder: Path) -> tuple[Path, Path]:
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
                    writer.writerow([pick["id"], *place, *(pick[name] for name in _HEADINGS[4:])])
    return paths
