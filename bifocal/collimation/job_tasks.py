"""What a job is told, and what becomes of its result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from bifocal.collimation.drawing import write_points_drawing
from bifocal.collimation.drawn_lengths import check_lengths
from bifocal.collimation.fields import FieldError, positive_of, tupled
from bifocal.collimation.jobs import PageJob
from bifocal.collimation.live_orientation import control_of, lenses_of, site_of
from bifocal.collimation.product_graph import causes_of, out_of_date
from bifocal.collimation.proposals import NOMINAL, Report, discard_pair
from bifocal.collimation.session import Session
from bifocal.collimation.shapes import outlines_of
from bifocal.collimation.stated_media import lacking, media_as_dict, media_of
from bifocal.collimation.wording import say, without_options
from bifocal.options import OF_PAIR
from bifocal.orientation import Control, KnownLens
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.jsonfile import plain
from photocore.output import free_path
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns

KINDS = ("align", "join", "match", "targets", "relief", "ortho", "deliver", "suggest", "rectify")
Options = Mapping[str, Any]


def start_job(session: Session, kind: str, options: Options, *, quiet: bool = False) -> PageJob:
    """Start a job of a survey; a ``quiet`` one makes way for any that the user starts.

    Raises
    ------
    InputError
        If another one runs, the survey is not far enough for it, or an option is impossible.
    """

    def task() -> dict[str, object]:
        job_task = task_of(session, kind, options) | {"quiet": quiet}
        job_task["causes"] = causes_of(session, kind)
        if kind == "align":  # what was proposed before stays: an exchange may bring it back
            # What makes way for this may still be writing its own.
            stem = f"{session.products.stem}.{'found' if quiet else 'proposed'}"
            job_task["out"] = str(free_path(session.files.folder.resolve(), stem, ".pair.json"))
        return job_task

    # The drawing shows the points as the workbook has them; its writer needs the survey's lock.
    return session.jobs.start(
        kind, task, partial(finish, session), quiet=quiet, first=session.sync.step
    )


def task_of(session: Session, kind: str, options: Options) -> dict[str, Any]:
    """Return what the worker of a job is told.

    Raises
    ------
    InputError
        If the survey is not far enough for it, or an option is impossible.
    """
    if kind not in KINDS:
        raise FieldError(f"kind: one of {', '.join(KINDS)}.")
    if kind == "align":
        return {"kind": kind, **_align_task(session, options)}
    if kind == "rectify":
        return {"kind": kind, **_rectify_task(session, options)}
    if kind == "targets":
        path = session.proposed_path or session.files.pair
        if path is None:
            raise InputError(remark("page.align_first"))
        return {"kind": kind, "pair": str(path.resolve())}
    if session.files.pair is None:
        raise InputError(remark("page.accept_first"))
    of_set = session.photo_set
    pair = {
        "kind": kind, "pair": str(session.files.pair.resolve()),
        "set": None if of_set is None else str(of_set.resolve()),
    }  # fmt: skip
    if kind == "join":
        return pair | _join_task(session)
    if kind == "match":
        count = positive_of(options, "count") or 500
        return pair | {"count": int(min(count, 5000)), "features": options.get("what") != "targets"}
    if kind == "suggest":
        relief = session.products.current("relief")
        if relief is None:
            raise InputError(remark("page.no_relief"))
        return pair | {"relief": str(relief.resolve())}
    if kind == "relief":
        return pair | _relief_task(session, options)
    task = pair | _ortho_options(session, options)
    if kind == "ortho":
        return task | _ortho_task(session)
    return task | _deliver_options(session, options, pair)


def _relief_task(session: Session, options: Options) -> dict[str, Any]:
    out = session.products.place("relief", ".relief.tif")
    settings = _said(options, "gsd", "bounds", "quality")
    return {"out": str(out), "overwrite": session.products.is_own(out), "options": settings}


def _ortho_task(session: Session) -> dict[str, Any]:
    out = session.products.place("ortho", ".ortho.tif")
    return {"out": str(out), "overwrite": session.products.is_own(out)}


def _said(options: Options, *keys: str) -> dict[str, object]:
    """Return options of a command that are typed on the page, by the command's names."""
    settings = {}
    for key in keys:
        option = OF_PAIR["paper" if key == "sheet" else key]
        if options.get(key) in (None, ""):
            continue
        try:
            settings[option.name] = option.typed(options[key])
        except ValueError as error:
            raise FieldError(f"{key}: expected {error}.") from None
    return settings


def _ortho_options(session: Session, options: Options) -> dict[str, object]:
    relief = session.products.current("relief")
    keys = ["gsd", "bounds", "scale"]
    if session.photo_set is None:  # of a set each place is taken from the photo that sees it best
        keys.append("image")
    return {
        "relief": str(relief.resolve()) if relief else None,
        "options": _said(options, *keys),
        "dpi": _said(options, "dpi").get("dpi"),
    }


def _deliver_options(session: Session, options: Options, pair: Options) -> dict[str, Any]:
    """Return what drawings and documents are told, and what is made before them."""
    products = session.products
    folder = products.folder / f"{products.stem}-delivered"
    is_delivery = any(kind == "deliver" for kind in products.made.values())
    if folder.exists() and not is_delivery:
        folder = free_path(products.folder, f"{products.stem}-delivered")
    title = options.get("title") or ""
    if not isinstance(title, str) or len(title) > 120:
        raise FieldError(remark("page.title_line"))
    before: dict[str, Any] = {}
    stale = out_of_date(session)
    surface = _ortho_options(session, options)
    for kind, task in (("relief", _relief_task(session, options)), ("ortho", _ortho_task(session))):
        if products.current(kind) is None or kind in stale or before:
            before[kind] = {**pair, **task}
            if kind == "relief":
                surface["relief"] = str(Path(task["out"]).resolve())
    if "ortho" in before:
        before["ortho"] = {**before["ortho"], **surface}
    ortho = products.current("ortho") or products.place("ortho", ".ortho.tif")
    return {
        "out": str(folder),
        "overwrite": is_delivery,
        "title": title,
        "stem": products.stem,
        "before": before,
        "relief": surface["relief"],
        "ortho": str(ortho.resolve()),
        "lengths": {
            name: asdict(check)
            for name, check in check_lengths(session.state, session.pictures.needed_pair()).items()
        },
        "drawing": {
            **_said(options, "scale", "dpi", "sheet", "sections"),
            "language": session.spoken,
        },
        "mark": str(session.files.workbook.resolve())
        if any(point.is_complete for point in session.state.points.values())
        else None,
    }


def _align_task(session: Session, options: Options) -> dict[str, object]:
    infos, state = session.pictures.infos, session.state
    if len(infos) != 2:
        raise InputError(remark("page.give_photos"))
    control, site = control_of(state), site_of(state)
    distances = [site.distance1, site.distance2, site.delta_d]
    way = options.get("way") or ("control" if len(control.ids) else "auto")
    way = _through_media(session, way, distances)
    # One measure alone multiplies all lengths, whenever it is typed.
    free = way == "auto" and sum(map(bool, distances)) < 2 and not control.lengths
    if free:
        site = replace(site, distance1=NOMINAL, distance2=None, delta_d=None)
    tables: dict[str, Path | None] = {"control": None, "lengths": None}
    if way == "control":
        tables = _write_control(session, control)
    return {
        "far": str(infos[0].path.resolve()),
        "near": str(infos[1].path.resolve()),
        "site": plain(asdict(site)),
        "lenses": [plain(asdict(lens)) for lens in lenses_of(state)],
        "auto": way not in ("control", "as set up"),
        "as_set_up": way == "as set up",
        "free_scale": free,
        "media": media_as_dict(media_of(state.setup, session.pictures.pair)),
        "world": next((p.frame.to_json() for p in state.pasted.values() if p.frame), None),
        **{key: None if path is None else str(path.resolve()) for key, path in tables.items()},
    }


def _join_task(session: Session) -> dict[str, object]:
    """Return what is told of an accepted pair, so that further photos are adjusted with it."""
    products, photos = session.products, session.pictures
    pair = photos.needed_pair()
    control, lenses = control_of(session.state), []
    measured = (np.isfinite(control.pixels1) & np.isfinite(control.pixels2)).all(axis=1)
    tables: dict[str, Path | None] = {"control": None, "lengths": None}
    if (measured & np.isfinite(control.xyz[:, :2]).all(axis=1)).sum() >= 4:
        tables = _write_control(session, control, photos=len(session.all_photos))
    for number, typed_lens in zip((1, 2), lenses_of(session.state), strict=True):
        focals = pair.extra.get("setup", {}).get("focal_px")
        focal = typed_lens.focal or photos.infos[number - 1].focal_pixels
        # What the pair found of a lens of which no file tells.
        typed_lens = (
            typed_lens
            if focal or not focals
            else KnownLens(focal=focals[number - 1], pixel_size=1.0)
        )
        lenses.append(typed_lens)
    return {
        "photos": [str(path.resolve()) for path in session.all_photos],
        "out": str(products.place("set", "-set.photos.json").resolve()),
        "lenses": [plain(asdict(lens)) for lens in (*lenses, lenses[0])],
        **{key: None if path is None else str(path.resolve()) for key, path in tables.items()},
    }


def _rectify_task(session: Session, options: Options) -> dict[str, object]:
    """Return what is told of one photo alone that is brought to scale by a rectangle."""
    infos = session.pictures.infos
    if len(infos) != 1:
        raise InputError(remark("page.one_alone"))
    corners = tupled(options.get("corners") or ())
    sides = [positive_of(options, key) for key in ("width", "height")]
    if len(corners) != 4 or None in sides:
        raise FieldError(remark("page.rectangle"))
    out = session.products.place("rectified", "-rectified.tif")
    folder = session.products.folder / f"{session.products.stem}-rectified"
    is_delivery = any(kind == "rectified" for kind in session.products.made.values())
    if folder.exists() and not is_delivery:
        folder = free_path(session.products.folder, folder.name)
    lens = session.state.lenses.get(1, {})
    return {
        "photo": str(infos[0].path.resolve()),
        "out": str(out.resolve()),
        "folder": str(folder.resolve()),
        "overwrite": is_delivery,
        "corners": corners,
        "rectangle": sides,
        "focal": lens.get("focal_mm"),
        "sensor_width": lens.get("sensor_width_mm"),
        "language": session.spoken,
        **_said(options, "scale"),
    }


def _through_media(session: Session, way: str, given: list[float | None]) -> str:
    """Return the way to set a pair up: through media by control points, or else as it is typed.

    Raises
    ------
    InputError
        If something of the media is lacking, or neither is given.
    """
    setup, language = session.state.setup, session.spoken
    if missing := lacking(setup):
        raise InputError(say("media", missing, language))
    if not media_of(setup, session.pictures.pair) or way == "control":
        return way
    if None in given[:2]:
        raise InputError(say("media", "control", language))
    return "as set up"


def _write_control(session: Session, control: Control, photos: int = 2) -> dict[str, Path | None]:
    """Write the control points and tapes as the tables that `bifocal align` reads."""
    tables: dict[str, Path | None] = {"control": None, "lengths": None}
    columns: Columns = {"id": list(control.ids)}
    measured = np.where(control.sigma[:, 2:] > control.sigma[:, :1], np.nan, control.xyz[:, 2:])
    xyz = np.hstack([control.xyz[:, :2], measured])
    for key, values in zip(("X [m]", "Y [m]", "r [m]"), xyz.T, strict=True):
        columns[key] = values
    pixels = np.hstack([control.pixels1, control.pixels2]).T
    columns |= dict(zip(("col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]"), pixels, strict=True))
    for number in range(3, photos + 1):  # nothing was picked in these
        columns |= dict.fromkeys(
            (f"col{number} [px]", f"row{number} [px]"), np.full(len(control.ids), np.nan)
        )
    contents = {"control": columns}
    if control.lengths:
        starts, ends, lengths = zip(*control.lengths, strict=True)
        contents["lengths"] = {
            "from": [control.ids[i] for i in starts],
            "to": [control.ids[i] for i in ends],
            "length [m]": np.array(lengths),
            "sigma [m]": np.array(control.sigma_lengths),
        }
    for key, content in contents.items():
        path = session.products.place(key, f".{key}.csv")
        write_csv(path, content, overwrite=session.products.is_own(path))
        session.note_made(key, [path.name])
        tables[key] = path
    return tables


def _write_outlines(session: Session, folder: Path) -> list[str]:
    """Write what was drawn to be measured as a table; return its name, if there is any."""
    pair = session.pictures.pair
    with session.lock:
        drawn = {} if pair is None else outlines_of(session.state, pair)
    if not drawn:
        return []
    columns: Columns = {
        "id": list(drawn), "layer": [str(one["layer"]) for one in drawn.values()],
    }  # fmt: skip
    units = {"width": "m", "height": "m", "area": "m2", "length": "m", "relief": "m"}
    for key, unit in units.items():
        columns[f"{key} [{unit}]"] = np.array([one[key] for one in drawn.values()])
    path = folder / f"{session.products.stem}_outlines.csv"
    write_csv(path, columns, overwrite=path.is_file())
    return [path.name]


def _same(task: Options, *causes: str) -> dict[str, str]:
    """Return the digests of causes as they were when the job began."""
    return {key: value for key, value in (task.get("causes") or {}).items() if key in causes}


def finish(session: Session, task: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Take over what a job made; return what the user should know."""
    kind = task["kind"]
    message = " ".join(without_options(text, session.spoken) for text in result.get("remarks", ()))
    if kind == "align":
        if task.get("quiet") and len(control_of(session.state).ids):
            discard_pair(Path(task["out"]))
            return ""  # the user took it in hand meanwhile
        causes = _same(task, "control", *(() if task["free_scale"] else ("site",)))
        session.propose(Path(task["out"]), cast("Report", {**result, "causes": causes}))
        return message
    if kind == "join":
        path = Path(task["out"])
        session.note_made("set", [*result["lenses"], path.name])
        session.join(path)
        return message
    if kind == "rectify":
        drawn = [f"{Path(task['folder']).name}/{name}" for name in result["files"]]
        session.note_made("rectified", [*drawn, Path(task["out"]).name])
        session.misfits = result["misfits"]
        return " ".join(without_options(text, session.spoken) for text in result["words"][:2])
    if kind == "match":
        session.command({"op": "points.add", "points": result["points"]})
        return ""
    if kind == "targets":
        picks = {point.picks for point in session.state.control.values()}
        new = [one for one in result["points"] if tupled(one["picks"]) not in picks]
        if new:
            session.command({"op": "control.add", "control": new})
        return say("targets", "found" if new else "none", session.spoken, count=len(new))
    if kind == "suggest":
        session.suggested = result["shapes"]
        return "" if result["shapes"] else say("shapes", "none", session.spoken)
    names = [Path(task["out"]).name]
    if kind == "deliver":
        folder = Path(task["out"])
        for first, paths in result["made"].items():
            causes = {**causes_of(session, first), **_same(task, "pair", "faces")}
            session.note_made(first, paths, causes)
        names = [f"{folder.name}/{name}" for name in result["files"]]
        if any(point.is_complete for point in session.state.points.values()):
            drawing = folder / f"{session.products.stem}_points.dxf"
            with session.lock:
                write_points_drawing(session.state, session.results, drawing)
            names.append(f"{folder.name}/{drawing.name}")
        names += [f"{folder.name}/{name}" for name in _write_outlines(session, folder)]
    causes = dict(task.get("causes") or causes_of(session, kind))
    if kind == "deliver":  # relief and orthophoto may have been made before it
        now = causes_of(session, kind)
        causes |= {cause: now[cause] for cause in ("relief", "ortho")}
    session.note_made(kind, names, causes)
    session.show_products()
    return message
