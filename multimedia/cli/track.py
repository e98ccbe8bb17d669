"""``multimedia track``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click
import numpy as np

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, tell_written, text_table
from photocore.option_types import POSITIVE
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from multimedia.tracking import SelfCalibration


@dataclass(frozen=True, kw_only=True)
class TrackCommand:
    r"""The options of ``multimedia track``, and examples.

    multimedia track tank.toml --targets img/cam1. --targets img/cam2. \
      --targets img/cam3. --targets img/cam4. --first 10001 --rate 50 \
      --out tracks.csv
    multimedia track tank.toml --targets img/cam1. --targets img/cam2. \
      --targets img/cam3. --targets img/cam4. --first 10001 \
      --out tracks.h5 --folder res
    multimedia track tank.toml --targets img/cam1. --targets img/cam2. \
      --targets img/cam3. --targets img/cam4. --first 10001 \
      --calibrate tank2.toml --out tracks2.csv
    """

    project: ProjectOption
    targets: tuple[Path, ...]
    """What the _targets files of a camera begin with, up to the number of the frame, or MyPTV's
    file of its blobs; once per camera, in the order of PROJECT."""
    first: Annotated[int | None, Typed(click.IntRange(min=0))] = None
    """First frame.  [default: the first of all cameras]"""
    last: Annotated[int | None, Typed(click.IntRange(min=0))] = None
    """Last frame.  [default: the last of all cameras]"""
    rate: Annotated[float | None, Typed(POSITIVE, "HZ")] = None
    """Frames per second [1/s]; without it velocities are per frame."""
    tolerance: Annotated[float | None, Typed(POSITIVE, "PX")] = None
    """Farthest a target may lie from where its particle is seen [px].  [default: 2, or less where
    that keeps the particles and leaves half as much to chance]"""
    fewest: Annotated[int, Typed(click.IntRange(min=2))] = 3
    """Cameras that must have seen a particle; with 2, many are by chance."""
    step: Annotated[float | None, Typed(POSITIVE)] = None
    """Largest displacement between frames where nothing is known of a velocity [unit of the
    project].  [default: half the mean distance between particles; where that links by chance
    only, about the drift that most share, or more]"""
    change: Annotated[float | None, Typed(POSITIVE)] = None
    """Largest distance from where its velocity predicts a particle [unit of the
    project]; then no particles around predict it.  [default: 3.5 times the median of the links
    around]"""
    gap: Annotated[int, Typed(click.IntRange(min=0))] = 2
    """Frames for which a particle may be missing."""
    shortest: Annotated[int, Typed(click.IntRange(min=3))] = 4
    """Points of the shortest track."""
    calibrate: Path | None = None
    """Adjust the cameras on the particles first, write the project there (.toml), and track
    with it (three cameras or more)."""
    cameras_off: Annotated[float, Typed(POSITIVE, "PX")] = 8.0
    """For --calibrate: how far cameras may be off [px]."""
    out: Path | None = None
    """Write the points of all tracks: .csv, .xlsx, or .h5 (extra hdf)."""
    folder: Path | None = None
    """Write rt_is and ptv_is of every frame there, as OpenPTV does [mm]."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(TrackCommand)
def command(options: TrackCommand) -> None:
    """Follow particles through frames: targets of all cameras of PROJECT in, tracks out.

    In every frame targets belong together where their rays through glass and water meet, as for
    `multimedia particles`; how many come by chance is counted. A particle is then sought where its
    velocity and those around predict it, by what fits best in four frames; one that is new, where
    those around go or within half the mean distance of the particles, and farther where that links
    by chance only. It may be missing in some frames. How many points would be in tracks by chance
    is counted, too.

    Cameras that moved a little since they were calibrated are put right by --calibrate: what all of
    them see within --cameras-off are tie points of a bundle adjustment through the media, again and
    again until they agree (volume self-calibration). The media are kept; place and scale of the
    whole stay as sure as the cameras were.

    Velocities are slopes of parabolas through five points of a track, with their standard
    deviations; vectors that go with none of those around are marked, not dropped.
    """
    from multimedia.tracking import FIGURES, find_tracks

    result = find_tracks(
        options.project,
        options.targets,
        first=options.first,
        last=options.last,
        rate=options.rate,
        tolerance=options.tolerance,
        fewest=options.fewest,
        step=options.step,
        change=options.change,
        gap=options.gap,
        shortest=options.shortest,
        calibrate=options.calibrate,
        cameras_off=options.cameras_off,
        out=options.out,
        folder=options.folder,
        overwrite=options.overwrite,
    )
    tracks, (length, speed_unit) = result.tracks, result.units
    speed = np.linalg.norm(tracks.velocity, axis=1)
    sizes = np.bincount(tracks.track)
    sigma, velocity_sigma = (
        np.median(tracks.sigma, axis=0),
        np.nanmedian(tracks.velocity_sigma, axis=0),
    )
    lost = tracks.particles - len(tracks.track)
    drift = ", ".join(f"{v:.3g}" for v in tracks.drift)
    about = f"of the drift ({drift})" if tracks.drift.any() else "of its place"
    data = {
        "frames": [result.frames[0], result.frames[-1]], "particles": tracks.particles,
        "tracks": tracks.count, "points": len(tracks.track),
        "median_length": float(np.median(sizes)), "sigma_px": result.sigma_px,
        "step": tracks.step, "change": tracks.change, "drift": tracks.drift.tolist(),
        "unit": length,
        "median_speed": float(np.nanmedian(speed)), "speed_unit": speed_unit,
        "median_sigma": sigma.tolist(), "median_velocity_sigma": velocity_sigma.tolist(),
        "differ": int(tracks.outlier.sum()), "particles_tested": result.found,
        "by_chance_at_most": result.chance, "in_no_track": lost,
        "in_tracks_by_chance": tracks.by_chance, "out": options.out, "folder": options.folder,
    }  # fmt: skip
    rows = [
        ("frames", f"{result.frames[0]} to {result.frames[-1]}"),
        ("particles", f"{tracks.particles}; in some frames {result.found:.0f}, by chance at most "
                      f"{result.chance:.0f}"),
        ("tracks", f"{tracks.count} of {len(tracks.track)} points, {np.median(sizes):.0f} the "
                   f"median, {sizes.max()} the longest"),
        ("in no track", f"{lost} particles, {lost / tracks.particles:.0%}; by chance in tracks "
                        f"{tracks.by_chance}"),
        (f"sought within [{length}]", f"{tracks.change:.3g} of the prediction, {tracks.step:.3g} "
                                      f"{about} where there is none"),
        ("image coordinates [px]", f"sigma {result.sigma_px:.2g}"),
        (f"positions [{length}]", "sigma " + ", ".join(f"{v:.2g}" for v in sigma)),
        (f"speed [{speed_unit}]", f"median {np.nanmedian(speed):.4g}, sigma "
                                  + ", ".join(f"{v:.2g}" for v in velocity_sigma)),
        ("differ from those around", f"{int(tracks.outlier.sum())} vectors"),
    ]  # fmt: skip
    lines = [text_table(("", ""), rows)]
    if result.calibration is not None:
        data["calibration"] = {
            "project": options.calibrate,
            **{name: getattr(result.calibration, name) for name in FIGURES},
        }
        lines = [_moved(result.calibration, length), *lines]
    print_result(data, lines, as_json=options.as_json, remarks=result.remarks)
    tell_written(options.calibrate)


def _moved(calibration: SelfCalibration, unit: str) -> str:
    """Return how cameras fitted the particles before and after, and how far they moved."""
    columns = (calibration.before, calibration.after, calibration.moved, calibration.sigma)
    rows = [
        (name, f"{before:.2f}", f"{after:.2f}", f"{moved:.3g}", f"{sigma:.2g}")
        for name, before, after, moved, sigma in zip(
            calibration.project.camera_names, *columns, strict=True
        )
    ]
    heads = ("camera", "disparity before [px]", "after", f"moved [{unit}]", "sigma")
    return f"{calibration.particles} particles adjusted\n{text_table(heads, rows)}\n"
