"""``multimedia bathymetry``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import click

from photocore.cli import print_result, progress_bar
from photocore.option_types import NEW_TABLE, NOT_NEGATIVE, POSITIVE, TABLE, Number, Numbers
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption, RasterCogOption


@dataclass(frozen=True, kw_only=True)
class BathymetryCommand:
    r"""The options of ``multimedia bathymetry``, and examples.

    a DEM, seen from about straight above:
      multimedia bathymetry dem.tif --water-level 1.8075 --index 1.33575 --out bed.tif
    a point cloud, rigorously, with the cameras (id,X,Y,Z) that saw it within 40 degrees:
      multimedia bathymetry cloud.las --water-level 102.4 --index 1.337 \
          --cameras cameras.csv --max-angle 40 --out bed.las
    with the precision that follows from index and level:
      multimedia bathymetry cloud.csv --water-level water.json --index 1.337 \
          --sigma-index 0.001 --sigma-level 0.01 --out bed.csv
    the same under a swell of 5 cm, 4 m long, that runs to the north-east:
      multimedia bathymetry cloud.las --water-level 102.4 --wave 0.05,4,45 --index 1.337 \
          --cameras cameras.csv --max-angle 40 --out waves.las
    the tide while the photos were taken: tide.csv (time,level), cameras.csv with a column time:
      multimedia bathymetry cloud.las --water-level tide.csv --index 1.337 \
          --cameras cameras.csv --max-angle 40 --out tide.las
    lidar echoes with the positions of the sensor:
      multimedia bathymetry echoes.las --water-level 102.4 --index 1.337 --group-index 1.36 \
          --beams --trajectory flight.csv --out bed.las
    measured rays (id,X0,Y0,Z0,DX,DY,DZ, one row per ray):
      multimedia bathymetry rays.csv --rays --water-level 0 --index 1.337 --out points.csv
    """

    source: Annotated[Path, Argument(TABLE, "IN")]
    water_level: Annotated[str, Typed(unit="Z|FILE")]
    """Height of the water [m]; its surface as a .tif or .asc raster, a .ply or .obj triangle mesh
    or the .json of `multimedia waterlevel`; or a table (.csv, .xlsx) of levels over time or by
    photo: time,level or camera,level."""
    waves: Annotated[tuple[str, ...], Typed(unit="A,L[,DIR[,PHASE]]", flag="--wave")] = ()
    """A wave upon the height: amplitude and length [m], direction of travel clockwise from +Y and
    phase at X = Y = 0 [deg]; repeat it. [default: none, flat water]"""
    index: Annotated[float, Typed(POSITIVE, "N")]
    """Refractive index of the water relative to the air [-], about 1.33 to 1.35."""
    target: Annotated[Path, Typed(NEW_TABLE, flag="--out")]
    """Corrected file, same kind as IN; - is a .csv on stdout."""
    cameras: Annotated[Path | None, Typed(unit="FILE")] = None
    """Table id,X,Y,Z of projection centres [m], or a project .toml: rigorous correction of X, Y and
    Z. [default: none, every point as if seen from straight above]"""
    visibility: Annotated[Path | None, Typed(unit="FILE")] = None
    """Table point,camera: which camera saw which point (the cloud needs a column id; a column
    'cameras' with their names does the same). [default: none, all cameras]"""
    max_angle: Annotated[
        float | None, Typed(Number(to=math.radians, above=0, most=89.9), "DEG")
    ] = None
    """A camera sees only points within this angle from its vertical [deg]. [default: any]"""
    sigma_index: Annotated[float, Typed(NOT_NEGATIVE, "N")] = 0.0
    """Standard deviation of the index [-]."""
    sigma_level: Annotated[float, Typed(NOT_NEGATIVE, "M")] = 0.0
    """Standard deviation of the water level [m]."""
    sigma_point: Annotated[float, Typed(NOT_NEGATIVE, "M")] = 0.0
    """Standard deviation of the coordinates in IN [m]. Any sigma adds sigma columns or a second
    band."""
    beams: bool = False
    """IN holds lidar echoes with columns X0, Y0, Z0. [off]"""
    trajectory: Annotated[Path | None, Typed(unit="FILE")] = None
    """Table time,X,Y,Z of the lidar sensor [s, m], for echoes with gps_time; implies --beams.
    [default: none]"""
    group_index: Annotated[float | None, Typed(POSITIVE, "N")] = None
    """Index that slows the laser pulse [-]. [default: as --index]"""
    rays: bool = False
    """IN is a table of measured rays. [off]"""
    sigma_direction: Annotated[float | None, Typed(Number(to=math.radians, above=0), "DEG")] = None
    """Standard deviation of a ray of the photos, or of a measured one [deg]: precision of the
    network. [default: none; of measured rays 0.0057]"""
    sigma_wave: Annotated[tuple[float, float] | None, Typed(Numbers(2), "A,L")] = None
    """Amplitude and length [m] of waves that differ from photo to photo, for the sigmas. [default:
    none]"""
    nodata: Annotated[float | None, Typed(Number(finite=False), "VALUE")] = None
    """Height that marks empty cells of a DEM [m]. [default: as the file says]"""
    area: Annotated[Path | None, Typed(unit="FILE")] = None
    """Polygons of the water, .geojson or .shp (extra shapes) in the reference system of IN: what
    lies outside, behind a dike or in a pool of its own, stays as it is. [default: none]"""
    classes: Annotated[tuple[int, ...], Typed(click.IntRange(0, 255), "CLASS", flag="--class")] = ()
    """Correct only points of this class of a LAS cloud, such as 40, bathymetric point; repeat it.
    [default: all classes]"""
    allow_dry: bool = False
    """Accept data without a point under water. [off]"""
    cog: RasterCogOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(BathymetryCommand)
def command(source: Path, target: Path, beams: bool, as_json: bool, **wishes: Any) -> None:
    """Correct a DEM or point cloud for the refraction at the water surface.

    IN is a GeoTIFF (.tif), a point cloud (.csv .txt .xyz .ply .las .laz), or with --rays a table
    of measured rays. Points above the water stay as they are; every attribute is kept.
    """
    from multimedia.bathymetry import Job, Precision, correct_file

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
