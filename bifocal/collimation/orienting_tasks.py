"""What jobs are told that set photos up: what was picked, taped and typed of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bifocal.collimation.fields import FieldError, Fields, positive_of, tupled
from bifocal.collimation.live_orientation import control_of, lenses_of, site_of
from bifocal.collimation.proposals import NOMINAL
from bifocal.collimation.session import Session
from bifocal.collimation.stated_media import lacking, media_of
from bifocal.collimation.typed_options import delivery_of, options_typed
from bifocal.collimation.wording import say
from bifocal.collimation.work.tasks import AlignTask, JoinTask, RectifyTask
from bifocal.orientation import AlignOptions, Control, KnownLens
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns


def align_task(session: Session, options: Fields) -> AlignTask:
    """Return what is told of two photos that are to be oriented."""
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
    by_itself = way not in ("control", "as set up")
    how = AlignOptions(
        lenses=lenses_of(state),
        site=site,
        auto=by_itself,
        one_lens=by_itself,
        as_set_up=way == "as set up",
        media=media_of(state.setup, session.pictures.pair),
        world=next((p.frame for p in state.pasted.values() if p.frame), None),
    )
    if way == "control":
        how = with_tables(session, control, how)
    far, near = (info.path.resolve() for info in infos)
    return AlignTask(far=far, near=near, out=Path(), options=how, free_scale=free)


def join_task(session: Session, path: Path) -> JoinTask:
    """Return what is told of an accepted pair, so that further photos are adjusted with it."""
    products, photos = session.products, session.pictures
    pair, control = photos.needed_pair(), control_of(session.state)
    first, second = (
        _lens_of(lens, photos.infos[number].focal_pixels, pair.extra.get("setup", {}), number)
        for number, lens in enumerate(lenses_of(session.state))
    )
    how = AlignOptions(lenses=(first, second), other_lenses=first)
    measured = (np.isfinite(control.pixels1) & np.isfinite(control.pixels2)).all(axis=1)
    if (measured & np.isfinite(control.xyz[:, :2]).all(axis=1)).sum() >= 4:
        how = with_tables(session, control, how, photos=len(session.all_photos))
    everything = [one.resolve() for one in session.all_photos]
    out = products.place("set", "-set.photos.json").resolve()
    return JoinTask(pair=path, photos=everything, out=out, options=how)


def _lens_of(
    typed: KnownLens, of_file: float | None, setup: Mapping[str, Sequence[float]], number: int
) -> KnownLens:
    """Return what is known of a lens: what the pair found, where nobody and no file tells."""
    focals = setup.get("focal_px")
    if typed.focal or of_file or not focals:
        return typed
    return KnownLens(focal=focals[number], pixel_size=1.0)


def rectify_task(session: Session, options: Fields) -> RectifyTask:
    """Return what is told of one photo alone that is brought to scale by a rectangle."""
    infos = session.pictures.infos
    if len(infos) != 1:
        raise InputError(remark("page.one_alone"))
    corners = tupled(options.get("corners") or ())
    width, height = (positive_of(options, key) for key in ("width", "height"))
    if len(corners) != 4 or width is None or height is None:
        raise FieldError(remark("page.rectangle"))
    folder, overwrite = delivery_of(session.products, "rectified", "rectified")
    lens = session.state.lenses.get(1, {})
    return RectifyTask(
        photo=infos[0].path.resolve(),
        out=session.products.place("rectified", "-rectified.tif").resolve(),
        folder=folder.resolve(),
        overwrite=overwrite,
        corners=np.array(corners, dtype=np.float64),
        sides=(width, height),
        settings={
            "focal": lens.get("focal_mm"),
            "sensor_width": lens.get("sensor_width_mm"),
            "language": session.spoken,
            **options_typed(options, "scale"),
        },
    )


def _through_media(session: Session, way: str, distances: Sequence[float | None]) -> str:
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
    if None in distances[:2]:
        raise InputError(say("media", "control", language))
    return "as set up"


def with_tables(
    session: Session, control: Control, options: AlignOptions, photos: int = 2
) -> AlignOptions:
    """Write control points and tapes as the tables of `bifocal align`; return options with them."""
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
    options = replace(options, control=_write_own(session, "control", columns))
    if not control.lengths:
        return options
    starts, ends, lengths = zip(*control.lengths, strict=True)
    tapes: Columns = {
        "from": [control.ids[i] for i in starts],
        "to": [control.ids[i] for i in ends],
        "length [m]": np.array(lengths),
        "sigma [m]": np.array(control.sigma_lengths),
    }
    return replace(options, lengths=_write_own(session, "lengths", tapes))


def _write_own(session: Session, kind: str, columns: Columns) -> Path:
    """Write a table of the page's own; return where it is."""
    path = session.products.place(kind, f".{kind}.csv")
    write_csv(path, columns, overwrite=session.products.is_own(path))
    session.note_made(kind, [path.name])
    return path.resolve()
