"""What a refraction correction of files is asked for, and what it tells the user afterwards."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from multimedia.bathymetry.corrected_points import (
    BathymetryStatus,
    CorrectedPoints,
    Precision,
    WaterSurface,
)
from multimedia.media import Plane
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import GeometryError

#: Deeper than any photo sees: most likely millimetres. [m]
DEEPEST = 200.0
#: Where nothing is dry and nothing shallower than this, nothing shows that the level is right. [m]
SHORE = 3.0
#: Lengths that differ by more than this are most likely in different units.
MIXED_UNITS = 1000.0
#: Attribute that marks a cloud this package has corrected.
MARK = "refraction"


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What `correct_file` is asked to do.

    Attributes
    ----------
    source, target : Path
    water_level : str
        A height [m] or a file, see `read_water_surface` and `read_levels`.
    waves : tuple of str
        Waves upon that height.
    index : float
    cameras, visibility, trajectory : Path or None
        Camera positions; who saw what; sensor positions over time (lidar).
    max_angle : float or None
        A camera sees a point only within this angle from the vertical. [rad]
    precision : Precision
    group_index : float or None
    beams : bool
        The points are lidar echoes with columns X0, Y0, Z0 or a trajectory.
    rays : bool
        The source is a table of measured rays.
    sigma_direction : float or None
        Of measured rays, 1e-4 unless given. [rad]
    nodata : float or None
    area : Path or None
        Polygons of the water, GeoJSON or a shapefile: what lies outside stays as it is.
    classes : tuple of int
        Classes of a LAS cloud that are corrected; by default all.
    allow_dry : bool
        Accept data without a single point under water.
    overwrite : bool
    """

    source: Path
    target: Path
    water_level: str
    index: float
    waves: tuple[str, ...] = ()
    cameras: Path | None = None
    visibility: Path | None = None
    trajectory: Path | None = None
    max_angle: float | None = None
    precision: Precision = field(default_factory=Precision)
    group_index: float | None = None
    beams: bool = False
    rays: bool = False
    sigma_direction: float | None = None
    nodata: float | None = None
    area: Path | None = None
    classes: tuple[int, ...] = ()
    allow_dry: bool = False
    overwrite: bool = False


@dataclass(slots=True)
class Outcome:
    """What was done, for the user.

    Attributes
    ----------
    counts : dict of str to int
        Points per treatment.
    max_depth, min_depth, mean_change : float
        Largest and least true depth and mean change of Z under water. [m]
    lowest, highest : float
        Range of the given heights. [m]
    remarks : list of str
    """

    counts: dict[str, int] = field(default_factory=dict)
    max_depth: float = 0.0
    min_depth: float = np.inf
    mean_change: float = 0.0
    lowest: float = np.inf
    highest: float = -np.inf
    remarks: list[str] = field(default_factory=list)
    _sum: float = 0.0
    _wet: int = 0

    def add(self, given: FloatArray, result: CorrectedPoints) -> None:
        """Count a piece."""
        for status in BathymetryStatus:
            count = int((result.status == status).sum())
            if count:
                self.counts[status.label] = self.counts.get(status.label, 0) + count
        finite = given[..., 2][np.isfinite(given[..., 2])]
        if finite.size:
            self.lowest = min(self.lowest, float(finite.min()))
            self.highest = max(self.highest, float(finite.max()))
        wet = np.isin(result.status, (BathymetryStatus.NADIR, BathymetryStatus.RAYS))
        if wet.any():
            self._wet += int(wet.sum())
            self._sum += float((result.xyz - given)[..., 2][wet].sum())
            self.mean_change = self._sum / self._wet
            self.max_depth = max(self.max_depth, float(result.depth[wet].max()))
            self.min_depth = min(self.min_depth, float(result.depth[wet].min()))

    def judge(self, surface: WaterSurface, *, allow_dry: bool) -> None:
        """Raise GeometryError when nothing lies under water; note what looks like millimetres."""
        if not np.isfinite(self.lowest):
            raise GeometryError(remark("bathymetry.no_position"))
        outside = self.counts.get(BathymetryStatus.NO_SURFACE.label, 0)
        if outside and not self._wet and not allow_dry:
            raise GeometryError(
                f"the water surface covers none of the points: {outside} of "
                f"{sum(self.counts.values())} lie outside it, or their rays meet it nowhere. Check "
                "that surface and data are in the same place and reference system."
            )
        failed = self.counts.get(BathymetryStatus.FAILED.label, 0)
        dry = self.counts.get(BathymetryStatus.DRY.label, 0)
        if self.counts.get(BathymetryStatus.OUTSIDE.label, 0) == sum(self.counts.values()):
            raise GeometryError(remark("bathymetry.all_outside"))
        flat = isinstance(surface, Plane)
        if failed and not (self._wet or dry or allow_dry):
            raise GeometryError(
                f"none of {failed} points could be corrected: no rays from their cameras meet in "
                "one place through this water surface. Check the cameras, and which of them saw "
                "which point" + ("." if flat else "; leave oblique rays out with --max-angle.")
            )
        if not self._wet and not allow_dry:
            level = surface.middle
            hint = ""
            if 0 < self.lowest / 2 <= 1000 * level <= 2 * self.highest:
                hint = " The heights look like millimetres, the water level like metres."
            raise GeometryError(
                f"no point lies under the water surface: heights {self.lowest:g} to "
                f"{self.highest:g} m, water level {level:g} m.{hint} Check level and unit, or say "
                "--allow-dry if that is right."
            )
        span = self.highest - self.lowest
        if self.max_depth > DEEPEST and 0 < span < self.max_depth / MIXED_UNITS:
            raise GeometryError(
                f"the water level {surface.middle:g} m lies {self.max_depth:g} m above "
                f"heights that span only {span:g} m: are they in different units (mm and m)?"
            )
        if self.max_depth > DEEPEST:
            self.remarks.append(remark("bathymetry.very_deep", max_depth=self.max_depth))
        if not dry and SHORE < self.min_depth < np.inf:
            self.remarks.append(remark("bathymetry.no_shore", min_depth=self.min_depth))
        if failed:
            hint = "" if flat else " Oblique rays through waves have many ways: try --max-angle 40."
            self.remarks.append(f"{failed} points could not be corrected and are marked so.{hint}")
        if outside:
            self.remarks.append(
                f"{outside} points lie outside the modelled water surface and were left as given."
            )
