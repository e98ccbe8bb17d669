"""A relief map and an orthophoto in, a page that turns them out."""

from __future__ import annotations

from pathlib import Path

from bifocal.model import ReliefMap
from bifocal.reports.content import ortho_thumbnail
from bifocal.reports.relief_view import relief_view
from photocore.output import atomic_path, check_ending, check_writable


def view_relief(
    source: Path,
    out: Path,
    *,
    ortho: Path | None = None,
    title: str = "",
    language: str = "en",
    overwrite: bool = False,
) -> None:
    """Write the page of a relief map.

    Parameters
    ----------
    source : Path
        Relief map.
    out : Path
        ``.html``.
    ortho : Path, optional
        Orthophoto of the same wall, for its colours; it need not cover the same part.
    title, language : str
        See `bifocal.relief_view`; by default the file's name.
    overwrite : bool

    Raises
    ------
    InputError
        If a file is missing or is not what it should be, or ``out`` cannot be written.
    """
    check_ending(out, "the view is written as .html.", ".html", ".htm")
    check_writable(out, overwrite=overwrite)
    relief = ReliefMap.read(source)
    picture = None if ortho is None else ortho_thumbnail(ortho)[0]
    page = relief_view(relief, picture, title=title or source.stem, language=language)
    with atomic_path(out, overwrite=overwrite) as temporary:
        temporary.write_text(page, encoding="utf-8")
