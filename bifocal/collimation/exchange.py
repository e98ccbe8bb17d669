"""Far and near exchanged: one step of the journal, whose inverse is exact and which is its own.

What is measured goes with its photo. The orientation, what was made of it and what was drawn on it
are put aside together; the exchange that follows, or undo, brings them back as they were.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from bifocal.collimation.proposals import Proposal, ProposalAside
from bifocal.collimation.records import Change, PickedControl, PickedPoint, SurveyState
from bifocal.collimation.shapes import places_of
from bifocal.collimation.survey_on_page import SurveyOnPage
from bifocal.model import Pair
from bifocal.remarks import remark
from bifocal.survey import DOUBT_CODES
from photocore.errors import InputError
from photocore.provenance import known_hash

#: Kind of files that belong to an orientation that was put aside.
ASIDE = "aside"
_ORIENTED = ("relief", "ortho", "deliver", "set", "pair")


def fields_of_exchange(session: SurveyOnPage) -> dict[str, object]:
    """Return what the command is told besides: the orientation's files, shapes re-projected.

    Raises
    ------
    InputError
        If there are no two photos, or the survey was begun with a pair file, whose order stays.
    """
    products, file = session.products, session.files.pair
    if len(session.pictures.infos) != 2:
        raise InputError(remark("page.give_photos"))
    if file is not None and not products.is_own(file):
        raise InputError(remark("page.begun_with_pair", name=file.name))
    files = {name: kind for name, kind in products.made.items() if kind in _ORIENTED}
    fields: dict[str, object] = {
        "step": True, "made": files,
        "causes": {kind: dict(products.causes.get(kind, {})) for kind in {*files.values()}},
    }  # fmt: skip
    fields |= _proposal_now(session)
    if (pair := session.pictures.pair) is not None:
        fields["corners"] = {
            shape.name: [
                [*pixel, corner[2]]
                for pixel, corner in zip(
                    pair.project(places_of(pair, shape.corners))[1].tolist(), shape.corners,
                    strict=True,
                )
            ]
            for shape in session.state.shapes.values()
        }  # fmt: skip
    return fields


def exchange_step(
    state: SurveyState, command: Mapping[str, Any], lenses: Mapping[int, Any]
) -> list[Change]:
    """Return the changes of an exchange; ``lenses`` are those of the photos afterwards."""
    back = state.orientation.get(ASIDE) or {}
    aside = {
        "accepted": state.orientation.get("pair"), "shapes": dict(state.shapes),
        "wall": dict(state.wall), "stage": state.stage,
        **{key: command.get(key) for key in ("made", "causes", "proposal")},
    }  # fmt: skip
    corners = command.get("corners", {})
    shapes = {
        name: replace(shape, corners=tuple(map(tuple, corners[name])))
        for name, shape in state.shapes.items()
        if name in corners
    } or dict(back.get("shapes", {}))
    stage = back.get("stage", state.stage)
    if not back.get("accepted") and stage in ("points", "products"):
        stage = "orientation"
    by_user = command.get("found") is not True  # a job leaves the order open
    after = {"lenses": dict(lenses), "ordered": by_user, "stage": stage}
    before = {key: getattr(state, key) for key in after}
    turned: dict[str, dict[str, Any]] = {
        "points": {name: turned_picks(one) for name, one in state.points.items()},
        "control": {name: turned_picks(one) for name, one in state.control.items()},
        "scale": {key: replace(one, image=3 - one.image) for key, one in state.scale.items()},
        "wall": dict(back.get("wall", {})),
        "shapes": shapes,
        "orientation": {
            ASIDE: aside, **({"pair": back["accepted"]} if back.get("accepted") else {})
        },
    }  # fmt: skip
    changes = [Change("settings", "photos", before, after)]
    for kind, records in turned.items():
        old: dict[str, Any] = getattr(state, kind)
        for key in {**old, **records}:
            changes.append(Change(kind, key, old.get(key), records.get(key)))
    return changes


def turned_picks(record: Any) -> Any:
    """Return a point or control point with the picks of both photos exchanged."""
    assert isinstance(record, PickedPoint | PickedControl)
    turned = replace(record, picks=record.picks[::-1])
    if isinstance(turned, PickedPoint) and turned.code.upper().startswith(DOUBT_CODES):
        return replace(turned, code=turned.code.translate({49: "2", 50: "1"}))  # photo in doubt
    return turned


def proposal_noted(
    session: SurveyOnPage, command: Mapping[str, object], changes: list[Change]
) -> dict[str, object]:
    """Return the undo of an exchange with what is proposed after it; other commands as they are."""
    undone = command["op"] == "undo" and any(map(_is_swap, changes))
    return {**command, **(_proposal_now(session) if undone else {})}


def proposal_kept(command: Mapping[str, object], changes: list[Change]) -> list[Change]:
    """Return the changes of an undo, after which redo brings back what was proposed before it."""
    if "proposal" not in command:
        return changes
    kept: Any = {"made": {}, "causes": {}, "proposal": command["proposal"]}
    return [replace(one, after=kept) if _is_swap(one) else one for one in changes]


def _is_swap(change: Change) -> bool:
    """Whether a change says what an exchange put aside."""
    return (change.kind, change.key) == ("orientation", ASIDE)


def _proposal_now(session: SurveyOnPage) -> dict[str, ProposalAside]:
    """Return the orientation that waits to be accepted, with the digest of its file."""
    path, proposal = session.proposed_path, session.proposal
    if path is None or proposal is None:
        return {}
    return {"proposal": ProposalAside(**proposal, sha256=known_hash(path))}


def follow_exchange(session: SurveyOnPage, changes: list[Change]) -> None:
    """Let photos, pair and products be those of the survey after an exchange, its undo or redo."""
    (swap,) = filter(_is_swap, changes)
    back: Any = swap.before or {}
    folder = session.files.folder
    put_aside(session)
    for name, kind in (back.get("made") or {}).items():
        session.note_made(kind, [name], back["causes"].get(kind))
    accepted: Any = session.state.orientation.get("pair")
    pair = folder / accepted["pair"] if accepted else None
    session.take_files(pair, _unchanged(folder, back.get("proposal")))
    if pair is not None:
        session.show_products()


def put_aside(session: SurveyOnPage) -> None:
    """Show the photos the other way round; what was made of their orientation stays on the disk."""
    files = [name for name, kind in session.products.made.items() if kind in _ORIENTED]
    if files:
        session.note_made(ASIDE, files)
    session.pictures.show_photos([info.path for info in session.pictures.infos][::-1])


def _unchanged(folder: Path, proposal: ProposalAside | None) -> Proposal | None:
    """Return an orientation that was proposed, if its file is still the same."""
    path = folder / proposal["pair"] if proposal else None
    if proposal is None or path is None or not path.is_file():
        return None
    same = known_hash(path) == proposal["sha256"] and Pair.read(path) is not None
    kept = {key: value for key, value in proposal.items() if key != "sha256"}
    return cast("Proposal", kept) if same else None
