"""The scripts under examples/ run, and print the numbers they should."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.equipment import place

EXAMPLES = Path(__file__).parents[1] / "examples"

#: Script -> pattern of its output, and the range of each number found by it.
PRINTED = {
    "relief_by_hand": (
        r"r  = (\S+) m, by hand (\S+) m\n.* is at (\S+) mm",
        # Drawn: relief 1 m, 2 m from the nadir at 1:500.
        [(0.9999, 1.0001), (0.9999, 1.0001), (3.9999, 4.0001)],
    ),
    "survey_from_csv": (r"(\d+) of 28 points, RMS error of r (\S+) mm", [(26, 28), (0.0, 20.0)]),
    "relief_and_orthophoto": (
        r"(\d+)% of the wall measured, median error of r (\S+) mm\n.* (\S+) mm, (\d+)% filled",
        [(80, 100), (0.0, 20.0), (15, 15), (95, 100)],
    ),
    "radial_shift": (
        r"index of water (\S+)\nradius .* arrives at (\S+) m",
        # 1.33575 is printed in Maas 2015; the ray must arrive where the point is.
        [(1.33574, 1.33576), (0.0999995, 0.1000005)],
    ),
    "camera_through_water": (
        r"RMS error X, Y, Z (\S+), (\S+), (\S+) um\nexpected +(\S+), (\S+), (\S+) um",
        [(4, 7), (4, 7), (11, 20), (4, 7), (4, 7), (11, 20)],
    ),
    "pair_through_water": (
        r"RMS error X, Y, r (\S+), (\S+), (\S+) mm\nexpected +(\S+), (\S+), (\S+) mm\n.* (\S+) mm",
        [(0.5, 1.5), (0.3, 1.2), (2.0, 5.0), (0.5, 1.5), (0.3, 1.2), (2.0, 5.0), (150, 400)],
    ),
    "pair_from_geometry": (r"points\.csv \((\d+) points\)", [(1866, 1866)]),
}


def test_every_script_is_run() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(PRINTED)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.data) if name == "pair_from_geometry" else name
     for name in PRINTED],
)  # fmt: skip
def test_a_script_prints_what_it_should(name: str, tmp_path: Path) -> None:
    words = []
    if name == "pair_from_geometry":
        words = [str(Path(place("data")) / "facade_pairs" / "church_1"), "church_1"]
    script = EXAMPLES / f"{name}.py"
    done = subprocess.run(
        [sys.executable, str(script), *words], capture_output=True, text=True, cwd=tmp_path,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    pattern, ranges = PRINTED[name]
    printed = re.search(pattern, done.stdout)
    assert printed, done.stdout
    for text, (low, high) in zip(printed.groups(), ranges, strict=True):
        assert low <= float(text) <= high, done.stdout
