"""``multimedia track``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import click
import numpy as np

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, text_table
from photocore.option_types import POSITIVE
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class TrackCommand:
    r"""The options of ``multimedia track``, and examples.

    multimedia track tank.toml --targets img/cam1. --targets img/cam2. \
      --targets img/cam3. --targets img/cam4. --first 10001 --rate 50 \
      --out tracks.csv
    multimedia track tank.toml --targets img/cam1. --targets img/cam2. \
      --targets img/cam3. --targets img/cam4. --first 10001 \
      --out tracks.h5 --folder res
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
    tolerance: Annotated[float, Typed(POSITIVE, "PX")] = 2.0
    """Farthest a target may lie from where its particle is seen [px]."""
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

    Velocities are slopes of parabolas through five points of a track, with their standard
    deviations; vectors that go with none of those around are marked, not dropped.
    """
    from multimedia.tracking.workflow import find_tracks

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
    print_result(
        data, [text_table(("", ""), rows)], as_json=options.as_json, remarks=result.remarks
    )
