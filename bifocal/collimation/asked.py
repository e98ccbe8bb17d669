"""What the page asks of a survey beside its state: precision, distances."""

from __future__ import annotations

from collections.abc import Sequence

from bifocal.collimation.live_orientation import LiveOrientation, live_orientation
from bifocal.collimation.measures import measure
from bifocal.collimation.session import Session
from bifocal.remarks import remark
from bifocal.survey import WallPrecision
from bifocal.survey.wall_precision import wall_precision
from photocore.errors import InputError


def oriented_live(session: Session) -> LiveOrientation | None:
    """Return what the control points tell by themselves; None without photos."""
    state, infos = session.state, session.pictures.infos
    if len(infos) != 2:
        return None
    pair, language = session.pictures.pair, session.spoken
    facts = (dict(state.control), dict(state.tapes), state.setup, state.lenses, language, id(pair))
    if session.orientation is None or session.orientation[0] != facts:
        session.orientation = facts, live_orientation(state, infos, language, pair)
    return session.orientation[1]


def goodness(session: Session) -> WallPrecision | None:
    """Return how precisely the wall is known; None before the photos are oriented."""
    if session.results is None:
        return None
    if session.good is None or session.good[0] is not session.results:
        first, second = (info.size for info in session.pictures.infos[:2])
        pair, solve = session.pictures.needed_pair(), session.results.solved
        session.good = session.results, wall_precision(pair, (first, second), solve)
    return session.good[1]


def measured(session: Session, names: Sequence[str]) -> dict[str, float | None]:
    """Return distances and angles between points."""
    session.pictures.needed_pair()
    points, results = [], session.results
    for name in names:
        point = session.state.points.get(name)
        if point is None:
            raise InputError(remark("page.no_point", name=name))
        if results is None or not point.is_complete:
            raise InputError(remark("page.point_in_one", name=name))
        points.append(point)
    if results is None or len(points) < 2:
        raise InputError(remark("page.measure_of_two"))
    return measure(*results.joint(points))
