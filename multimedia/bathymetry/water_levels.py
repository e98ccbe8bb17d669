"""The water surface as a job names it, or a table of its levels."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from multimedia.bathymetry.corrected_points import (
    WaterSurface,
)
from multimedia.bathymetry.correction_job import Job
from multimedia.bathymetry.survey_tables import (
    CameraPositions,
    read_levels,
)
from multimedia.media import Plane
from multimedia.projects import read_water_surface
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: Tables of water levels over time or by photo.
LEVEL_TABLES = (".csv", ".xlsx", ".ods")


class StatedWater(NamedTuple):
    """The surface, and by how much it stood higher for each camera."""

    surface: WaterSurface
    rise: FloatArray | None = None
    remarks: tuple[str, ...] = ()


def water_of(job: Job, cameras: CameraPositions | None, crs: Any = None) -> StatedWater:
    """Return the water surface; of a table of levels their mean, and what each camera adds."""
    if Path(job.water_level).suffix.lower() not in LEVEL_TABLES:
        return StatedWater(read_water_surface(job.water_level, waves=job.waves, crs=crs))
    if cameras is None or job.waves:
        raise InputError(remark("bathymetry.levels_of_photos", of=job.water_level))
    levels = read_levels(job.water_level, cameras)
    mean = float(levels.mean())
    words = (
        f"The water stood at {levels.min():.3f} to {levels.max():.3f} m while the photos were "
        f"taken; depths count from the mean, {mean:.3f} m."
    )
    return StatedWater(Plane.level(mean), levels - mean, (words,))
