"""Picks of a survey held against the photos of its pair, which are decoded for that alone."""

from __future__ import annotations

import numpy as np

from bifocal.files import photo_info
from bifocal.matching import PickVerdict, held_against_photos
from bifocal.model import Pair
from bifocal.survey import SolvedSurvey
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.images import read_grey

#: So many picks at most are held against the photos.
MOST_HELD = 100


def photos_against_picks(solved: SolvedSurvey, pair: Pair) -> tuple[str, ...]:
    """Return what the pair's photos say against the picks of a survey; nothing where they agree.

    Raises
    ------
    InputError
        If they agree with the picks read in another way: exchanged, from the bottom, of copies.
    """
    used, nowhere = solved.points.use[:, None], np.nan
    picks = (solved.points.pixels1, solved.points.pixels2)
    verdict = verdict_of_picks(pair, *(np.where(used, pixels, nowhere) for pixels in picks))
    if verdict.slip is not None:
        raise InputError(f"{solved.survey.where}: {verdict.words}")
    return (verdict.words,) if verdict.words else ()


def verdict_of_picks(pair: Pair, pixels1: FloatArray, pixels2: FloatArray) -> PickVerdict:
    """Return what a pair's photos say of picks of the same points, NaN where not picked. [px]"""
    rows = np.flatnonzero(np.isfinite(np.hstack([pixels1, pixels2])).all(axis=1))
    rows = rows[:: max(1, len(rows) // MOST_HELD)]
    try:
        first, second = (read_grey(photo_info(pair, number).path) for number in (1, 2))
    except InputError:  # what is wrong with a photo says who needs it
        return PickVerdict(likeness=np.zeros(0))
    transfer = np.linalg.solve(pair.image2.plane_from_pixel, pair.image1.plane_from_pixel)
    return held_against_photos((first, second), pixels1[rows], pixels2[rows], transfer)
