"""Refraction correction of a point cloud or of lidar echoes, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from multimedia.bathymetry.bounds import CLASS, read_bounds
from multimedia.bathymetry.corrected_points import (
    CorrectedPoints,
    Precision,
    status_labels,
)
from multimedia.bathymetry.correction_job import MARK, MIXED_UNITS, Job, Outcome
from multimedia.bathymetry.refracted_rays import correct_lidar_beams
from multimedia.bathymetry.refraction_correction import correct_bathymetry
from multimedia.bathymetry.survey_tables import (
    CameraPositions,
    read_camera_positions,
    read_trajectory,
    read_visibility,
)
from multimedia.bathymetry.water_levels import StatedWater, water_of
from multimedia.projects import SENTINELS
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.cli import Progress
from photocore.cloud import open_cloud
from photocore.cloud.model import Cloud, CloudPiece
from photocore.errors import GeometryError, InputError, located
from photocore.names import did_you_mean

#: What a corrected cloud gains: numpy type and description.
_GAINED = {
    MARK: ("u1", "0 dry 1 nadir 2 rays 3 4 5 none"),
    "water_depth": ("f4", "true depth under water"),
    **dict.fromkeys(("sigma_X", "sigma_Y", "sigma_Z"), ("f4", "standard deviation")),
}


def correct_cloud(job: Job, progress: Progress) -> Outcome:
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
    water = water_of(job, cameras)
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


def _corrector(
    job: Job, cloud: Cloud, water: StatedWater, cameras: CameraPositions | None
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
