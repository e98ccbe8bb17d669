"""The state of a survey as the page gets it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from bifocal.collimation.asked import goodness, oriented_live
from bifocal.collimation.commands import lens_ratio
from bifocal.collimation.drawn_lengths import lengths_shown
from bifocal.collimation.fields import SETUP
from bifocal.collimation.live_orientation import LiveOrientation, lenses_of
from bifocal.collimation.next_steps import advice_of, is_looking, next_steps
from bifocal.collimation.product_graph import GRAPH, out_of_date, proposal_is_current, report_of
from bifocal.collimation.records import GIVES_SCALE
from bifocal.collimation.scale import free_report, is_unscaled, kept_report
from bifocal.collimation.session import Session
from bifocal.collimation.shapes import measures_of
from bifocal.collimation.wording import say, without_options
from bifocal.model import Pair, PhotoSet
from bifocal.orientation import interior_of_photo
from bifocal.reports import precision_in_words
from bifocal.survey import SCALES
from photocore.errors import PhotogrammetryError
from photocore.images import ImageInfo
from photocore.jsonfile import plain
from photocore.remarks import LEVELS, level_of
from photocore.reports import words_of


def state_of(session: Session) -> dict[str, object]:
    """Return everything the page shows, as plain data; see docs/picking.md."""
    with session.lock:
        state, live = session.state, None
        if session.files.pair is None or state.control:
            live = oriented_live(session)
        steps = next_steps(session)
        sentence, advice = advice_of(session, steps["orientation"], live, _remarks(session))
        return {
            "serving": session.serving,
            "revision": session.revision,
            "language": session.spoken,
            "title": session.files.stem,
            "stage": state.stage or _stage(session),
            "workbook": session.files.workbook.name,
            "workbook_waiting": session.sync.waiting,
            "photos": _photos(session),
            "others": _others(session),
            "setup": {key: state.setup.get(key) for key in SETUP},
            "pair": None
            if session.pictures.pair is None
            else _pair(session, session.pictures.pair),
            "control": _control(session, live),
            "tapes": [
                {"from": t.start, "to": t.end, "length": t.length, "sigma": t.sigma}
                for t in state.tapes.values()
            ],
            "live": _live(live),
            "scale": _drawn_length(session),
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
            "levels": _levels(session),
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


def _photos(session: Session) -> list[dict[str, Any]]:
    shown: list[dict[str, Any]] = []
    language = session.spoken
    for number, info in enumerate(session.pictures.infos, start=1):
        typed = session.state.lenses.get(number, {})
        shown.append(
            {
                "image": number,
                "name": info.path.name,
                "width": info.size[0],
                "height": info.size[1],
                "camera": " ".join(word for word in (info.make, info.model, info.lens) if word),
                "focal_mm": typed.get("focal_mm") or info.focal_length,
                "sensor_width_mm": typed.get("sensor_width_mm"),
                "focal_said": _focal_said(session, number, info),
                "missing": _missing(info, typed, language),
            }
        )
    if session.pictures.pair is not None or is_looking(session):
        # An oriented pair knows its cameras; what the program finds out is not asked.
        return [photo | {"missing": []} for photo in shown]
    if len(shown) == 2 and _exchanged(session, shown):
        question = say("ask", "exchange", language, name=shown[0]["name"])
        shown[0]["missing"] = [*shown[0]["missing"], question]
    return shown


def _others(session: Session) -> list[dict[str, object]]:
    """Return the photos beside far and near, and whether they are oriented with the pair."""
    joined, distances = session.photo_set, {}
    if joined is not None and session.pictures.others:
        photos = PhotoSet.read(joined)
        distances = {photo.path.resolve(): photo.distance for photo in photos.photos}
    return [
        {
            "image": number, "name": info.path.name, "width": info.size[0],
            "height": info.size[1], "joined": joined is not None,
            "distance": distances.get(info.path.resolve()),
        }
        for number, info in enumerate(session.pictures.others, start=3)
    ]  # fmt: skip


def _exchanged(session: Session, shown: list[dict[str, object]]) -> bool:
    """Whether lenses or distances say that the far photo is the near one."""
    first, second = (session.state.setup.get(key) for key in ("d1", "d2"))
    nearer = first is not None and second is not None and first < second
    return nearer or (lens_ratio(*shown) or 1.0) < 1.0


def _focal_said(session: Session, number: int, info: ImageInfo) -> str:
    """Say where the focal length comes from and how far it is to be trusted."""
    language, report = session.spoken, kept_report(session)
    if session.pictures.pair is not None and "focal_px" in report:
        focal = report["focal_px"][number - 1]
        share = 100 * report["standard_deviations"].get(f"focal{number}", 0.0) / focal
        return say("focal", "found", language, focal=focal, share=share)
    try:
        interior = interior_of_photo(info, lenses_of(session.state)[number - 1], number)
    except PhotogrammetryError:  # asked for by another question
        return ""
    if interior.is_assumed:
        return ""
    key = "typed" if interior.is_typed else "file"
    return say("focal", key, language, focal=interior.focal, share=100 * interior.sigma_focal)


def _shapes(session: Session) -> list[dict[str, object]]:
    pair = session.pictures.pair
    return [
        {**asdict(shape), **({} if pair is None else plain(measures_of(shape, pair)))}
        for shape in session.state.shapes.values()
    ]


def _drawn_length(session: Session) -> dict[str, object] | None:
    drawn = session.state.scale.get(GIVES_SCALE)
    return None if drawn is None else asdict(drawn)


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


def _missing(info: ImageInfo, typed: Mapping[str, float | None], language: str) -> list[str]:
    """Return what has to be asked of a photo's lens."""
    name = info.path.name
    pitch = typed.get("sensor_width_mm") or info.focal_plane_pitch
    if typed.get("focal_mm") or (info.focal_length and not info.focal_pixels):
        from_equivalent = info.focal_length and info.focal_pixels
        return [] if pitch or from_equivalent else [say("ask", "sensor", language, name=name)]
    return [] if info.focal_pixels else [say("ask", "focal", language, name=name)]


def _pair(session: Session, pair: Pair) -> dict[str, object]:
    grid = session.pictures.grid
    assert grid is not None
    images = []
    for number in (1, 2):
        photo = pair.photo(number)
        lens, media = photo.lens, photo.media
        images.append(
            {
                "photo_from_wall": session.pictures.photo_from_wall(number),
                "lens": None
                if lens is None
                else {
                    "camera_matrix": lens.camera_matrix,
                    "model": lens.model,
                    "coefficients": lens.coefficients,
                },
                "distance": photo.distance,
                "media": None
                if media is None
                else {
                    **media.layers.as_dict(),
                    "z0": media.z0,
                    "distance": photo.distance,
                    "nadir": photo.nadir,
                    "turn": media.rotation,
                },
            }
        )
    centre = np.asarray(pair.zoom_centre)
    return plain(
        {
            "name": str(pair.extra.get("name") or session.files.stem),
            "plane_bounds": grid.bounds,
            "gsd": grid.gsd,
            "wall_size": [grid.width, grid.height],
            "nadir": [pair.photo(n).pixels_from_plane(pair.photo(n).nadir) for n in (1, 2)],
            "zoom_centre": {
                "plane": centre,
                "wall": grid.pixel_of(centre),
                "photo": [pair.photo(n).pixels_from_plane(centre) for n in (1, 2)],
            },
            "images": images,
            "accepted": session.proposed_path is None,
            "current": proposal_is_current(session),
            "scaled": not is_unscaled(session),
            "report": kept_report(session) or None,
            "free_scale": free_report(session) is not None,
            "remarks": [without_options(text, session.spoken) for text in _remarks(session)],
        }
    )


def _remarks(session: Session) -> list[str]:
    """Return what is said of the pair, the worst first."""
    pair, report = session.pictures.pair, report_of(session)
    pasted = (text for paste in session.state.pasted.values() for text in paste.remarks)
    held = (*pasted, *report.get("remarks", ()), *(pair.remarks if pair else ()))
    remarks = dict.fromkeys(held)
    return sorted(remarks, key=lambda text: LEVELS.index(level_of(text)))


def _levels(session: Session) -> dict[str, str]:
    """Return how much each remark weighs that is more than a hint, by its words."""
    weights = {
        without_options(text, session.spoken): level_of(text)
        for text in (*_remarks(session), session.pick_doubt or "")
    }
    return {words: level for words, level in weights.items() if level != "hint"}


def _control(session: Session, live: LiveOrientation | None) -> list[dict[str, object]]:
    residuals = _residuals(session, live)
    return [
        {
            "name": point.name,
            **dict(zip(("X", "Y", "r"), point.known, strict=True)),
            "picks": picks_as_dict(point.picks),
            "use": point.use,
            "residual": residuals.get(point.name),
        }
        for point in session.state.sorted_control()
    ]


def _residuals(session: Session, live: LiveOrientation | None) -> dict[str, Any]:
    """Return the residuals of the proposed orientation, else those of control points alone."""
    residuals: dict[str, Any] = {} if live is None else dict(live.residuals)
    if session.proposal is not None and proposal_is_current(session):
        report = session.proposal["report"].get("control", [])
        residuals |= {entry["id"]: entry["residual_px"] for entry in report}
    return {
        name: plain({"1": _both(values[:2]), "2": _both(values[2:])})
        for name, values in residuals.items()
    }


def _both(values: Any) -> list[float] | None:
    shown = [value for value in values if value is not None and np.isfinite(value)]
    return shown if len(shown) == 2 else None


def _live(live: LiveOrientation | None) -> dict[str, object] | None:
    if live is None:
        return None
    return plain({"error": live.error, "deviations": live.deviations, "distances": live.distances})


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


def picks_as_dict(picks: Any) -> dict[str, list[float] | None]:
    """Return both picks by the number of the photo."""
    return {str(n): None if pick is None else list(pick) for n, pick in enumerate(picks, start=1)}
