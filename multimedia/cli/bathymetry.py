"""``multimedia bathymetry``."""

from __future__ import annotations

from pathlib import Path

import click

EPILOG = """\b
Examples:
  a DEM, seen from about straight above:
    multimedia bathymetry dem.tif --water-level 1.8075 --index 1.33575 --out bed.tif
  a point cloud, rigorously, with the cameras (id,X,Y,Z) that saw it within 40 degrees:
    multimedia bathymetry cloud.las --water-level 102.4 --index 1.337 \\
        --cameras cameras.csv --max-angle 40 --out bed.las
  with the precision that follows from index and level:
    multimedia bathymetry cloud.csv --water-level water.json --index 1.337 \\
        --sigma-index 0.001 --sigma-level 0.01 --out bed.csv
  lidar echoes with the positions of the sensor:
    multimedia bathymetry echoes.las --water-level 102.4 --index 1.337 --group-index 1.36 \\
        --beams --trajectory flight.csv --out bed.las
  measured rays (id,X0,Y0,Z0,DX,DY,DZ, one row per ray):
    multimedia bathymetry rays.csv --rays --water-level 0 --index 1.337 --out points.csv
"""


@click.command(
    "bathymetry", short_help="Refraction correction of a DEM or point cloud.", epilog=EPILOG
)
@click.argument("source", metavar="IN", type=click.Path(path_type=Path))
@click.option(
    "--water-level",
    required=True,
    metavar="Z|FILE",
    help="Height of the water [m]; or its surface as a .tif raster, a .ply triangle mesh or the "
    ".json of `multimedia waterlevel`.",
)
@click.option(
    "--index",
    required=True,
    type=float,
    metavar="N",
    help="Refractive index of the water relative to the air [-], about 1.33 to 1.35.",
)
@click.option(
    "--out",
    "target",
    required=True,
    type=click.Path(path_type=Path),
    help="Corrected file, same kind as IN.",
)
@click.option(
    "--cameras",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Table id,X,Y,Z of projection centres [m], or a project .toml: rigorous correction of X, "
    "Y and Z. "
    "[default: none, every point as if seen from straight above]",
)
@click.option(
    "--visibility",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Table point,camera: which camera saw which point (the cloud needs a column id; a column "
    "'cameras' with their names does the same). [default: none, all cameras]",
)
@click.option(
    "--max-angle",
    type=click.FloatRange(0, 89.9, min_open=True),
    metavar="DEG",
    help="A camera sees only points within this angle from its vertical [deg]. [default: any]",
)
@click.option(
    "--sigma-index",
    type=click.FloatRange(0),
    default=0.0,
    show_default=True,
    help="Standard deviation of the index [-].",
)
@click.option(
    "--sigma-level",
    type=click.FloatRange(0),
    default=0.0,
    show_default=True,
    help="Standard deviation of the water level [m].",
)
@click.option(
    "--sigma-point",
    type=click.FloatRange(0),
    default=0.0,
    show_default=True,
    help="Standard deviation of the coordinates in IN [m]. Any sigma adds sigma columns or a "
    "second band.",
)
@click.option("--beams", is_flag=True, help="IN holds lidar echoes with columns X0, Y0, Z0. [off]")
@click.option(
    "--trajectory",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Table time,X,Y,Z of the lidar sensor [s, m], for echoes with gps_time; implies --beams. "
    "[default: none]",
)
@click.option(
    "--group-index",
    type=float,
    metavar="N",
    help="Index that slows the laser pulse [-]. [default: as --index]",
)
@click.option("--rays", is_flag=True, help="IN is a table of measured rays. [off]")
@click.option(
    "--sigma-direction",
    type=click.FloatRange(0, min_open=True),
    default=0.0057,
    show_default=True,
    help="Standard deviation of a measured ray [deg].",
)
@click.option(
    "--nodata",
    type=float,
    metavar="VALUE",
    help="Height that marks empty cells of a DEM [m]. [default: as the file says]",
)
@click.option("--allow-dry", is_flag=True, help="Accept data without a point under water. [off]")
@click.option("--overwrite", is_flag=True, help="Replace an existing file. [off]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object. [off]")
def command(
    source: Path,
    water_level: str,
    index: float,
    target: Path,
    cameras: Path | None,
    visibility: Path | None,
    max_angle: float | None,
    sigma_index: float,
    sigma_level: float,
    sigma_point: float,
    beams: bool,
    trajectory: Path | None,
    group_index: float | None,
    rays: bool,
    sigma_direction: float,
    nodata: float | None,
    allow_dry: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Correct a DEM or point cloud for the refraction at the water surface.

    IN is a GeoTIFF (.tif), a point cloud (.csv .txt .xyz .ply .las .laz), or with --rays a table
    of measured rays. Points above the water stay as they are; every attribute is kept.
    """
    from math import radians

    from multimedia.bathymetry.corrected_points import Precision
    from multimedia.bathymetry.job import Job
    from multimedia.bathymetry.workflow import correct_file
    from photocore.cli import print_json, progress_bar, remark

    if visibility and not cameras:
        raise click.UsageError("--visibility needs --cameras.")
    if max_angle and not cameras:
        raise click.UsageError("--max-angle needs --cameras.")
    if rays and (beams or trajectory or cameras):
        raise click.UsageError("--rays holds its cameras already; leave the other options out.")
    if (beams or trajectory) and cameras:
        raise click.UsageError("--beams and --cameras exclude each other.")
    job = Job(
        source=source,
        target=target,
        water_level=water_level,
        index=index,
        cameras=cameras,
        visibility=visibility,
        trajectory=trajectory,
        max_angle=None if max_angle is None else radians(max_angle),
        precision=Precision(index=sigma_index, level=sigma_level, point=sigma_point),
        group_index=group_index,
        beams=beams or trajectory is not None,
        rays=rays,
        sigma_direction=radians(sigma_direction),
        nodata=nodata,
        allow_dry=allow_dry,
        overwrite=overwrite,
    )
    with progress_bar("Refraction correction", quiet=as_json) as progress:
        outcome = correct_file(job, progress=progress)
    for text in outcome.remarks:
        remark(text)
    if as_json:
        print_json(
            {
                "file": target,
                "counts": outcome.counts,
                "max_depth": outcome.max_depth,
                "mean_change_z": outcome.mean_change,
                "remarks": outcome.remarks,
            }
        )
        return
    counts = ", ".join(f"{count} {name}" for name, count in outcome.counts.items())
    click.echo(f"{target}: {counts}")
    click.echo(
        f"greatest depth {outcome.max_depth:.4g} m, mean change of Z {outcome.mean_change:+.4g} m"
    )
