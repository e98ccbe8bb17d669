"""Jobs that find what both photos of a pair show: points, targets, faces."""

from __future__ import annotations

from bifocal.collimation.shapes import shapes_from
from bifocal.collimation.work.tasks import (
    FoundPoints,
    FoundShapes,
    MatchTask,
    SuggestTask,
    TargetsTask,
)
from bifocal.faces import suggest_faces
from bifocal.matching import MatchSettings
from bifocal.model import ReliefMap
from bifocal.workbook import match_pair_file, read_pair
from photocore.cli import Progress
from photocore.errors import GeometryError
from photocore.images import read_grey

#: Targets of a pair, at most.
MOST_TARGETS = 5000


def match(task: MatchTask, progress: Progress) -> FoundPoints:
    """Return points that both photos show."""
    progress(0.0, 1.0)
    settings = MatchSettings(count=task.count, features=task.features)
    _, matches = match_pair_file(read_pair(task.pair), settings)
    return {
        "points": [
            {
                "name": name,
                "picks": [first, second],
                "code": kind,
                "note": f"sigma {sigma:.2f} px, misfit {abs(misfit):.2f} px",
            }
            for name, first, second, kind, sigma, misfit in zip(
                matches.ids, matches.pixels1.round(4).tolist(), matches.pixels2.round(4).tolist(),
                matches.kinds, matches.sigma.tolist(), matches.misfit.tolist(), strict=True,
            )
        ]
    }  # fmt: skip


def targets(task: TargetsTask, progress: Progress) -> FoundPoints:
    """Return the targets that both photos show."""
    try:
        matches = match(MatchTask(pair=task.pair, count=MOST_TARGETS, features=False), progress)
    except GeometryError:  # too few to check the pair by
        return {"points": []}
    return {"points": [one for one in matches["points"] if one["code"] != "feature"]}


def suggest(task: SuggestTask, progress: Progress) -> FoundShapes:
    """Return the faces that the program would draw."""
    progress(0.0, 1.0)
    pair = read_pair(task.pair)
    images = [read_grey(pair.photo_file(number)) for number in (1, 2)]
    faces = suggest_faces(ReliefMap.read(task.relief), [pair.image1, pair.image2], images)
    return {"shapes": shapes_from(faces, pair)}
