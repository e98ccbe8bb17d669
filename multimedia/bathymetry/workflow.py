"""Refraction correction of files: DEM or point cloud in, the same corrected out."""

from __future__ import annotations

from multimedia.bathymetry.cloud_correction import correct_cloud
from multimedia.bathymetry.corrected_points import (
    checked_water_index,
)
from multimedia.bathymetry.correction_job import Job, Outcome
from multimedia.bathymetry.dem_correction import correct_dem
from multimedia.bathymetry.ray_correction import correct_rays
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import check_not_input, check_writable

#: Refractive index of any water, pure or brine, for any light that passes it.
WATER = (1.3, 1.4)


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
        return correct_rays(job)
    if job.source.suffix.lower() in (".tif", ".tiff"):
        return correct_dem(job, progress)
    return correct_cloud(job, progress)
