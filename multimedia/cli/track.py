"""``multimedia track``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from photocore.cli import print_result, text_table
from photocore.options import declared


@declared
def command(project: Path, targets: tuple[Path, ...], as_json: bool, **options: Any) -> None:
    """Follow particles through frames: targets of all cameras of PROJECT in, tracks out.

    In every frame targets belong together where their rays through glass and water meet, as for
    `multimedia particles`; how many come by chance is counted. A particle is then sought where its
    velocity predicts it, by what fits best in four frames; one that is new, within half the mean
    distance of the particles, and farther where that links by chance only. It may be missing in
    some frames. How many points would be in tracks by chance is counted, too.

    Velocities are slopes of parabolas through five points of a track, with their standard
    deviations; vectors that differ from those around (normalised median test) are marked, not
    dropped.
    """
    from multimedia.tracking.workflow import find_tracks

    found = find_tracks(project, targets, **options)
    tracks, (length, speed_unit) = found.tracks, found.units
    speed = np.linalg.norm(tracks.velocity, axis=1)
    sizes = np.bincount(tracks.track)
    sigma, own = np.median(tracks.sigma, axis=0), np.nanmedian(tracks.velocity_sigma, axis=0)
    lost = tracks.particles - len(tracks.track)
    data = {
        "frames": [found.frames[0], found.frames[-1]], "particles": tracks.particles,
        "tracks": tracks.count, "points": len(tracks.track),
        "median_length": float(np.median(sizes)), "sigma_px": found.sigma_px,
        "step": tracks.step, "change": tracks.change, "unit": length,
        "median_speed": float(np.nanmedian(speed)), "speed_unit": speed_unit,
        "median_sigma": sigma.tolist(), "median_velocity_sigma": own.tolist(),
        "differ": int(tracks.outlier.sum()), "particles_tested": found.found,
        "by_chance_at_most": found.chance, "in_no_track": lost,
        "in_tracks_by_chance": tracks.by_chance, "out": options["out"], "folder": options["folder"],
    }  # fmt: skip
    rows = [
        ("frames", f"{found.frames[0]} to {found.frames[-1]}"),
        ("particles", f"{tracks.particles}; in some frames {found.found:.0f}, by chance at most "
                      f"{found.chance:.0f}"),
        ("tracks", f"{tracks.count} of {len(tracks.track)} points, {np.median(sizes):.0f} the "
                   f"median, {sizes.max()} the longest"),
        ("in no track", f"{lost} particles, {lost / tracks.particles:.0%}; by chance in tracks "
                        f"{tracks.by_chance}"),
        (f"sought within [{length}]", f"{tracks.change:.3g} of the prediction, {tracks.step:.3g} "
                                      "where there is none"),
        ("image coordinates [px]", f"sigma {found.sigma_px:.2g}"),
        (f"positions [{length}]", "sigma " + ", ".join(f"{v:.2g}" for v in sigma)),
        (f"speed [{speed_unit}]", f"median {np.nanmedian(speed):.4g}, sigma "
                                  + ", ".join(f"{v:.2g}" for v in own)),
        ("differ from those around", f"{int(tracks.outlier.sum())} vectors"),
    ]  # fmt: skip
    print_result(data, [text_table(("", ""), rows)], as_json=as_json, remarks=tracks.remarks)
