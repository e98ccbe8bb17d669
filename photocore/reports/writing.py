"""A report written as what its name ends in."""

from __future__ import annotations

from pathlib import Path

from photocore.cli import Progress, no_progress
from photocore.output import check_ending
from photocore.reports.document import Document
from photocore.reports.html_page import write_html
from photocore.reports.pdf_pages import write_pdf

_WRITERS = {".html": write_html, ".htm": write_html, ".pdf": write_pdf}


def check_report(path: Path | None) -> None:
    """Refuse a file that no report can be written as; None is no file.

    Raises
    ------
    InputError
        If its ending is another.
    """
    check_ending(path, "a report is written as .html or .pdf.", *_WRITERS)


def write_document(
    path: Path, document: Document, *, overwrite: bool = False, progress: Progress = no_progress
) -> None:
    """Write a report.

    Raises
    ------
    InputError
        If the ending is another, or the file cannot be written.
    """
    check_report(path)
    _WRITERS[path.suffix.lower()](path, document, overwrite=overwrite, progress=progress)
