"""Kinds of survey workbooks: which formulas one has, and whether they are what is needed."""

from __future__ import annotations

from pathlib import Path

from bifocal.remarks import remark
from bifocal.survey import NORMALS, SurveyInput
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.reading.setup_reader import media_count
from photocore.errors import InputError
from photocore.output import free_path


def is_earlier(survey: SurveyInput) -> bool:
    """Tell by its names whether a workbook's sheets were made by an earlier version."""
    names = () if survey.book is None else survey.book.names
    newest = "setup_missing" if "sigma_px" in names else "enlargement_1"
    # What stands beside what from the start.
    came = {"b_lever": newest, "g_k": "g_space", "g_space": "g_alarm"}
    return any(old in names and new not in names for old, new in came.items())


def refuse_earlier(source: Path, survey: SurveyInput) -> None:
    """Refuse to change a workbook in place whose formulas an earlier version made.

    Raises
    ------
    InputError
        Naming the way out.
    """
    if is_earlier(survey):
        raise InputError(remark("survey.earlier_version", of=source, other=_other(source)))


def is_same_kind(survey: SurveyInput, content: SurveyContent) -> bool:
    """Tell whether a survey workbook has the formulas that what came out of it needs."""
    names = () if survey.book is None else survey.book.names
    measured = content.is_pair == ("col1" in survey.table.present)
    alike = content.has_lens == ("lens_1_k1" in names)
    alike &= content.media_cells == media_count(names)
    alike &= content.leaning == (NORMALS[0][0] in names)
    return measured and alike and not is_earlier(survey)


def check_kind(source: Path, survey: SurveyInput, content: SurveyContent) -> None:
    """Refuse to change a survey workbook for coordinates into one for raw pixels, or the reverse.

    Nor one for photos in air into one for media, nor one of an earlier version.

    Raises
    ------
    InputError
        Naming the way out.
    """
    refuse_earlier(source, survey)
    if is_same_kind(survey, content):
        return
    kind = "coordinates in mm or px" if content.is_pair else "raw pixels of a pair"
    if content.is_pair == ("col1" in survey.table.present):
        kind = "ports parallel to the wall" if content.leaning else "photos in air"
    raise InputError(remark("survey.other_kind", of=source, kind=kind, other=_other(source)))


def _other(source: Path) -> str:
    """Return the name of a new workbook beside one that stays as it is."""
    return free_path(source.parent, f"{source.stem}-result", source.suffix).name
