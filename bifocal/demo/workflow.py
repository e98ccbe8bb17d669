"""The whole workflow on a sample pair: photos, points, workbook, relief map, orthophoto.

The samples lie in folders beside this module. They were rendered by a ray caster
(``tests/scenes/make_sample.py``), so everything about them is known exactly.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bifocal.demo.samples import FACADE, PICK_SIGMA, Sample
from bifocal.files import write_png
from bifocal.model import Pair, RasterReader, ReliefMap, dpi_at_scale
from bifocal.orthophotos import OrthoTask, make_ortho
from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair
from bifocal.remarks import remark
from bifocal.survey import Measuring
from bifocal.workbook import solve, write_result
from photocore.arrays import FloatArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.images import read_image
from photocore.output import atomic_path

#: Every so many pixels of the exact relief are asked what neglecting refraction would cost.
_EVERY = 7


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
        Median error of the relief map [m] and share of it beyond ``limit``, where both photos see.
    map_known : float
        Share of the wall with a measured relief.
    limit : float
        [m]
    neglect : float, optional
        Median error of relief if refraction were neglected, where both photos see. [m]
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
    limit: float
    neglect: float | None = None

    @property
    def rmse(self) -> float:
        """RMS error of the relief of targets that are not uncertain. [m]."""
        used = np.array([flag in ("OK", "ON-PLANE", "WEAK") for flag in self.flags])
        return float(np.sqrt(np.mean((self.found - self.true)[used] ** 2)))


def run_demo(
    folder: Path,
    *,
    sample: Sample = FACADE,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> DemoResult:
    """Survey a sample pair in every way, and compare with the truth.

    Raises
    ------
    InputError
        If the folder cannot be made, or holds results already and ``overwrite`` is false.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}).") from error
    existing = [name for name, _ in sample.files if (folder / name).exists()]
    if existing and not overwrite:
        raise InputError(remark("demo.taken", of=folder, names=", ".join(existing[:3])))
    progress(0.0, 1.0, "surveying targets in the workbook")
    for name in sample.given:
        with atomic_path(folder / name, overwrite=True) as path:
            path.write_bytes((sample.folder / name).read_bytes())
    ids, true, relief, sigma, flags = _survey(folder)
    progress(0.2, 1.0, "measuring dense relief")
    pair_file = folder / "facade.pair.json"
    job = ReliefJob(
        out=folder / "relief.tif", preview=folder / "relief.png", bounds=sample.bounds,
        overwrite=True,
    )  # fmt: skip

    def measured(done: float, total: float, what: str = "") -> None:  # noqa: ARG001
        progress(0.2 + 0.65 * done / total, 1.0, "")

    relief_of_pair(pair_file, job, progress=measured)
    progress(0.85, 1.0, "making the orthophoto")
    task = OrthoTask(relief=folder / "relief.tif", bounds=sample.bounds)
    make_ortho(pair_file, folder / "ortho.tif", task, overwrite=True)
    with RasterReader(folder / "ortho.tif") as file:
        dpi = dpi_at_scale(file.grid.gsd, sample.sheet_scale)
        write_png(folder / "ortho.png", file, dpi=dpi, overwrite=True)
    progress(1.0, 1.0, "done")
    median, share, share_known = _against_truth(ReliefMap.read(folder / "relief.tif"), sample)
    return DemoResult(
        folder=folder, files=sample.files, ids=ids, true=true, found=relief, sigma=sigma,
        flags=flags, map_median=median, map_share=share, map_known=share_known, limit=sample.limit,
        neglect=_cost_of_neglect(Pair.read(pair_file), sample),
    )  # fmt: skip


def _survey(
    folder: Path,
) -> tuple[tuple[str, ...], FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Solve the targets into the workbook; return ids, true and found relief, sigma, flags."""
    with (folder / "targets.csv").open(encoding="utf-8", newline="") as file:
        true = np.array([float(row["r measured [m]"]) for row in csv.DictReader(file)])
    picks = Measuring(sigma_px=PICK_SIGMA)
    solution = solve(folder / "targets.csv", pair=folder / "facade.pair.json", measuring=picks)
    write_result(folder / "result.xlsx", solution, overwrite=True)
    table = solution.table
    return table.ids, true, table["r"], table["sigma_r"], table.flags


def _seen_truth(sample: Sample) -> tuple[FloatArray, FloatArray]:
    """Return places within the bounds that both cameras see, (n, 2), and their relief. [m]"""
    truth = ReliefMap.read(sample.folder / "truth.tif")
    both = read_image(sample.folder / "seen.png") > 0
    places = np.concatenate(
        [truth.plane_positions(slice(k, k + 1)).reshape(-1, 2) for k in range(len(both))]
    )
    west, south, east, north = sample.bounds
    x, y = places.T
    inside = (x > west) & (x < east) & (y > south) & (y < north) & both.ravel()
    return places[inside], truth.r.ravel()[inside]


def _against_truth(relief: ReliefMap, sample: Sample) -> tuple[float, float, float]:
    """Return median error, share beyond the limit and share known, where both cameras see."""
    places, true = _seen_truth(sample)
    measured = relief.sample(places)
    finite = np.isfinite(measured)
    error = np.abs(measured - true)[finite]
    return float(np.median(error)), float((error > sample.limit).mean()), float(finite.mean())


def _cost_of_neglect(pair: Pair, sample: Sample) -> float | None:
    """Return the median error of relief if the pair's media were left out; None in air. [m]"""
    if not pair.refracted:
        return None
    places, true = (values[::_EVERY] for values in _seen_truth(sample))
    points = np.column_stack([places, true]).astype(np.float64)
    off = pair.in_air().intersect(*pair.project(points)).xyz[:, 2] - points[:, 2]
    return float(np.nanmedian(np.abs(off)))
