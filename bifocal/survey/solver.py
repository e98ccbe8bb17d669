"""Solve a survey: relief, coordinates, precision, check and world coordinates of its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bifocal.model import SCALE_TOLERANCE, Pair, PhotoSet, WorldFrame
from bifocal.remarks import remark
from bifocal.survey.arranging import Arranged, general_arranged, ideal_arranged, sigma_of_set
from bifocal.survey.check_points import check_points
from bifocal.survey.georeferencing import georeference
from bifocal.survey.other_photos import contradictions, of_all_photos
from bifocal.survey.point_survey import solve_points
from bifocal.survey.reference import Georeference, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.remarks import (
    georeference_remarks,
    opposite_signs_remark,
    point_remarks,
    refraction_remarks,
    unused_remarks,
)
from bifocal.survey.set_survey import solve_set
from bifocal.survey.solved_survey import SolvedSurvey
from bifocal.survey.survey_input import SurveyInput
from bifocal.survey.tolerances import RULES, ToleranceRule
from bifocal.survey.units import (
    refuse_contradiction,
)
from photocore.errors import InputError


def solve_survey(
    survey: SurveyInput,
    pair: Pair | None = None,
    *,
    adjust: bool = False,
    scale_tolerance: float = SCALE_TOLERANCE,
    rules: tuple[ToleranceRule, ...] = RULES,
) -> SolvedSurvey:
    """Solve what was measured with a general pair, or with the ideal one of its set-up.

    Parameters
    ----------
    survey : SurveyInput
    pair : Pair, optional
        For raw pixels.
    adjust, scale_tolerance, rules
        As of `bifocal.solve`.

    Raises
    ------
    InputError, GeometryError
        If the set-up or the geometry is at fault.
    """
    if pair is None:
        arranged = ideal_arranged(survey, scale_tolerance, adjust=adjust)
    else:
        arranged = general_arranged(pair, survey, adjust=adjust)
    points, pair, sigma_px = arranged.points, arranged.pair, arranged.sigma_px
    measured = points if arranged.measured is None else arranged.measured
    table = solve_points(pair, measured, sigma_px=sigma_px, limits=survey.setup.measuring.limits)
    refuse_contradiction(points, table, survey.where)
    table, other_remarks = _with_others(survey, table, arranged)
    unused = points.unused
    reference, control = survey.known.without(unused), survey.control.without(unused)
    check = check_points(table, reference, rules)
    world, world_remarks = _placed(control, table, survey.model, pair.extra)
    plane = arranged.check
    remarks = (
        *survey.remarks,
        *arranged.remarks,
        *refraction_remarks(pair, measured),
        *point_remarks(points, table, arranged.setup),
        *other_remarks,
        *check.remarks,
        *unused_remarks(unused, Check=survey.known, Georeference=survey.control),
        *opposite_signs_remark(table, reference),
        *(survey.tape.compared(table).remarks if survey.tape else ()),
        *world_remarks,
    )
    return SolvedSurvey(
        survey=survey, setup=arranged.setup, pair=pair, media=survey.setup.media,
        sigma_px=sigma_px, points=points, table=table, check=check, rules=rules,
        georeference=world, orientation_check=plane, adjusted=adjust,
        corrections=arranged.corrections, remarks=tuple(dict.fromkeys(filter(None, remarks))),
    )  # fmt: skip


def _with_others(
    survey: SurveyInput, table: ReliefTable, arranged: Arranged
) -> tuple[ReliefTable, list[str]]:
    """Return the table with what other photos beside an ideal pair tell, and remarks on it."""
    setup = survey.setup
    if arranged.setup is None or not setup.others or not survey.points.other_xy.size:
        return table, []
    adjusted = arranged.setup.adjusted
    setup = replace(setup, adjusted=adjusted[::-1] if arranged.pair.exchanged else adjusted)
    columns = of_all_photos(setup, survey.points)
    doubtful = contradictions(table.ids, np.where(survey.points.use, columns["chance"], np.nan))
    remarks: list[str] = []
    if doubtful:
        remarks.append(remark("survey.picks_contradict", names=", ".join(doubtful[:10])))
    return replace(table, columns={**table.columns, **columns}), remarks


def solve_survey_of_set(
    survey: SurveyInput, photos: PhotoSet, *, rules: tuple[ToleranceRule, ...] = RULES
) -> SolvedSurvey:
    """Solve what was measured in three photos and more.

    Raises
    ------
    InputError
        If there are no raw pixels.
    """
    points, measuring = survey.points, survey.setup.measuring
    numbers = photos.picked_in(points.pixels)
    picked = photos.only(numbers) if len(numbers) < len(photos) else photos
    pair = picked.best_pair()
    if not points.has_pixels.any():
        needed = remark("survey.set_pixels", count=len(photos))
        raise InputError(f"{survey.where}: {needed}")
    sigma, said = measuring.sigma_px, tuple[str, ...]()
    if sigma is None and not any(photo.sigma_pixel for photo in photos.photos):
        pixels = [points.pixels[k] for k in numbers if k < len(points.pixels)]
        sigma, said = sigma_of_set(picked, points, pixels)
    table, notes, off = solve_set(photos, points, sigma_px=sigma, limits=measuring.limits)
    noted = ("; ".join(filter(None, both)) for both in zip(points.note, notes, strict=True))
    unused = points.unused
    reference, control = survey.known.without(unused), survey.control.without(unused)
    check = check_points(table, reference, rules)
    world, world_remarks = _placed(control, table, survey.model, photos.extra)
    remarks = (
        *survey.remarks, *said, *off, *check.remarks,
        *unused_remarks(unused, Check=survey.known, Georeference=survey.control),
        *opposite_signs_remark(table, reference), *world_remarks,
    )  # fmt: skip
    return SolvedSurvey(
        survey=survey, setup=None, pair=pair, photos=photos, sigma_px=sigma,
        points=replace(points, note=tuple(noted)), table=table, check=check, rules=rules,
        georeference=world, remarks=tuple(dict.fromkeys(filter(None, remarks))),
    )  # fmt: skip


def _placed(
    control: KnownPoints, table: ReliefTable, model: str, extra: Mapping[str, object]
) -> tuple[Georeference | None, list[str]]:
    """Return the wall in the world, and remarks on it: by control points, or as the pair's were."""
    if not control.used.any() or np.isnan(control.xyz).all():
        frame = WorldFrame.of(extra)
        return None if frame is None else Georeference.of_frame(frame), []
    world = georeference(table, control, model=model)
    return world, georeference_remarks(world, control, table, is_auto=model == "auto")
