"""The samples of `bifocal demo`: what lies where, and how what is found compares with the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bifocal.demo import SAMPLE, WATER_SAMPLE
from bifocal.model import Bounds

#: Precision of the samples' picks, those of a careful hand. [px]
PICK_SIGMA = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A rendered pair with exact truth.

    Attributes
    ----------
    folder : Path
        Where far.jpg, near.jpg, the pair file, targets.csv, truth.tif and seen.png lie.
    bounds : tuple of float
        The part of the wall that both photos show whole: xmin, ymin, xmax, ymax. [m]
    sheet_scale : float
        Scale 1:N at which the picture of the orthophoto prints.
    limit : float
        Errors of the relief map beyond this are counted. [m]
    far, near : str
        What the photos are.
    """

    folder: Path
    bounds: Bounds
    sheet_scale: float
    limit: float
    far: str
    near: str

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """Files that the demo leaves, and what they are."""
        return (
            ("far.jpg", f"far photo, {self.far}"),
            ("near.jpg", f"near photo, {self.near}"),
            ("facade.pair.json", "the pair: homographies, nadirs, distances"),
            ("targets.csv", "picked targets in pixels, and their true relief to check"),
            (
                "result.xlsx",
                "solved workbook, live formulas: relief, coordinates, precision, check",
            ),
            ("relief.tif", "relief map: relief, sigma, quality"),
            ("relief.png", "the same as a picture"),
            ("ortho.tif", "orthophoto to scale"),
            ("ortho.png", "the same as a picture"),
            ("truth.tif", "the exact relief, to compare"),
        )

    @property
    def given(self) -> tuple[str, ...]:
        """Files that are copied from the sample."""
        return ("far.jpg", "near.jpg", "facade.pair.json", "targets.csv", "truth.tif")


#: The façade in air, up to the top of its cornice.
FACADE = Sample(
    folder=SAMPLE, bounds=(-5.3, -3.45, 5.3, 3.42), sheet_scale=50.0, limit=0.03,
    far="35 mm from 17.5 m", near="19 mm from 9.5 m",
)  # fmt: skip
#: Under water, below its cornice, which the near photo cuts off.
WATER = Sample(
    folder=WATER_SAMPLE, bounds=(-0.86, -0.62, 0.86, 0.56), sheet_scale=10.0, limit=0.01,
    far="from 3.5 m through a flat port", near="from 1.9 m through a flat port",
)  # fmt: skip
