"""``multimedia bathymetry``."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Any

import click

from photocore.cli import print_result, progress_bar
from photocore.options import FILE, NEW_TABLE, TABLE, Number, as_json, cog, number, overwrite, sigma

EXAMPLE = """\b
Examples:
  a DEM, seen from about straight above:
    multimedia bathymetry dem.tif --water-level 1.8075 --index 1.33575 --out bed.tif
  a point cloud, rigorously, with the cameras (id,X,Y,Z) that saw it within 40 degrees:
    multimedia bathymetry cloud.las --water-level 102.4 --index 1.337 \\
        --cameras cameras.csv --max-angle 40 --out bed.las
  with the precision that follows from index and level:
    multimedia bathymetry cloud.csv --water-level water.json --index 1.337 \\
        --sigma-index 0.001 --sigma-level 0.01 --out bed.csv
  the same under a swell of 5 cm, 4 m long, that runs to the north-east:
    multimedia bathymetry cloud.las --water-level 102.4 --wave 0.05,4,45 --index 1.337 \\
        --cameras cameras.csv --max-angle 40 --out waves.las
  lidar echoes with the positions of the sensor:
    multimedia bathymetry echoes.las --water-level 102.4 --index 1.337 --group-index 1.36 \\
        --beams --trajectory flight.csv --out bed.las
  measured rays (id,X0,Y0,Z0,DX,DY,DZ, one row per ray):
    multimedia bathymetry rays.csv --rays --water-level 0 --index 1.337 --out points.csv
"""


@click.command(epilog=EXAMPLE)
@click.argument("source", metavar="IN", type=TABLE)
@click.option(
    "--water-level", required=True, metavar="Z|FILE",
    help="Height of the water [m]; or its surface as a .tif or .asc raster, a .ply or .obj "
    "triangle mesh or the .json of `multimedia waterlevel`.",
)  # fmt: skip
@click.option(
    "--wave", "waves", multiple=True, metavar="A,L[,DIR[,PHASE]]",
    help="A wave upon the height: amplitude and length [m], direction of travel clockwise from +Y "
    "and phase at X = Y = 0 [deg]; repeat it. [default: none, flat water]",
)  # fmt: skip
@number(
    "--index", "N", "Refractive index of the water relative to the air [-], about 1.33 to 1.35.",
    required=True,
)  # fmt: skip
@click.option(
    "--out",
    "target",
    required=True,
    type=NEW_TABLE,
    help="Corrected file, same kind as IN; - is a .csv on stdout.",
)
@click.option(
    "--cameras", type=FILE, metavar="FILE",
    help="Table id,X,Y,Z of projection centres [m], or a project .toml: rigorous correction of X, "
    "Y and Z. [default: none, every point as if seen from straight above]",
)  # fmt: skip
@click.option(
    "--visibility", type=FILE, metavar="FILE",
    help="Table point,camera: which camera saw which point (the cloud needs a column id; a column "
    "'cameras' with their names does the same). [default: none, all cameras]",
)  # fmt: skip
@click.option(
    "--max-angle", type=Number(above=0, most=89.9, to=radians), metavar="DEG",
    help="A camera sees only points within this angle from its vertical [deg]. [default: any]",
)  # fmt: skip
@sigma("--sigma-index", "N", "Standard deviation of the index [-].")
@sigma("--sigma-level", "M", "Standard deviation of the water level [m].")
@sigma(
    "--sigma-point", "M",
    "Standard deviation of the coordinates in IN [m]. Any sigma adds sigma columns or a "
    "second band.",
)  # fmt: skip
@click.option("--beams", is_flag=True, help="IN holds lidar echoes with columns X0, Y0, Z0. [off]")
@click.option(
    "--trajectory", type=FILE, metavar="FILE",
    help="Table time,X,Y,Z of the lidar sensor [s, m], for echoes with gps_time; implies --beams. "
    "[default: none]",
)  # fmt: skip
@number("--group-index", "N", "Index that slows the laser pulse [-]. [default: as --index]")
@click.option("--rays", is_flag=True, help="IN is a table of measured rays. [off]")
@click.option(
    "--sigma-direction", type=Number(above=0, to=radians), default=0.0057, show_default=True,
    help="Standard deviation of a measured ray [deg].",
)  # fmt: skip
@click.option(
    "--nodata", type=Number(finite=False), metavar="VALUE",
    help="Height that marks empty cells of a DEM [m]. [default: as the file says]",
)  # fmt: skip
@click.option("--allow-dry", is_flag=True, help="Accept data without a point under water. [off]")
@cog
@overwrite
@as_json
def command(
    source: Path, target: Path, beams: bool, sigma_index: float, sigma_level: float,
    sigma_point: float, as_json: bool, **wishes: Any,
) -> None:  # fmt: skip
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
    precision = Precision(index=sigma_index, level=sigma_level, point=sigma_point)
    if precision.is_given and (beams or wishes["rays"]):
        raise click.UsageError(
            "--sigma-index, --sigma-level and --sigma-point are not for --beams and --rays."
        )
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
