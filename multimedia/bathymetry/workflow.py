"""Refraction correction of files: DEM or point cloud in, the same corrected out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from multimedia.bathymetry.bounds import CLASS, Bounds, read_bounds
from multimedia.bathymetry.corrected_points import (
    CorrectedPoints,
    Precision,
    WaterSurface,
    checked_water_index,
    status_labels,
)
from multimedia.bathymetry.correction_job import MIXED_UNITS, Job, Outcome
from multimedia.bathymetry.refracted_rays import correct_lidar_beams, intersect_refracted_rays
from multimedia.bathymetry.refraction_correction import correct_bathymetry
from multimedia.bathymetry.regrid import pull_back
from multimedia.bathymetry.survey_tables import (
    CameraPositions,
    read_camera_positions,
    read_levels,
    read_rays,
    read_trajectory,
    read_visibility,
)
from multimedia.media import Plane
from multimedia.projects import SENTINELS, Dem, read_water_surface
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.cli import Progress, no_progress
from photocore.cloud import open_cloud
from photocore.cloud.model import Cloud, CloudPiece
from photocore.errors import GeometryError, InputError, located
from photocore.names import did_you_mean
from photocore.output import check_ending, check_not_input, check_writable
from photocore.raster import Window
from photocore.tables import write_csv

#: Attribute that marks a cloud this package has corrected.
MARK = "refraction"
#: What a corrected cloud gains: numpy type and description.
_GAINED = {
    MARK: ("u1", "0 dry 1 nadir 2 rays 3 4 5 none"),
    "water_depth": ("f4", "true depth under water"),
    **dict.fromkeys(("sigma_X", "sigma_Y", "sigma_Z"), ("f4", "standard deviation")),
}
#: Refractive index of any water, pure or brine, for any light that passes it.
WATER = (1.3, 1.4)
#: Tables of water levels over time or by photo.
LEVEL_TABLES = (".csv", ".xlsx", ".ods")
#: Of a measured ray, unless it is given. [rad]
SIGMA_DIRECTION = 1e-4
#: Side of the windows in which a DEM is corrected: 8 MB of heights. [cells]
WINDOW = 1024
#: Widest planimetric shift that is followed across a window's edge. [cells]
WIDEST_MARGIN = 4096


def correct_file(job: Job, *, progress: Progress = no_progress) -> Outcome:
    """Correct a DEM, a point cloud, lidar echoes or measured rays, as the job says.

    Raises
    ------
    InputError, GeometryError
        If anything is wrong with the data; the target is then not written.
    """
    tables = (job.cameras, job.visibility, job.trajectory, job.area)
    check_not_input(job.target, job.source, job.water_level, *tables)
    check_writable(job.target, overwrite=job.overwrite)
    checked_water_index(job.index)
    lowest, highest = WATER
    if not lowest <= job.index <= highest:
        raise InputError(
            f"--index: {job.index:g} is no water's; relative to the air water has {lowest:g} to "
            f"{highest:g} (`multimedia index` computes it)."
        )
    if job.rays:
        return _correct_rays(job)
    if job.source.suffix.lower() in (".tif", ".tiff"):
        return _correct_dem(job, progress)
    return _correct_cloud(job, progress)


def _correct_cloud(job: Job, progress: Progress) -> Outcome:
    """Correct a point cloud piece by piece."""
    cloud = open_cloud(job.source)
    if job.nodata is not None:
        raise InputError(f"{job.source}: --nodata is for the cells of a DEM, this is a cloud.")
    if job.target.suffix.lower() != job.source.suffix.lower():
        raise InputError(remark("bathymetry.other_ending", of=job.target, suffix=job.source.suffix))
    if cloud.has(MARK):
        raise InputError(remark("bathymetry.corrected_already", of=job.source, mark=MARK))
    cameras = read_camera_positions(job.cameras) if job.cameras else None
    bounds = read_bounds(job.area, job.classes)
    if bounds.classes and not cloud.has(CLASS):
        raise InputError(remark("bathymetry.no_classes", of=job.source, name=CLASS))
    water = _water(job, cameras)
    surface = water.surface
    correct, remarks = _corrector(job, cloud, water, cameras)
    outcome = Outcome(remarks=[*cloud.remarks, *water.remarks, *remarks])
    is_precise = job.precision != Precision() and not job.beams
    gained = {
        name: kind for name, kind in _GAINED.items() if is_precise or not name.startswith("sigma")
    }
    spoken = job.source.suffix.lower() not in (".ply", ".las", ".laz")
    numbers = [*(("X0", "Y0", "Z0", "gps_time") if job.beams else ())]
    numbers += [CLASS] if bounds.classes else []
    texts = ("id", "cameras") if job.cameras else ()
    done = 0
    with cloud.copy(job.target, gained, overwrite=job.overwrite) as write:
        for piece in cloud.pieces(numbers=numbers, texts=texts):
            unknown = piece.xyz[np.isin(piece.xyz[:, 2], SENTINELS), 2]
            if unknown.size:
                raise InputError(
                    f"{job.source}: {unknown.size} points have the height {unknown[0]:g} m, which "
                    "programs write where they know none; leave these points out."
                )
            result = correct(piece)
            if bounds:
                inside = bounds.hold(piece.xyz, piece.numbers.get(CLASS))
                result = bounds.applied(piece.xyz, result, inside, job.precision.point)
            outcome.add(piece.xyz, result)
            status = status_labels(result.status) if spoken else result.status
            sigma = () if result.sigma is None else result.sigma.T
            write(piece, result.xyz, dict(zip(gained, (status, result.depth, *sigma), strict=True)))
            done += len(piece.xyz)
            progress(done, done + 1, f"{done} points")
        with located(job.source):
            outcome.judge(surface, allow_dry=job.allow_dry)
    return outcome


class _Water(NamedTuple):
    """The surface, and by how much it stood higher for each camera."""

    surface: WaterSurface
    rise: FloatArray | None = None
    remarks: tuple[str, ...] = ()


def _water(job: Job, cameras: CameraPositions | None, crs: Any = None) -> _Water:
    """Return the water surface; of a table of levels their mean, and what each camera adds."""
    if Path(job.water_level).suffix.lower() not in LEVEL_TABLES:
        return _Water(read_water_surface(job.water_level, waves=job.waves, crs=crs))
    if cameras is None or job.waves:
        raise InputError(remark("bathymetry.levels_of_photos", of=job.water_level))
    levels = read_levels(job.water_level, cameras)
    mean = float(levels.mean())
    words = (
        f"The water stood at {levels.min():.3f} to {levels.max():.3f} m while the photos were "
        f"taken; depths count from the mean, {mean:.3f} m."
    )
    return _Water(Plane.level(mean), levels - mean, (words,))


def _corrector(
    job: Job, cloud: Cloud, water: _Water, cameras: CameraPositions | None
) -> tuple[Callable[[CloudPiece], CorrectedPoints], list[str]]:
    """Return the function that corrects one piece of a cloud, and what the user should know."""
    surface = water.surface
    corrected = partial(
        correct_bathymetry, water_level=surface, refractive_index=job.index, precision=job.precision
    )
    if job.beams:
        sensor = _sensor_positions(job, cloud)
        beams = partial(
            correct_lidar_beams, refractive_index=job.index, group_index=job.group_index
        )
        return lambda piece: beams(sensor(piece), piece.xyz, water_level=surface), []
    if cameras is None:
        return lambda piece: corrected(piece.xyz), []
    remarks: list[str] = []
    pairs = read_visibility(job.visibility, cameras) if job.visibility else None
    if pairs is not None:
        _check_pairs(pairs, cameras, job)
        if not cloud.has("id"):
            raise InputError(f"{job.source}: --visibility needs a column id in the point cloud.")
    elif not cloud.has("cameras") and job.max_angle is None:
        remarks.append(remark("bathymetry.all_see_all"))

    def correct(piece: CloudPiece) -> CorrectedPoints:
        _check_camera_unit(piece.xyz, cameras.centres, job)
        visible = _visible(piece, cameras, pairs, job)
        return corrected(
            piece.xyz, cameras=cameras.centres, visible=visible, max_angle=job.max_angle,
            rise=water.rise,
        )  # fmt: skip

    return correct, remarks


def _visible(
    piece: CloudPiece, cameras: CameraPositions, pairs: Mapping[str, set[str]] | None, job: Job
) -> csr_array | None:
    """Return which camera saw which point, by table or by column; None: nothing says so."""
    place = {name: k for k, name in enumerate(cameras.ids)}
    seen: list[list[int]] = []
    if pairs is not None:
        seen = [[place[name] for name in pairs.get(point, ())] for point in piece.texts["id"]]
    elif "cameras" in piece.texts:
        for number, text in enumerate(piece.texts["cameras"]):
            names = text.replace(";", " ").replace(",", " ").replace("|", " ").split()
            unknown = [name for name in names if name not in place]
            if unknown:
                # A piece does not know where in the file it begins; coordinates find the point.
                where = ", ".join(f"{value:.3f}" for value in piece.xyz[number])
                raise InputError(
                    f"{job.source}: the point at {where} names camera {unknown[0]!r}, which is "
                    f"not in {job.cameras}."
                )
            seen.append([place[name] for name in dict.fromkeys(names)])
    else:
        return None
    ends = np.cumsum([0, *map(len, seen)])
    camera = np.fromiter((number for row in seen for number in row), np.int64, ends[-1])
    shape = (len(piece.xyz), len(cameras.ids))
    return csr_array((np.ones(len(camera), dtype=bool), camera, ends), shape=shape)


def _check_camera_unit(points: FloatArray, centres: FloatArray, job: Job) -> None:
    """Raise GeometryError for cameras in millimetres over points in metres."""
    plan = points[np.isfinite(points).all(-1), :2]
    extent = float(np.ptp(plan, axis=0).max()) if len(plan) else 0.0
    height = float(np.median(centres[:, 2]) - np.nanmedian(points[:, 2]))
    if 0 < MIXED_UNITS * extent < height:
        raise GeometryError(
            f"{job.cameras}: the cameras are {height:g} m above points that cover only {extent:g} "
            "m: are cameras and points in different units (mm and m)?"
        )


def _check_pairs(pairs: Mapping[str, set[str]], cameras: CameraPositions, job: Job) -> None:
    """Raise InputError for cameras that only one of the tables knows."""
    unknown = sorted(set().union(*pairs.values()) - set(cameras.ids))
    if unknown:
        like = did_you_mean(unknown[0], cameras.ids)
        more = f" (and {len(unknown) - 1} more)" if len(unknown) > 1 else ""
        raise InputError(
            f"{job.visibility}: camera {unknown[0]!r} is not in {job.cameras}{like}{more}."
        )


def _sensor_positions(job: Job, cloud: Cloud) -> Callable[[CloudPiece], FloatArray]:
    """Return the function that finds where the sensor was for the points of a piece."""
    if job.trajectory is None:
        if not all(cloud.has(name) for name in ("X0", "Y0", "Z0")):
            raise InputError(remark("bathymetry.sensor_position", of=job.source))
        return lambda piece: np.column_stack([piece.numbers[n] for n in ("X0", "Y0", "Z0")])
    if not cloud.has("gps_time"):
        raise InputError(f"{job.source}: --trajectory needs a time (gps_time) for each point.")
    times, positions = read_trajectory(job.trajectory)

    def at_time(piece: CloudPiece) -> FloatArray:
        when = piece.numbers["gps_time"]
        if when.min() < times[0] or when.max() > times[-1]:
            raise InputError(
                f"{job.trajectory}: covers times {times[0]:g} to {times[-1]:g} s, the points need "
                f"{when.min():g} to {when.max():g} s."
            )
        return np.column_stack([np.interp(when, times, positions[:, k]) for k in range(3)])

    return at_time


def _correct_dem(job: Job, progress: Progress) -> Outcome:
    """Correct an elevation model window by window."""
    check_ending(job.target, "a DEM is written as .tif.", ".tif", ".tiff")
    if job.beams or job.visibility or job.classes:
        raise InputError(remark("bathymetry.cells_of_dem", of=job.source))
    bounds = read_bounds(job.area, ())
    with Dem(job.source, nodata=job.nodata) as dem:
        if "REFRACTION_INDEX" in dem.tags:
            raise InputError(f"{job.source}: has been corrected for refraction already.")
        cameras = read_camera_positions(job.cameras) if job.cameras else None
        water = _water(job, cameras, dem.crs)
        surface = water.surface
        is_level = isinstance(surface, Plane) and abs(surface.normal[2]) == 1.0
        if not dem.has_position and (cameras is not None or bounds or not is_level):
            raise InputError(remark("bathymetry.dem_nowhere", of=job.source))
        outcome = Outcome(remarks=list(water.remarks))
        if cameras is not None:
            if dem.is_geographic:
                raise InputError(remark("bathymetry.degrees", of=job.source))
            if job.max_angle is None:
                outcome.remarks.append(
                    "Every camera is taken to see every cell; --max-angle limits that."
                )
        level = " ".join((job.water_level, *job.waves))
        tags = {"REFRACTION_INDEX": f"{job.index:g}", "REFRACTION_WATER_LEVEL": level}
        bands = ("height", "sigma") if job.precision != Precision() else ("height",)
        windows = list(dem.windows(WINDOW))
        with dem.copy(job.target, bands=bands, tags=tags, overwrite=job.overwrite) as write:
            margin = 0  # widened when a window needs more, and kept for the next
            for number, window in enumerate(windows, start=1):
                bands_of, margin = _correct_window(
                    job, dem, window, water, cameras, bounds, outcome, margin
                )
                write(window, bands_of)
                progress(number, len(windows), "DEM windows")
            with located(job.source):
                outcome.judge(surface, allow_dry=job.allow_dry)
        outcome.remarks[:0] = dem.remarks
    return outcome


def _correct_window(
    job: Job,
    dem: Dem,
    window: Window,
    water: _Water,
    cameras: CameraPositions | None,
    bounds: Bounds,
    outcome: Outcome,
    margin: int,
) -> tuple[FloatArray, int]:
    """Return the bands of one window, shape (bands, height, width), and the margin it took."""
    while True:
        wide = window.widened(margin)
        given = np.concatenate([dem.positions(wide), dem.heights(wide)[..., None]], axis=-1)
        finite = np.isfinite(given[..., 2])
        points = given[finite]
        result = correct_bathymetry(
            points,
            water_level=water.surface,
            refractive_index=job.index,
            cameras=None if cameras is None else cameras.centres,
            max_angle=None if cameras is None else job.max_angle,
            rise=water.rise,
            precision=job.precision,
        )
        if bounds:
            result = bounds.applied(points, result, bounds.hold(points), job.precision.point)
        move = np.full((*finite.shape, 2), np.nan)
        move[finite] = (result.xyz - points)[:, :2] @ np.linalg.inv(dem.xy_from_pixel[:, :2]).T
        reach = int(np.ceil(np.nanmax(np.abs(move), initial=0.0)))
        needed = reach + 2 if reach else 0
        if needed <= margin or cameras is None:
            break
        if needed > WIDEST_MARGIN:
            raise GeometryError(remark("bathymetry.far_cells", of=job.source, reach=reach))
        margin = needed
    layers = [result.xyz[:, 2]]
    if result.sigma is not None:
        layers.append(result.sigma[:, 2])
    bands = np.full((len(layers), *finite.shape), np.nan)
    for band, values in zip(bands, layers, strict=True):
        band[finite] = values
    if cameras is not None:
        bands = pull_back(bands, move)
    inner = (slice(margin, margin + window.height), slice(margin, margin + window.width))
    own = np.zeros_like(finite)
    own[inner] = True
    counted = own[finite]
    outcome.add(
        points[counted],
        CorrectedPoints(
            xyz=result.xyz[counted], depth=result.depth[counted], status=result.status[counted]
        ),
    )
    return bands[:, *inner], margin


def _correct_rays(job: Job) -> Outcome:
    """Refract and intersect a table of measured rays."""
    if job.area is not None or job.classes:
        raise InputError(remark("bathymetry.bounds_of_rays", of=job.source))
    check_ending(job.target, "intersected rays are written as .csv.", ".csv")
    if job.nodata is not None:
        raise InputError(f"{job.source}: --nodata is for the cells of a DEM, these are rays.")
    table = read_rays(job.source)
    surface = read_water_surface(job.water_level, waves=job.waves)
    points = intersect_refracted_rays(
        table.origins,
        table.directions,
        water_level=surface,
        refractive_index=job.index,
        sigma_direction=job.sigma_direction or SIGMA_DIRECTION,
    )
    outcome = Outcome()
    depth = np.maximum(surface.height_at(points.xyz[:, :2]) - points.xyz[:, 2], 0.0)
    outcome.add(points.xyz, CorrectedPoints(xyz=points.xyz, depth=depth, status=points.status))
    with located(job.source):
        outcome.judge(surface, allow_dry=job.allow_dry)
    columns = {
        "id": list(table.ids),
        **dict(zip("XYZ", points.xyz.T, strict=True)),
        **dict(zip(("sigma_X", "sigma_Y", "sigma_Z"), points.sigma.T, strict=True)),
        "misfit": points.misfit,
        "rays": points.rays,
        MARK: status_labels(points.status),
        "water_depth": depth,
    }
    write_csv(job.target, columns, overwrite=job.overwrite)
    return outcome
