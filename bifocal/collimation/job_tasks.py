"""What a job is told: of the survey as it stands, and of what is typed on the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

from bifocal.collimation.drawn_lengths import check_lengths
from bifocal.collimation.fields import FieldError, Fields, positive_of
from bifocal.collimation.job_results import finish
from bifocal.collimation.jobs import PageJob
from bifocal.collimation.orienting_tasks import align_task, join_task, rectify_task
from bifocal.collimation.product_graph import causes_of, out_of_date
from bifocal.collimation.session import Session
from bifocal.collimation.typed_options import delivery_of, options_typed
from bifocal.collimation.work import tasks
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.output import free_path


def start_job(session: Session, kind: str, options: Fields, *, quiet: bool = False) -> PageJob:
    """Start a job of a survey; a ``quiet`` one makes way for any that the user starts.

    Raises
    ------
    InputError
        If another one runs, the survey is not far enough for it, or an option is impossible.
    """
    task = partial(task_of, session, kind, options, quiet=quiet)
    # The drawing shows the points as the workbook has them; its writer needs the survey's lock.
    return session.jobs.start(
        kind, task, partial(finish, session), quiet=quiet, first=session.sync.step
    )


def task_of(session: Session, kind: str, options: Fields, *, quiet: bool = False) -> tasks.JobTask:
    """Return what the worker of a job is told.

    Raises
    ------
    InputError
        If the survey is not far enough for it, or an option is impossible.
    """
    if kind not in _TASKS:
        raise FieldError(f"kind: one of {', '.join(_TASKS)}.")
    task = replace(_TASKS[kind](session, options), quiet=quiet, causes=causes_of(session, kind))
    if isinstance(task, tasks.AlignTask):
        # What was proposed before stays: an exchange may bring it back; and what makes way for
        # this may still be writing its own.
        stem = f"{session.products.stem}.{'found' if quiet else 'proposed'}"
        return replace(task, out=free_path(session.files.folder.resolve(), stem, ".pair.json"))
    return task


def _pair_of(session: Session) -> Path:
    """Return the accepted pair file, or refuse by an InputError."""
    if session.files.pair is None:
        raise InputError(remark("page.accept_first"))
    return session.files.pair.resolve()


def _set_of(session: Session) -> Path | None:
    return None if session.photo_set is None else session.photo_set.resolve()


def _match_task(session: Session, options: Fields) -> tasks.MatchTask:
    count = int(min(positive_of(options, "count") or 500, 5000))
    features = options.get("what") != "targets"
    return tasks.MatchTask(pair=_pair_of(session), count=count, features=features)


def _targets_task(session: Session, _options: Fields) -> tasks.TargetsTask:
    path = session.proposed_path or session.files.pair
    if path is None:
        raise InputError(remark("page.align_first"))
    return tasks.TargetsTask(pair=path.resolve())


def _suggest_task(session: Session, _options: Fields) -> tasks.SuggestTask:
    pair, relief = _pair_of(session), session.products.current("relief")
    if relief is None:
        raise InputError(remark("page.no_relief"))
    return tasks.SuggestTask(pair=pair, relief=relief.resolve())


def _relief_task(session: Session, options: Fields) -> tasks.MapTask:
    pair, out = _pair_of(session), session.products.place("relief", ".relief.tif")
    return tasks.MapTask(
        pair=pair, photo_set=_set_of(session), out=out, overwrite=session.products.is_own(out),
        settings=cast("tasks.ReliefSettings", options_typed(options, "gsd", "bounds", "quality")),
    )  # fmt: skip


def _ortho_task(session: Session, options: Fields) -> tasks.ImageTask:
    pair, out = _pair_of(session), session.products.place("ortho", ".ortho.tif")
    relief, keys = session.products.current("relief"), ["gsd", "bounds", "scale"]
    if session.photo_set is None:  # of a set each place is taken from the photo that sees it best
        keys.append("image")
    return tasks.ImageTask(
        pair=pair, photo_set=_set_of(session), out=out, overwrite=session.products.is_own(out),
        settings=cast("tasks.ImageSettings", options_typed(options, *keys)),
        relief=relief and relief.resolve(),
        dpi=cast("tasks.SheetSettings", options_typed(options, "dpi")).get("dpi"),
    )  # fmt: skip


def _deliver_task(session: Session, options: Fields) -> tasks.SheetTask:
    """Return what drawings and documents are told, and what is made before them."""
    products, image = session.products, _ortho_task(session, options)
    folder, overwrite = delivery_of(products, "deliver", "delivered")
    title = options.get("title") or ""
    if not isinstance(title, str) or len(title) > 120:
        raise FieldError(remark("page.title_line"))
    relief_first, ortho_first, stale = None, None, out_of_date(session)
    if products.current("relief") is None or "relief" in stale:
        relief_first = _relief_task(session, options)
        image = replace(image, relief=relief_first.out.resolve())
    if relief_first or products.current("ortho") is None or "ortho" in stale:
        ortho_first = image
    points = session.state.points.values()
    return tasks.SheetTask(
        pair=image.pair, photo_set=image.photo_set, out=folder, overwrite=overwrite,
        settings=image.settings, relief=image.relief, dpi=image.dpi,
        relief_first=relief_first, ortho_first=ortho_first, title=title, stem=products.stem,
        ortho=(products.current("ortho") or image.out).resolve(),
        lengths=check_lengths(session.state, session.pictures.needed_pair()),
        sheet=cast(
            "tasks.SheetSettings", options_typed(options, "scale", "dpi", "sheet", "sections")
        ),
        language=session.spoken,
        mark=session.files.workbook.resolve() if any(p.is_complete for p in points) else None,
    )  # fmt: skip


_TASKS: Mapping[str, Callable[[Session, Fields], tasks.JobTask]] = {
    "align": align_task,
    "join": lambda session, _: join_task(session, _pair_of(session)),
    "match": _match_task,
    "targets": _targets_task,
    "relief": _relief_task,
    "ortho": _ortho_task,
    "deliver": _deliver_task,
    "suggest": _suggest_task,
    "rectify": rectify_task,
}
