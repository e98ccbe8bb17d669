"""Refraction correction of an elevation model, window by window."""

from __future__ import annotations

import numpy as np

from multimedia.bathymetry.bounds import Bounds, read_bounds
from multimedia.bathymetry.corrected_points import (
    CorrectedPoints,
    Precision,
)
from multimedia.bathymetry.correction_job import Job, Outcome
from multimedia.bathymetry.refraction_correction import correct_bathymetry
from multimedia.bathymetry.regrid import pull_back
from multimedia.bathymetry.survey_tables import (
    CameraPositions,
    read_camera_positions,
)
from multimedia.bathymetry.water_levels import StatedWater, water_of
from multimedia.media import Plane
from multimedia.projects import Dem
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.cli import Progress
from photocore.errors import GeometryError, InputError, located
from photocore.output import check_ending
from photocore.raster import Window

#: Side of the windows in which a DEM is corrected: 8 MB of heights. [cells]
WINDOW = 1024


#: Widest planimetric shift that is followed across a window's edge. [cells]
WIDEST_MARGIN = 4096


def correct_dem(job: Job, progress: Progress) -> Outcome:
    """Correct an elevation model window by window."""
    check_ending(job.target, "a DEM is written as .tif.", ".tif", ".tiff")
    if job.beams or job.visibility or job.classes:
        raise InputError(remark("bathymetry.cells_of_dem", of=job.source))
    bounds = read_bounds(job.area, ())
    with Dem(job.source, nodata=job.nodata) as dem:
        if "REFRACTION_INDEX" in dem.tags:
            raise InputError(f"{job.source}: has been corrected for refraction already.")
        cameras = read_camera_positions(job.cameras) if job.cameras else None
        water = water_of(job, cameras, dem.crs)
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
    water: StatedWater,
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
