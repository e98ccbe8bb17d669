"""The state of a survey as the page gets it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict

from bifocal.collimation.asked import goodness, oriented_live
from bifocal.collimation.drawn_lengths import lengths_shown
from bifocal.collimation.fields import SETUP
from bifocal.collimation.next_steps import advice_of, is_looking, next_steps
from bifocal.collimation.product_graph import GRAPH, out_of_date
from bifocal.collimation.scale import is_unscaled
from bifocal.collimation.server.orientation_view import (
    control_shown,
    drawn_length_shown,
    levels_shown,
    live_shown,
    others_shown,
    pair_shown,
    photos_shown,
    picks_as_dict,
    remarks_shown,
)
from bifocal.collimation.session import Session
from bifocal.collimation.shapes import measures_of
from bifocal.collimation.wording import say
from bifocal.reports import precision_in_words
from bifocal.survey import SCALES
from photocore.jsonfile import plain
from photocore.reports import words_of


def state_of(session: Session) -> dict[str, object]:
    """Return everything the page shows, as plain data; see docs/picking.md."""
    with session.lock:
        state, live = session.state, None
        if session.files.pair is None or state.control:
            live = oriented_live(session)
        steps = next_steps(session)
        sentence, advice = advice_of(session, steps["orientation"], live, remarks_shown(session))
        return {
            "serving": session.serving,
            "revision": session.revision,
            "language": session.spoken,
            "title": session.files.stem,
            "stage": state.stage or _stage(session),
            "workbook": session.files.workbook.name,
            "workbook_waiting": session.sync.waiting,
            "photos": photos_shown(session),
            "others": others_shown(session),
            "setup": {key: state.setup.get(key) for key in SETUP},
            "pair": None
            if session.pictures.pair is None
            else pair_shown(session, session.pictures.pair),
            "control": control_shown(session, live),
            "tapes": [
                {"from": t.start, "to": t.end, "length": t.length, "sigma": t.sigma}
                for t in state.tapes.values()
            ],
            "live": live_shown(live),
            "scale": drawn_length_shown(session),
            "check_lengths": lengths_shown(
                state, None if is_unscaled(session) else session.pictures.pair
            ),
            "looking": is_looking(session),
            "good": _how_good(session),
            "drawing_scale": _drawing_scale(session),
            "steps": {
                stage: asdict(step) | ({"text": sentence} if stage == "orientation" else {})
                for stage, step in steps.items()
            },
            "advice": advice,
            "levels": levels_shown(session),
            "points": _points(session),
            "lines": [
                {"name": x.name, "layer": x.layer, "points": list(x.points), "closed": x.closed}
                for x in state.lines.values()
            ],
            "shapes": _shapes(session),
            "suggested": session.suggested,
            "misfits": session.misfits,
            "length_unit": _length_unit(session),
            "selection": None,
            "products": {
                "relief": session.products.facts("relief"),
                "ortho": session.products.facts("ortho"),
                "rectified": session.products.facts("rectified"),
                "files": session.products.listed(session.files.workbook),
                **_made_from(session),
            },
            "jobs": [
                {**job.as_dict(), "cured": job.state == "failed" and job.ended_at < state.revision}
                for job in session.jobs.jobs.values()
            ],
            "undo": bool(state.done),
            "redo": bool(state.undone),
        }


def _made_from(session: Session) -> dict[str, dict[str, str]]:
    """Return in words what products were made from, and why some are out of date, by kind."""

    def in_words(sentence: str, causes: Collection[str]) -> str:
        listed = ", ".join(say("stale", cause, session.spoken) for cause in causes)
        return say("stale", sentence, session.spoken, causes=listed)

    changed, state = out_of_date(session), session.state
    lacks = {
        "points": not (state.points or state.lines),
        "outlines": not any(shape.kind == "outline" for shape in state.shapes.values()),
    }
    causes = {
        kind: [c for c in GRAPH["deliver"] if digests.get(c) and not lacks.get(c)]
        for kind, digests in session.products.causes.items()
    }
    return {
        "stale": {kind: in_words("since", of) for kind, of in changed.items()},
        "made_from": {
            kind: in_words("made_from", of)
            for kind, of in causes.items()
            if of and kind not in changed and session.products.current(kind)
        },
    }


def _stage(session: Session) -> str:
    """Return where the user is, where he did not say."""
    if len(session.pictures.infos) < 2:
        return "photos"
    oriented = session.pictures.pair is not None and session.proposed_path is None
    return "points" if oriented else "orientation"


def _length_unit(session: Session) -> str:
    """Return the unit of s1, s2, delta_s and e1: on the wall where no camera constant is known."""
    is_scaled = (
        session.pictures.pair is not None
        and session.pictures.pair.image1.principal_distance is not None
    )
    return "mm" if is_scaled else "m"


def _shapes(session: Session) -> list[dict[str, object]]:
    pair = session.pictures.pair
    return [
        {**asdict(shape), **({} if pair is None else plain(measures_of(shape, pair)))}
        for shape in session.state.shapes.values()
    ]


def _how_good(session: Session) -> str:
    """Say in a line how good relief is; nothing where that is not known."""
    good = None if is_unscaled(session) else goodness(session)
    if good is None:
        return ""
    return precision_in_words(good, words_of("bifocal.reports", session.spoken))


def _drawing_scale(session: Session) -> int | None:
    """Return the finest drawing scale that holds, else the coarsest there is; None: not known."""
    good = None if is_unscaled(session) else goodness(session)
    return None if good is None else good.scale or SCALES[-1]


def _points(session: Session) -> list[dict[str, object]]:
    points = session.state.sorted_points()
    results = session.results
    if results is not None:
        results.solve(points)
    rows = [None if results is None else results.row(point) for point in points]
    return [
        {
            "name": point.name,
            "type": point.type,
            "code": point.code,
            "note": point.note,
            "use": point.use,
            "picks": picks_as_dict(point.picks),
            "reference": point.reference
            and dict(zip(("X", "Y", "r"), point.reference, strict=True)),
            "deleted": False,
            **{key: (row or {}).get(key) for key in ("r", "sigma_r", "flag")},
            "result": row,
        }
        for point, row in zip(points, rows, strict=True)
    ]
