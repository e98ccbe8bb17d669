"""Far and near exchanged: one step of the journal, whose inverse is exact and which is its own.

What is measured goes with its photo. The orientation, what was made of it and what was drawn on it
are put aside together; the exchange that follows, or undo, brings them back as they were.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bifocal.collimation.records import Change, PickedControl, PickedPoint, SurveyState
from bifocal.collimation.shapes import places_of
from bifocal.model.pair import Pair
from bifocal.survey.observations import DOUBT_CODES
from photocore.provenance import known_hash

if TYPE_CHECKING:
    from bifocal.collimation.session import Session

#: Kind of files that belong to an orientation that was put aside.
ASIDE = "aside"
_ORIENTED = ("relief", "ortho", "deliver", "set", "pair")


def fields_of_exchange(session: Session) -> dict[str, Any]:
    """Return what the command is told besides: the orientation's files, shapes re-projected."""
    products, proposal = session.products, session.proposed_path
    made = {name: kind for name, kind in products.made.items() if kind in _ORIENTED}
    told: dict[str, Any] = {
        "step": True, "made": made,
        "causes": {kind: dict(products.causes.get(kind, {})) for kind in {*made.values()}},
    }  # fmt: skip
    if proposal is not None:
        told["proposal"] = {**(session.proposal or {}), "sha256": known_hash(proposal)}
    if (pair := session.pictures.pair) is not None:
        told["corners"] = {
            shape.name: [
                [*pixel, corner[2]]
                for pixel, corner in zip(
                    pair.project(places_of(pair, shape.corners))[1].tolist(), shape.corners,
                    strict=True,
                )
            ]
            for shape in session.state.shapes.values()
        }  # fmt: skip
    return told


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
    after = {"lenses": dict(lenses), "ordered": True, "stage": stage}
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


def follow_exchange(session: Session, changes: list[Change]) -> None:
    """Let photos, pair and products be those of the survey after an exchange, its undo or redo."""
    (swap,) = (one for one in changes if (one.kind, one.key) == ("orientation", ASIDE))
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


def put_aside(session: Session) -> None:
    """Show the photos the other way round; what was made of their orientation stays on the disk."""
    made = [name for name, kind in session.products.made.items() if kind in _ORIENTED]
    if made:
        session.note_made(ASIDE, made)
    session.pictures.show_photos([info.path for info in session.pictures.infos][::-1])


def _unchanged(folder: Path, proposal: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return an orientation that was proposed, if its file is still the same."""
    path = folder / proposal["pair"] if proposal else None
    if proposal is None or path is None or not path.is_file():
        return None
    same = known_hash(path) == proposal["sha256"] and Pair.read(path) is not None
    return {key: value for key, value in proposal.items() if key != "sha256"} if same else None
