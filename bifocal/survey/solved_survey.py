"""A solved survey: geometry, points, check points, the wall in the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bifocal.model import Pair, PhotoSet, Points
from bifocal.survey.observations import PointObservations
from bifocal.survey.orientation_check import OrientationCheck
from bifocal.survey.reference import CheckResult, Georeference
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import SurveySetup
from bifocal.survey.survey_input import SurveyInput
from bifocal.survey.survey_media import SurveyMedia
from bifocal.survey.taped import TapedCheck
from bifocal.survey.tolerances import RULES, ToleranceRule
from photocore.arrays import FloatArray

#: Homographies of both images, shape (3, 3), None for none.
Corrections = tuple[FloatArray | None, FloatArray | None]


@dataclass(frozen=True, slots=True, eq=False)
class WorldPoints:
    """Solved points in the world; NaN, or None, where there are no control points.

    Attributes
    ----------
    table : ReliefTable
        The points in the wall's frame.
    georeference : Georeference or None
        The way from there to the world.
    """

    table: ReliefTable
    georeference: Georeference | None

    @property
    def xyz(self) -> FloatArray:
        """E, N, H of every point, shape (n, 3). [m]"""
        if self.georeference is None:
            return np.full((len(self.table), 3), np.nan)
        return self.georeference.world_from_wall(self.table.xyz)

    @property
    def near(self) -> FloatArray:
        """E, N, H about a whole-metre origin, shape (n, 3). [m]"""
        if self.georeference is None:
            return np.full((len(self.table), 3), np.nan)
        return self.georeference.near_of(self.table.xyz)

    @property
    def covariance(self) -> FloatArray | None:
        """Covariance of E, N, H, shape (n, 3, 3); None where it is not known. [m²]"""
        geo, table = self.georeference, self.table
        if geo is None or table.covariance is None:
            return None
        of_picks = table.own_covariance
        if geo.precision is None or of_picks is None:
            return geo.covariance_of(table.xyz, table.covariance)
        effect = table.effect_of_orientation()
        return geo.covariance_of(table.xyz, of_picks, ids=table.ids, effect=effect)

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of E, N, H, shape (n, 3). [m]"""
        covariance = self.covariance
        if covariance is None:
            return np.full((len(self.table), 3), np.nan)
        variances = np.diagonal(covariance, axis1=1, axis2=2)
        # Where points without redundancy are placed exactly, rounding is left.
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))

    @property
    def common(self) -> FloatArray:
        """What the orientation still adds to E, N, H once placed, shape (n, 3, 3). [m²]"""
        geo, table = self.georeference, self.table
        effect = table.effect_of_orientation()
        if geo is None or effect is None or geo.precision is None:
            return np.full((len(table), 3, 3), np.nan)
        return geo.common(self.near, effect)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedSurvey:
    """A solved survey, and where it comes from.

    Attributes
    ----------
    survey : SurveyInput
        What was measured and is known, with the set-up as options left it.
    setup : SurveySetup or None
        Of an ideal pair; None for one given by homographies.
    pair : Pair
        The geometry; of a set of photos its best pair.
    photos : PhotoSet or None
        The set of more than two photos that the points were measured in.
    media : SurveyMedia or None
        What the photos of a pair given by homographies look through, where that was stated.
    sigma_px : float or None
        Measuring precision of raw pixels. [px]
    points : PointObservations
        As solved: images exchanged where the user had them the other way round.
    table : ReliefTable
        What came out: relief, displacements, coordinates, precision, flags.
    check : CheckResult
        Errors at check points.
    rules : tuple of ToleranceRule
        For the verdict.
    georeference : Georeference or None
        The transformation to the world; None without control points.
    orientation_check : OrientationCheck or None
        What the points of the reference plane tell.
    adjusted : bool
        Whether the orientation was corrected by it.
    corrections : pair of ndarray, shape (3, 3), or None
        Homographies that corrected the typed coordinates in mm, where the pair is ideal.
    remarks : tuple of str
        What the user should know.
    source : Path
        The file it came from.
    pair_path : Path or None
        The pair file.
    given : mapping
        The options that took the place of what the workbook says.
    """

    survey: SurveyInput
    setup: SurveySetup | None
    pair: Pair
    photos: PhotoSet | None = None
    media: SurveyMedia | None = None
    sigma_px: float | None = None
    points: PointObservations
    table: ReliefTable
    check: CheckResult
    rules: tuple[ToleranceRule, ...] = RULES
    georeference: Georeference | None = None
    orientation_check: OrientationCheck | None = None
    adjusted: bool = False
    corrections: Corrections = (None, None)
    remarks: tuple[str, ...] = ()
    source: Path = Path()
    pair_path: Path | None = None
    given: Mapping[str, object] = field(default_factory=dict)

    @property
    def placed(self) -> WorldPoints:
        """The points in the world."""
        return WorldPoints(self.table, self.georeference)

    @property
    def taped(self) -> TapedCheck | None:
        """The distance taped on site beside the solved one; None without one."""
        tape = self.survey.tape
        return None if tape is None else tape.compared(self.table)

    @property
    def world(self) -> FloatArray:
        """E, N, H of every point, shape (n, 3); NaN without control points. [m]"""
        return self.placed.xyz

    @property
    def world_sigma(self) -> FloatArray:
        """Standard deviations of E, N, H, shape (n, 3); NaN without control points. [m]"""
        return self.placed.sigma

    def to_points(self) -> Points:
        """Return what was solved as points for tables, plots, relief, exports and drawings."""
        table, used = self.table, self.points.use
        covariance, world = table.covariance, self.georeference
        mixed, mixed_world = None, None
        if covariance is not None:
            mixed = covariance[:, 0, 1]
            if world is not None:
                placed = self.placed.covariance
                mixed_world = None if placed is None else placed[:, 0, 1]
        points = Points(
            ids=table.ids,
            xyz=table.xyz,
            world=None if world is None else self.world,
            sigma_r=table["sigma_r"],
            flags=table.flags,
            notes=self.points.note,
            sigma_xy=np.stack([table["sigma_X"], table["sigma_Y"]], axis=-1),
            sigma_world=None if world is None else self.world_sigma,
            cov_xy=mixed,
            cov_en=mixed_world,
            name=self.source.name,
        )
        return points.take(used)
