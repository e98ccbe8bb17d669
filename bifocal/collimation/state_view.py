"""The state of a survey as the page gets it."""

from __future__ import annotations

from typing import Any

import numpy as np

from bifocal.collimation.commands import SETUP
from bifocal.collimation.session import Session
from bifocal.model.pair import Pair
from photocore.jsonfile import plain


def state_of(session: Session) -> dict[str, Any]:
    """Return everything the page shows, as plain data; see docs/picking.md."""
    with session.lock:
        state = session.state
        return {
            "revision": session.revision,
            "language": state.language or session.language,
            "title": session.files.stem,
            "stage": state.stage or _stage(session),
            "workbook": session.files.workbook.name,
            "workbook_waiting": session.sync.waiting,
            "photos": _photos(session),
            "setup": {key: state.setup.get(key) for key in SETUP},
            "pair": None if session.pair is None else _pair(session, session.pair),
            "control": _control(session),
            "tapes": [
                {"from": t.start, "to": t.end, "length": t.length, "sigma": t.sigma}
                for t in state.tapes.values()
            ],
            "advice": [],
            "points": _points(session),
            "lines": [
                {"name": x.name, "layer": x.layer, "points": list(x.points), "closed": x.closed}
                for x in state.lines.values()
            ],
            "length_unit": _length_unit(session),
            "selection": None,
            "products": {"relief": None, "ortho": None, "files": []},
            "jobs": [],
            "undo": bool(state.done),
            "redo": bool(state.undone),
        }


def _stage(session: Session) -> str:
    """Return where the user is, where he did not say."""
    if len(session.infos) < 2:
        return "photos"
    return "orientation" if session.pair is None else "points"


def _length_unit(session: Session) -> str:
    """Return the unit of s1, s2, delta_s and e1: on the wall where no camera constant is known."""
    known = session.pair is not None and session.pair.image1.principal_distance is not None
    return "mm" if known else "m"


def _photos(session: Session) -> list[dict[str, Any]]:
    shown = []
    for number, info in enumerate(session.infos, start=1):
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
                "missing": [],
            }
        )
    return shown


def _pair(session: Session, pair: Pair) -> dict[str, Any]:
    grid = session.grid
    assert grid is not None
    images = []
    for number in (1, 2):
        lens = pair.photo(number).lens
        images.append(
            {
                "photo_from_wall": session.photo_from_wall(number),
                "lens": None
                if lens is None
                else {
                    "camera_matrix": lens.camera_matrix,
                    "model": lens.model,
                    "coefficients": lens.coefficients,
                },
                "distance": pair.photo(number).distance,
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
            "remarks": list(pair.remarks),
        }
    )


def _control(session: Session) -> list[dict[str, Any]]:
    return [
        {
            "name": point.name,
            **dict(zip(("X", "Y", "r"), point.known, strict=True)),
            "picks": picks_as_dict(point.picks),
            "residual": None,
        }
        for point in session.state.sorted_control()
    ]


def _points(session: Session) -> list[dict[str, Any]]:
    points = session.state.sorted_points()
    results = session.results
    if results is not None:
        results.solve(points)
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
            "result": None if results is None else results.row(point),
        }
        for point in points
    ]


def picks_as_dict(picks: Any) -> dict[str, list[float] | None]:
    """Return both picks by the number of the photo."""
    return {str(n): None if pick is None else list(pick) for n, pick in enumerate(picks, start=1)}
