"""What the sigmas of a solved survey rest on."""

from __future__ import annotations

from bifocal.model import rests_on
from bifocal.survey.solved_survey import SolvedSurvey


def basis(solution: SolvedSurvey) -> str:
    """Return in one line what was given, found and assumed."""
    return rests_on(
        solution.pair, setup=_setup(solution), picks=_picks(solution), more=_world(solution)
    )


def _setup(solution: SolvedSurvey) -> str:
    corrected = ", corrected by points of the plane" if solution.adjusted else ""
    start = "the pair as given" if solution.photos is None else "the photos as given"
    if solution.setup is not None:
        start = "d_1, d_2, c_1, c_2 and nadir points as typed"
    return start + corrected


def _picks(solution: SolvedSurvey) -> str:
    if solution.setup is not None:
        how = "assumed" if solution.setup.measuring.sigma_s is None else "given"
        return f"picks of {solution.setup.precision:.3g} mm {how}"
    photo = solution.pair.image1
    how = "assumed"
    if solution.survey.setup.measuring.sigma_px is not None or photo.sigma_pixel is not None:
        how = "given"
    elif solution.sigma_px is not None:
        how = "found from the misfits"
    return f"picks of {photo.precision(solution.sigma_px):.3g} px {how}"


def _world(solution: SolvedSurvey) -> str:
    if solution.georeference is None:
        return ""
    world = solution.georeference
    clause = "with the transformation's own error"
    if world.precision is None:
        clause = "without the transformation's own error, which is unknown"
    return f"E, N, H on {int(world.used.sum())} control points taken as exact, {clause}"
