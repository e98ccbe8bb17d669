"""Measured rays of a table, refracted and intersected."""

from __future__ import annotations

import numpy as np

from multimedia.bathymetry.corrected_points import (
    CorrectedPoints,
    status_labels,
)
from multimedia.bathymetry.correction_job import MARK, Job, Outcome
from multimedia.bathymetry.refracted_rays import intersect_refracted_rays
from multimedia.bathymetry.survey_tables import (
    read_rays,
)
from multimedia.projects import read_water_surface
from multimedia.remarks import remark
from photocore.errors import InputError, located
from photocore.output import check_ending
from photocore.tables import write_csv

#: Of a measured ray, unless it is given. [rad]
SIGMA_DIRECTION = 1e-4


def correct_rays(job: Job) -> Outcome:
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
