"""The whole workflow on the sample pair: photos, points, workbook, relief map, orthophoto.

The sample lies in the folder ``sample`` beside this module. It was rendered by a ray caster
(``tests/scenes/make_sample.py``), so everything about it is known exactly.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bifocal.demo import SAMPLE
from bifocal.files.geotiff import RasterReader, dpi_at_scale, read_relief
from bifocal.files.images import read_image
from bifocal.files.strips import write_png
from bifocal.model.relief_map import ReliefMap
from bifocal.orthophotos.ortho_workflow import OrthoTask, make_ortho
from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair
from bifocal.survey.output import write_result
from bifocal.survey.workflow import solve
from photocore.arrays import FloatArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import atomic_path

#: Precision of the sample's picks, those of a careful hand. [px]
PICK_SIGMA = 0.2
#: The part of the wall that both photos show whole, up to the top of the cornice. [m]
BOUNDS = (-5.3, -3.45, 5.3, 3.42)
#: Scale 1:N at which the picture of the orthophoto prints.
SHEET_SCALE = 50.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DemoResult:
    """What was found, against the truth.

    Attributes
    ----------
    folder : Path
        Where the results lie.
    files : tuple of (file name, what it is)
    ids : tuple of str
        Targets that were surveyed.
    true, found, sigma : ndarray, shape (n,)
        Relief of the targets and its expected precision. [m]
    flags : tuple of str
    map_median, map_share : float
        Median error of the relief map [m] and share of it beyond 3 cm, where both photos see.
    map_known : float
        Share of the wall with a measured relief.
    """

    folder: Path
    files: tuple[tuple[str, str], ...]
    ids: tuple[str, ...]
    true: FloatArray
    found: FloatArray
    sigma: FloatArray
    flags: tuple[str, ...]
    map_median: float
    map_share: float
    map_known: float

    @property
    def rmse(self) -> float:
        """RMS error of the relief of targets that are not uncertain. [m]."""
        used = np.array([flag in ("OK", "ON-PLANE", "WEAK") for flag in self.flags])
        return float(np.sqrt(np.mean((self.found - self.true)[used] ** 2)))


def run_demo(
    folder: Path, *, overwrite: bool = False, progress: Progress = no_progress
) -> DemoResult:
    """Survey the sample pair in every way, and compare with the truth.

    Raises
    ------
    InputError
        If the folder cannot be made, or holds results already and ``overwrite`` is false.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}).") from error
    taken = [name for name, _ in _FILES if (folder / name).exists()]
    if taken and not overwrite:
        raise InputError(
            f"{folder}: holds {', '.join(taken[:3])} ... already; add --overwrite, or name another "
            "folder with --out."
        )
    progress(0.0, 1.0, "surveying targets in the workbook")
    for name in _GIVEN:
        with atomic_path(folder / name, overwrite=True) as path:
            path.write_bytes((SAMPLE / name).read_bytes())
    ids, true, relief, sigma, flags = _survey(folder)
    progress(0.2, 1.0, "measuring dense relief")
    job = ReliefJob(
        out=folder / "relief.tif", preview=folder / "relief.png", bounds=BOUNDS, overwrite=True
    )
    relief_of_pair(folder / "facade.pair.json", job)
    progress(0.85, 1.0, "making the orthophoto")
    make_ortho(
        folder / "facade.pair.json", folder / "ortho.tif",
        OrthoTask(relief=folder / "relief.tif", bounds=BOUNDS), overwrite=True,
    )  # fmt: skip
    with RasterReader(folder / "ortho.tif") as file:
        dpi = dpi_at_scale(file.grid.gsd, SHEET_SCALE)
        write_png(folder / "ortho.png", file, dpi=dpi, overwrite=True)
    progress(1.0, 1.0, "done")
    median, share, known = _against_truth(read_relief(folder / "relief.tif"))
    return DemoResult(
        folder=folder, files=_FILES, ids=ids, true=true, found=relief, sigma=sigma, flags=flags,
        map_median=median, map_share=share, map_known=known,
    )  # fmt: skip


_FILES: tuple[tuple[str, str], ...] = (
    ("far.jpg", "far photo, 35 mm from 17.5 m"),
    ("near.jpg", "near photo, 19 mm from 9.5 m"),
    ("facade.pair.json", "the pair: homographies, nadirs, distances"),
    ("targets.csv", "picked targets in pixels, and their true relief to check"),
    ("result.xlsx", "solved workbook, live formulas: relief, coordinates, precision, check"),
    ("relief.tif", "relief map: relief, sigma, quality"),
    ("relief.png", "the same as a picture"),
    ("ortho.tif", "orthophoto to scale"),
    ("ortho.png", "the same as a picture"),
    ("truth.tif", "the exact relief, to compare"),
)
_GIVEN = ("far.jpg", "near.jpg", "facade.pair.json", "targets.csv", "truth.tif")


def _survey(
    folder: Path,
) -> tuple[tuple[str, ...], FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Solve the targets into the workbook; return ids, true and found relief, sigma, flags."""
    with (folder / "targets.csv").open(encoding="utf-8", newline="") as file:
        true = np.array([float(row["r measured [m]"]) for row in csv.DictReader(file)])
    solution = solve(folder / "targets.csv", pair=folder / "facade.pair.json", sigma_px=PICK_SIGMA)
    write_result(folder / "result.xlsx", solution, overwrite=True)
    table = solution.table
    return table.ids, true, table["r"], table["sigma_r"], table.flags


def _against_truth(relief: ReliefMap) -> tuple[float, float, float]:
    """Return median error, share beyond 3 cm and share known, where both cameras see the wall."""
    truth = read_relief(SAMPLE / "truth.tif")
    both = read_image(SAMPLE / "seen.png") > 0
    places = np.concatenate(
        [truth.plane_positions(slice(k, k + 1)).reshape(-1, 2) for k in range(len(both))]
    )
    west, south, east, north = BOUNDS
    x, y = places.T
    inside = (x > west) & (x < east) & (y > south) & (y < north)
    both &= inside.reshape(both.shape)
    measured = relief.sample(places).reshape(both.shape)
    known = both & np.isfinite(measured)
    error = np.abs(measured - truth.r)[known]
    share = float(known.sum() / both.sum())
    return float(np.median(error)), float((error > 0.03).mean()), share
