"""A workbook that is the pair itself: its ideal set-up, in pixels of its photos."""

from __future__ import annotations

from bifocal.collimation.project import SurveyFiles
from bifocal.model import Pair
from bifocal.remarks import remark
from bifocal.survey import SurveySetup
from bifocal.workbook import read_pair, read_survey
from photocore.errors import InputError
from photocore.workbook import CellValue


def pair_of(files: SurveyFiles) -> Pair | None:
    """Return the pair of a survey's files; None before its photos are oriented.

    Raises
    ------
    InputError, GeometryError
        If the pair file, or the set-up of the workbook, cannot be used.
    """
    if files.pair is None:
        return None
    pair = read_pair(files.pair)
    if files.pair_is_workbook and pair.exchanged:
        raise InputError(remark("page.setup_exchanged", of=files.pair))
    return pair


def ideal_setup(files: SurveyFiles, pair: Pair) -> SurveySetup | None:
    """Return the ideal set-up that `bifocal solve` will use; None where a pair file is used.

    What is blank in the workbook is as the page assumes it: see `typed_setup`.
    """
    if not files.pair_is_workbook:
        return None
    setup = read_survey(files.workbook).setup
    return None if setup.matrices is not None else completed(setup, pair)


def completed(setup: SurveySetup, pair: Pair) -> SurveySetup:
    """Return an ideal set-up in pixels, with pitch and nadirs of its pair where it has none."""
    photos = (pair.image1, pair.image2)
    first, second = (tuple(p.pixels_from_plane(p.nadir).tolist()) for p in photos)
    metres, c, d = pair.image1.plane_from_pixel[0, 0], setup.taking.c1 or 1.0, pair.d1
    return setup.but(
        unit="px",
        enlargement1=1.0,
        enlargement2=1.0,
        pitch=setup.taking.pitch or float(metres * c / d),
        nadir1=setup.taking.nadir1 or first,
        nadir2=setup.taking.nadir2 or second,
    )


def typed_setup(setup: SurveySetup, pair: Pair) -> dict[str, CellValue]:
    """Return what the page types into an ideal set-up, by the names of its cells.

    Picks are pixels; pitch and nadir points that were blank are typed as the page assumes them, so
    that the formulas give what the page shows.
    """
    whole = completed(setup, pair)
    cells: dict[str, CellValue] = {"input_unit": whole.unit}
    if setup.taking.pitch is None:
        cells["pitch"] = whole.taking.pitch
    if setup.taking.c_used != whole.taking.c_used:
        cells |= {"enlargement_1": 1, "enlargement_2": 1}
    known = ((setup.taking.nadir1, whole.taking.nadir1), (setup.taking.nadir2, whole.taking.nadir2))
    for number, (typed, nadir) in enumerate(known, start=1):
        if typed is None and nadir is not None:
            cells |= {f"nadir_{number}_col": nadir[0], f"nadir_{number}_row": nadir[1]}
    return cells


def typed_of(pair: Pair) -> list[object]:
    """Return what a workbook says of its pair, for comparison."""
    return [
        [
            *(photo.file, photo.plane_from_pixel.tolist(), list(photo.nadir)),
            *(photo.distance, photo.principal_distance, photo.sigma_pixel),
            *(photo.layers, photo.z0),
        ]
        for photo in (pair.image1, pair.image2)
    ]
