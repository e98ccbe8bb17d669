"""The scale of an orientation that the photos alone gave, before and after it is accepted."""

from __future__ import annotations

from typing import cast

from bifocal.collimation.proposals import Report, copy_pair, measure_of, rescale
from bifocal.collimation.survey_on_page import SurveyOnPage
from photocore.output import free_path


def kept_report(session: SurveyOnPage) -> Report:
    """Return what was reported of the orientation shown; empty where a file gave it."""
    record = session.proposal or session.state.orientation.get("pair") or {}
    return cast("Report", record.get("report") or {})


def free_report(session: SurveyOnPage) -> Report | None:
    """Return the same if the photos alone gave it."""
    report = kept_report(session)
    return report if report.get("free_scale") else None


def is_unscaled(session: SurveyOnPage) -> bool:
    """Whether it waits for its scale."""
    report = free_report(session)
    return report is not None and not report.get("scale")


def follow_scale(session: SurveyOnPage) -> None:
    """Bring it to the scale that is known now; an accepted one is proposed again."""
    path, measure, report = session.proposed_path, measure_of(session.state), free_report(session)
    if report is None or report.get("scale") == measure:
        return
    if path is None:
        if measure is None or session.files.pair is None:
            return
        stem = f"{session.products.stem}.proposed"
        path = free_path(session.files.folder.resolve(), stem, ".pair.json")
        copy_pair(session.files.pair, path)
    session.note_proposed(path, rescale(path, report, measure))
