"""The photos and their orientation as the page gets them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, TypedDict

import numpy as np

from bifocal.collimation.commands import lens_ratio
from bifocal.collimation.live_orientation import LiveOrientation, lenses_of
from bifocal.collimation.next_steps import is_looking
from bifocal.collimation.product_graph import proposal_is_current, report_of
from bifocal.collimation.records import GIVES_SCALE
from bifocal.collimation.scale import free_report, is_unscaled, kept_report
from bifocal.collimation.session import Session
from bifocal.collimation.wording import say, without_options
from bifocal.model import Pair, PhotoSet
from bifocal.orientation import interior_of_photo
from photocore.arrays import FloatArray
from photocore.errors import PhotogrammetryError
from photocore.images import ImageInfo
from photocore.jsonfile import plain
from photocore.remarks import LEVELS, level_of


class PhotoShown(TypedDict):
    """What the page shows of far or near photo."""

    image: int
    name: str
    width: int
    height: int
    camera: str
    focal_mm: float | None
    sensor_width_mm: float | None
    focal_said: str
    missing: list[str]


def photos_shown(session: Session) -> list[PhotoShown]:
    """Return the far and the near photo, and what has to be asked of them."""
    shown: list[PhotoShown] = []
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
        return [{**photo, "missing": []} for photo in shown]
    if len(shown) == 2 and _exchanged(session, shown):
        question = say("ask", "exchange", language, name=shown[0]["name"])
        shown[0]["missing"] = [*shown[0]["missing"], question]
    return shown


def others_shown(session: Session) -> list[dict[str, object]]:
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


def _exchanged(session: Session, shown: list[PhotoShown]) -> bool:
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


def drawn_length_shown(session: Session) -> dict[str, object] | None:
    """Return the length drawn on a photo that gives the scale."""
    drawn = session.state.scale.get(GIVES_SCALE)
    return None if drawn is None else asdict(drawn)


def _missing(info: ImageInfo, typed: Mapping[str, float | None], language: str) -> list[str]:
    """Return what has to be asked of a photo's lens."""
    name = info.path.name
    pitch = typed.get("sensor_width_mm") or info.focal_plane_pitch
    if typed.get("focal_mm") or (info.focal_length and not info.focal_pixels):
        from_equivalent = info.focal_length and info.focal_pixels
        return [] if pitch or from_equivalent else [say("ask", "sensor", language, name=name)]
    return [] if info.focal_pixels else [say("ask", "focal", language, name=name)]


def pair_shown(session: Session, pair: Pair) -> dict[str, object]:
    """Return the orientation: both cameras, the wall, and what is said of it."""
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
            "remarks": [without_options(text, session.spoken) for text in remarks_shown(session)],
        }
    )


def remarks_shown(session: Session) -> list[str]:
    """Return what is said of the pair, the worst first."""
    pair, report = session.pictures.pair, report_of(session)
    pasted = (text for paste in session.state.pasted.values() for text in paste.remarks)
    held = (*pasted, *report.get("remarks", ()), *(pair.remarks if pair else ()))
    remarks = dict.fromkeys(held)
    return sorted(remarks, key=lambda text: LEVELS.index(level_of(text)))


def levels_shown(session: Session) -> dict[str, str]:
    """Return how much each remark weighs that is more than a hint, by its words."""
    weights = {
        without_options(text, session.spoken): level_of(text)
        for text in (*remarks_shown(session), session.pick_doubt or "")
    }
    return {words: level for words, level in weights.items() if level != "hint"}


def control_shown(session: Session, live: LiveOrientation | None) -> list[dict[str, object]]:
    """Return the control points, with their residuals."""
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


def _residuals(session: Session, live: LiveOrientation | None) -> dict[str, object]:
    """Return the residuals of the proposed orientation, else those of control points alone."""
    residuals: dict[str, Sequence[float | None] | FloatArray] = (
        {} if live is None else dict(live.residuals)
    )
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


def live_shown(live: LiveOrientation | None) -> dict[str, object] | None:
    """Return what the control points alone tell of both cameras."""
    if live is None:
        return None
    return plain({"error": live.error, "deviations": live.deviations, "distances": live.distances})


def picks_as_dict(picks: Any) -> dict[str, list[float] | None]:
    """Return both picks by the number of the photo."""
    return {str(n): None if pick is None else list(pick) for n, pick in enumerate(picks, start=1)}
