"""Survey workbooks: the empty template, measured points as a workbook."""

from __future__ import annotations

from pathlib import Path

from bifocal.model import Pair
from bifocal.survey import MOST_PHOTOS, PointObservations, SurveyMedia, solve_points
from bifocal.workbook.content import POINT_ROWS, SurveyContent
from bifocal.workbook.making.book import write_book
from bifocal.workbook.words import LANGUAGES
from photocore.errors import InputError
from photocore.output import check_ending, relative_name
from photocore.provenance import file_hash, program, today
from photocore.workbook import check_new_workbook

#: With more points a workbook would unpack to more than is read again (`reading.package`): a row
#: of `Points` and `Results` takes up to 12 kB together.
MOST_ROWS = 30_000
LogRow = tuple[str, str, str, str, str]


def write_template(
    path: Path | str,
    *,
    language: str = "en",
    rows: int = POINT_ROWS,
    media: int | None = None,
    lens: bool = False,
    photos: int = 2,
    what_if: bool = False,
    functions: bool = False,
    plain: bool = False,
    overwrite: bool = False,
) -> None:
    """Write an empty survey workbook with live formulas.

    Parameters
    ----------
    path : path
        An ``.xlsx`` file.
    language : {"en", "it", "de"}
        Of labels and help; keys and flags are the same in all.
    rows : int
        Rows prepared for points.
    media : int, optional
        How many media `Setup` gets cells for: 2 for a water surface, 3 for air, glass and water;
        none by default, for photos in air.
    lens : bool
        Whether `Setup` gets cells for the distortion of each lens, which formulas then take out.
    photos : int
        How many photos there are columns for: of more than two, relief by each pair of photo 1 and
        another stands beside that of all.
    what_if : bool
        Add a sheet that shows what changes of distances, lenses and pixel do to every relief.
    functions : bool
        Add the formulas of the method as functions with names, and a sheet that explains them.
    plain : bool
        Write formulas with A1 references only, for programs that know no names.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    InputError
        If the language is unknown, media are fewer than 2 or more than 6, or the file cannot be
        written.
    """
    if language not in LANGUAGES:
        raise InputError(f"language: {language!r} is none of {', '.join(LANGUAGES)}.")
    if not 1 <= rows <= MOST_ROWS:
        raise InputError(f"rows: must be 1 to {MOST_ROWS}, got {rows}.")
    if not 2 <= photos <= MOST_PHOTOS:
        raise InputError(f"photos: must be 2 to {MOST_PHOTOS}, got {photos}.")
    if photos > 2 and (media or lens):
        raise InputError(f"photos: {photos} are for photos in air without lens cells.")
    if what_if and media:
        raise InputError("what_if: is for photos in air.")
    cells = None if media is None else SurveyMedia.blank(media)
    check_book_path(path)
    check_new_workbook(path, overwrite=overwrite, suffix="")
    content = SurveyContent(
        language=language, rows=rows, media=cells, lens=lens, functions=functions, plain=plain,
        other_photos=photos - 2, changes={} if what_if else None,
    )  # fmt: skip
    write_book(path, content, overwrite=overwrite)


def write_survey(
    path: Path | str,
    points: PointObservations,
    *,
    pair: Pair,
    pair_path: Path | str | None = None,
    sigma_px: float | None = None,
    language: str = "en",
    what: str = "points written",
    overwrite: bool = False,
) -> None:
    """Write measured points as a survey workbook, solved, every result a live formula.

    Parameters
    ----------
    path : path
        An ``.xlsx`` file.
    points : PointObservations
        With ``pixels1`` and ``pixels2``. [px]
    pair : Pair
    pair_path : path, optional
        Where the pair file lies; named in the workbook.
    sigma_px : float, optional
        Measuring precision; default the pair's, else 0.5. [px]
    language : {"en", "it", "de"}
        Of labels and help.
    what : str
        For the sheet `Log`.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    InputError
        If the file cannot be written.

    Notes
    -----
    The raw pixels ``col1 row1 col2 row2`` are the inputs; ``x1 y1 x2 y2`` are live
    formulas: the homographies in `Setup` carry them to the plane, in millimetres of the image
    scale about the zoom centre. `bifocal solve` gives the same from the workbook as from the pair.
    """
    path = check_book_path(path)
    check_new_workbook(path, overwrite=overwrite)
    content = SurveyContent(
        language=language,
        pair=pair,
        pair_file=relative_name(pair_path, path.parent) if pair_path is not None else "",
        photo_files=_photo_files(pair, path.parent) if pair_path is None else ("", ""),
        sigma_px=sigma_px,
        points=points,
        table=solve_points(pair, points, sigma_px=sigma_px),
        log=[log_row(what, pair_path)],
    )
    write_book(path, content, overwrite=overwrite)


def _photo_files(pair: Pair, folder: Path) -> tuple[str, str]:
    """Return the photos of a pair without a file, as seen from the workbook's folder."""
    first, second = (
        relative_name(pair.folder / photo.file, folder) if photo.file else ""
        for photo in (pair.image1, pair.image2)
    )
    return first, second


def check_book_path(path: Path | str) -> Path:
    """Return the path of a workbook to write, refusing other endings.

    Raises
    ------
    InputError
        If it does not end in ``.xlsx``.
    """
    path = Path(path)
    check_ending(path, "a new workbook must end in .xlsx.", ".xlsx")
    return path


def log_row(what: str, file: Path | str | None) -> LogRow:
    """Return a row of the sheet `Log`: date, program, what was done, from which file."""
    path = None if file is None else Path(file)
    digest = ""
    if path is not None and path.is_file():
        digest = file_hash(path)
    return (today(), program(), what, "" if path is None else path.name, digest)
