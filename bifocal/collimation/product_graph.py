"""The products of the page as a graph: what each is made of, and so which are out of date.

A product is a node: its causes are the survey's own (pair, points, what was drawn) or other
products. When it is made, the digests of its causes go into the journal; where one is another now,
or a cause is out of date itself, the product is out of date because of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from bifocal.collimation.proposals import Report
from bifocal.collimation.shapes import outlines_of
from bifocal.collimation.survey_on_page import SurveyOnPage
from bifocal.faces import beside
from bifocal.files import MadeFrom, photos_of
from photocore.errors import PhotogrammetryError
from photocore.jsonfile import plain
from photocore.provenance import digest_of, known_hash

#: Each product and its causes, in the order in which they are made.
GRAPH: Mapping[str, tuple[str, ...]] = {
    "align": ("control", "site"),
    "relief": ("pair", "faces"),
    "ortho": ("pair", "faces", "relief"),
    "deliver": ("pair", "faces", "relief", "ortho", "points", "outlines"),
}


def causes_of(session: SurveyOnPage, kind: str) -> dict[str, str]:
    """Return the digests of a product's causes as they are now; empty of what there is not."""
    return {cause: _digest(session, cause) for cause in GRAPH.get(kind, ())}


def out_of_date(session: SurveyOnPage) -> dict[str, list[str]]:
    """Return the products that are there and are out of date, and because of what."""
    stale: dict[str, list[str]] = {}
    for kind, causes in GRAPH.items():
        if session.products.current(kind) is None:
            continue
        recorded = session.products.causes.get(kind) or _recorded_in(session, kind)
        now = causes_of(session, kind) if recorded else {}
        changed = [c for c in causes if c in recorded and recorded[c] != now[c]]
        changed += [c for c in causes if c in stale and c not in changed]
        if changed:
            stale[kind] = changed
    return stale


def proposal_is_current(session: SurveyOnPage) -> bool:
    """Whether the proposed orientation was made from what is typed and picked now.

    What gives the scale of one that has none is taken up as it is typed.
    """
    return causes_hold(session, report_of(session))


def report_of(session: SurveyOnPage) -> Report:
    """Return what was reported of the orientation that waits to be accepted; nothing of none."""
    return Report() if session.proposal is None else session.proposal["report"]


def causes_hold(session: SurveyOnPage, report: Report) -> bool:
    """Whether the causes that a report names are as they were."""
    causes = report.get("causes", {})
    return all(_digest(session, cause) == digest for cause, digest in causes.items())


def causes_again(session: SurveyOnPage, report: Report) -> dict[str, str]:
    """Return the causes that a report names, as they are now."""
    return {cause: _digest(session, cause) for cause in report.get("causes", {})}


def _digest(session: SurveyOnPage, cause: str) -> str:
    """Return what tells the state of a cause from another one."""
    pair, products, state = session.accepted_pair, session.products, session.state
    if cause == "control":
        control: list[Any] = [
            [one.name, one.known, one.picks]
            for one in state.sorted_control()
            if one.use and one.picks != (None, None) and one.known != (None, None, None)
        ]
        tapes = [asdict(tape) for tape in state.tapes.values()]
        lenses = {str(image): lens for image, lens in state.lenses.items()}
        spot = [asdict(one) for one in state.wall.values()]
        return digest_of(plain([control, tapes, lenses, spot]))[:16]
    if cause == "site":
        return digest_of(plain(state.setup))[:16]
    if cause in GRAPH:
        path = products.current(cause)
        return "" if path is None else known_hash(path)[:16]
    if pair is None:
        return ""
    if cause == "pair":
        return digest_of(dict(MadeFrom.of(photos_of(pair)).cameras))[:16]
    if cause == "faces":
        path = None if session.files.pair is None else beside(session.files.pair)
        return known_hash(path)[:16] if path is not None and path.is_file() else ""
    if cause == "points":
        records: list[Any] = [*state.sorted_points(), *state.lines.values()]
        return digest_of(plain([asdict(one) for one in records]))[:16]
    return digest_of(plain(outlines_of(state, pair)))[:16]


def _recorded_in(session: SurveyOnPage, kind: str) -> dict[str, str]:
    """Return what a map itself tells of its pair, where the journal of an older version does not.

    The digest of the pair as it is now, if the map was made from it; another one, if not.
    """
    path, pair = session.products.current(kind), session.accepted_pair
    if path is None or pair is None or path.suffix != ".tif":
        return {}
    try:
        differences = set(MadeFrom.read(path).differences(MadeFrom.of(photos_of(pair))))
    except PhotogrammetryError:
        return {}
    return {"pair": "another"} if differences & {"pair", "photos"} else {}
