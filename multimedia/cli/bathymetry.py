"""``multimedia bathymetry``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import print_result, progress_bar
from photocore.options import declared


@declared
def command(source: Path, target: Path, beams: bool, as_json: bool, **wishes: Any) -> None:
    """Correct a DEM or point cloud for the refraction at the water surface.

    IN is a GeoTIFF (.tif), a point cloud (.csv .txt .xyz .ply .las .laz), or with --rays a table
    of measured rays. Points above the water stay as they are; every attribute is kept.
    """
    from multimedia.bathymetry.corrected_points import Precision
    from multimedia.bathymetry.correction_job import Job
    from multimedia.bathymetry.workflow import correct_file

    beams = beams or wishes["trajectory"] is not None
    cameras = wishes["cameras"] is not None
    for name in ("visibility", "max_angle"):
        if wishes[name] and not cameras:
            raise click.UsageError(f"--{name.replace('_', '-')} needs --cameras.")
    if wishes["group_index"] and not beams:
        raise click.UsageError("--group-index needs --beams or --trajectory.")
    if wishes["rays"] and (beams or cameras):
        raise click.UsageError("--rays holds its cameras already; leave the other options out.")
    if beams and cameras:
        raise click.UsageError("--beams and --cameras exclude each other.")
    kinds = ("index", "level", "point")
    precision = Precision(
        **{kind: wishes.pop(f"sigma_{kind}") for kind in kinds},
        direction=0.0 if wishes["rays"] else wishes["sigma_direction"] or 0.0,
        wave=tuple(wishes.pop("sigma_wave") or (0.0, 0.0)),
    )
    if precision != Precision() and (beams or wishes["rays"]):
        raise click.UsageError(
            "--sigma-index, --sigma-level and --sigma-point are not for --beams and --rays."
        )
    if precision.needs_rays and not cameras:
        raise click.UsageError("--sigma-direction and --sigma-wave need --cameras.")
    job = Job(source=source, target=target, beams=beams, precision=precision, **wishes)
    with progress_bar("Refraction correction", quiet=as_json) as progress:
        outcome = correct_file(job, progress=progress)
    data = {
        "file": target, "counts": outcome.counts, "max_depth": outcome.max_depth,
        "mean_change_z": outcome.mean_change, "remarks": outcome.remarks,
    }  # fmt: skip
    counts = ", ".join(f"{count} {name}" for name, count in outcome.counts.items())
    lines = [
        f"{target}: {counts}",
        f"greatest depth {outcome.max_depth:.4g} m, mean change of Z {outcome.mean_change:+.4g} m",
    ]
    print_result(data, lines, as_json=as_json, remarks=outcome.remarks)
