"""The sheet `Setup` as data: its cells in order, their formats, their formulas."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from bifocal.model.flags import SIGMA_PIXEL, UNCERTAIN_SHARE
from bifocal.survey.setup import SCALE_TOLERANCE, SIGMA_PRINT, SIGMA_RADIAL
from bifocal.survey.survey_media import HEIGHTS, index_names, media_names
from bifocal.workbook.formulas.media_formulas import calculated_names, larger, setup_formulas
from photocore.workbook.changing.cells import CellValue

Groups = tuple[tuple[str, ...], ...]

#: Cells that name the photo files.
PHOTOS = ("photo_1", "photo_2")
#: Nadir points of an ideal pair measured in pixels.
IDEAL_NADIRS = ("nadir_1_col", "nadir_1_row", "nadir_2_col", "nadir_2_row")
#: Cells for the head of the printed results.
TITLE_BLOCK = ("project", "client", "surveyor", "survey_date")
#: How many times larger than on the sensor the images are that were measured.
PRINTS = ("enlargement_1", "enlargement_2")
#: Cells that hold texts.
TEXTS = ("pair_file", *PHOTOS, *TITLE_BLOCK)
_CHECKS = ("setup_missing", "check_order", "check_scale")
#: Cells of an ideal pair, group by group; the last group is calculated, the others are typed.
IDEAL_GROUPS: Groups = (
    (
        *("c_1", "c_2", "d_2", "delta_d", "d_1", "input_unit", *PRINTS, "pitch"),
        *IDEAL_NADIRS,
        *PHOTOS,
    ),
    ("sigma_s", "sigma_r_max", "k_off", "k_plane"),
    TITLE_BLOCK,
    (
        *_CHECKS,
        *("m_1", "m_2", "k_12", "b_lever", "unit_x", "unit_y"),
        *("off_x1", "off_y1", "off_x2", "off_y2"),
    ),
)
MATRICES: Groups = tuple(
    tuple(f"h{image}_{row}{column}" for row in "123" for column in "123") for image in "12"
)
NADIRS: Groups = tuple(tuple(f"n{image}_{axis}" for axis in "xy") for image in "12")
#: The same of a pair given by homographies.
PAIR_GROUPS: Groups = (
    (
        *("pair_file", "d_2", "delta_d", "d_1", *NADIRS[0], *NADIRS[1]),
        *("c_1", "c_2", "pitch", "input_unit", *PHOTOS),
    ),
    ("sigma_px", "sigma_r_max", "k_off", "k_plane", "pixel_wall"),
    TITLE_BLOCK,
    *MATRICES,
    (*_CHECKS[:2], "m_1", "b_lever", "e_x", "e_y", "sigma_s"),
)
#: The cells of options that are not called as these.
_OPTION_CELLS = {
    **{f"{name}{k}": (f"{name}_{k}",) for name in ("d", "c", "enlargement") for k in "12"},
    **{f"nadir{k}": (f"nadir_{k}_col", f"nadir_{k}_row") for k in "12"},
    "unit": ("input_unit",),
    "model": ("g_model",),
}
#: Number formats.
FORMS: Mapping[str, str] = {
    **dict.fromkeys(("d_1", "d_2", "delta_d", "b_lever"), "0.000"),
    **dict.fromkeys(("pitch", "sigma_s", "k_12"), "0.000000"),
    **dict.fromkeys(("m_1", "m_2", "m_seen", "mm_1"), "0.00"),
    **{f"{name}_{image}": "0.000" for name in ("behind", "seen", "reach") for image in "12"},
    "sigma_r_max": "0.0000",
    **dict.fromkeys((*PHOTOS, *TITLE_BLOCK), "@"),
}
#: Typed numbers that must be above zero; of the others the sheet only asks that they are numbers.
POSITIVE = ("c_1", "c_2", "d_1", "d_2", "pitch", "sigma_s", "sigma_px", "sigma_r_max", *PRINTS)
#: Cells that are yellow and hold a formula until something is typed over it.
TYPED_FORMULAS: Mapping[str, str] = {
    "d_1": 'IF(COUNT(d_2,delta_d)=2,d_2+delta_d,"")',
    "sigma_s": f"IF(MAX({','.join(PRINTS)})>1,{SIGMA_PRINT:g},"
    f"IF(COUNT(pitch)=1,{SIGMA_PIXEL:g}*pitch,{SIGMA_RADIAL:g}))",
    "sigma_r_max": f'IF(COUNT(d_1,d_2)=2,{UNCERTAIN_SHARE:g}*MIN(d_1,d_2),"")',
}
#: What a set-up needs: what to type, the cells that then hold numbers, for which input unit.
_NEEDED = (
    ("d_2", ("d_2",), ""),
    ("delta_d", ("d_1",), ""),
    ("c_1", ("c_1",), ""),
    ("c_2", ("c_2",), ""),
    ("pitch", ("pitch",), "px"),
    ("nadir_1_col ... nadir_2_row", IDEAL_NADIRS, "px"),
)
_IDEAL_NEEDED, _PAIR_NEEDED = _NEEDED, _NEEDED[:2]


def cells_of(options: Iterable[str]) -> set[str]:
    """Return the cells that options take the place of, by their names."""
    return {cell for option in options for cell in _OPTION_CELLS.get(option, (option,))}


def _missing_formula(
    needed: Sequence[tuple[str, tuple[str, ...], str]], stated: Sequence[str] = ()
) -> str:
    """Return the formula that names the cells still to be filled in.

    ``stated`` are the cells of refractive indices that make z0 needed.
    """
    parts = [
        f'IF(AND(COUNT({",".join(stated)})>0,COUNT({z0})=0),", {z0}","")'
        for z0 in HEIGHTS
        if stated
    ]
    for name, cells, unit in needed:
        blank = f"COUNT({','.join(cells)})<{len(cells)}"
        test = f'AND(input_unit="{unit}",{blank})' if unit else blank
        parts.append(f'IF({test},", {name}","")')
    return f"MID({'&'.join(parts)},3,200)"


def setup_checks(
    cells: Mapping[str, CellValue], *, is_pair: bool, media: int = 0
) -> dict[str, CellValue]:
    """Return what the checks of the set-up show: what is missing, d_1 > d_2, the scales.

    ``media`` is how many media there are cells for.
    """

    def known(*names: str) -> bool:
        return all(isinstance(cells.get(name), int | float) for name in names)

    needed = _PAIR_NEEDED if is_pair else _IDEAL_NEEDED
    bent = any(known(name) for name in _stated(media))
    missing = [name for name in HEIGHTS if bent and not known(name)]
    missing += [
        name
        for name, wanted, unit in needed
        if not known(*wanted) and unit in ("", cells["input_unit"])
    ]
    order: CellValue = None
    if known("d_1", "d_2"):
        order = _verdict(float(cells["d_1"] or 0) > float(cells["d_2"] or 0))
    scale: CellValue = None
    if known("m_1", "m_2"):
        first, second = (float(cells.get(name) or 1) for name in PRINTS)
        ratio = float(cells["k_12"] or 0) * second / first
        scale = _verdict(abs(ratio - 1) <= SCALE_TOLERANCE)
    checks = (", ".join(missing) or None, order, scale)
    return dict(zip(_CHECKS, checks, strict=True))


def _verdict(good: bool) -> str:
    return "OK" if good else "CHECK"


def state_formula(words: Mapping[str, str], *, is_pair: bool) -> str:
    """Return the formula of the line that says what `Setup` still lacks.

    Parameters
    ----------
    words : mapping
        `STATES` to sentences.
    """
    rest = f'"{words["state_ready"]}"'
    checks = _CHECKS[1:2] if is_pair else _CHECKS[1:]
    for check in reversed(checks):
        rest = f'IF({check}="CHECK","{words[check.replace("check", "state")]}",{rest})'
    return f'IF(setup_missing<>"","{words["state_missing"]} "&setup_missing,{rest})'


def state(cells: Mapping[str, CellValue], words: Mapping[str, str]) -> str:
    """Return what that line says."""
    if cells["setup_missing"]:
        return f"{words['state_missing']} {cells['setup_missing']}"
    wrong = [check for check in _CHECKS[1:] if cells.get(check) == "CHECK"]
    return words[wrong[0].replace("check", "state") if wrong else "state_ready"]


#: Keys of the sentences about the set-up.
STATES = ("state_ready", "state_missing", "state_order", "state_scale")

#: How far the scales of the photos are apart, whatever those of their prints.
_OFF = f"ABS(k_12*{larger(2)}/{larger(1)}-1)"

_CHECK_FORMULAS: Mapping[str, str] = {
    "check_order": 'IF(COUNT(d_1,d_2)<2,"",IF(d_1>d_2,"OK","CHECK"))',
    "check_scale": f'IF(COUNT(m_1,m_2)<2,"",IF({_OFF}<={SCALE_TOLERANCE:g},"OK","CHECK"))',
}
IDEAL_FORMULAS: Mapping[str, str] = {
    **TYPED_FORMULAS,
    **_CHECK_FORMULAS,
    "setup_missing": _missing_formula(_IDEAL_NEEDED),
    "m_1": f'IF(COUNT(c_1,d_1)=2,1000*d_1/(c_1*{larger(1)}),"")',
    "m_2": f'IF(COUNT(c_2,d_2)=2,1000*d_2/(c_2*{larger(2)}),"")',
    "k_12": "IF(COUNT(m_1,m_2)=2,m_2/m_1,1)",
    "b_lever": 'IF(COUNT(d_1,d_2)=2,IF(d_1=d_2,"",d_1*d_2/(d_1-d_2)),"")',
    "unit_x": 'IF(input_unit="px",pitch,1)',
    "unit_y": 'IF(input_unit="px",-pitch,1)',
    "off_x1": 'IF(input_unit="px",nadir_1_col,0)',
    "off_y1": 'IF(input_unit="px",nadir_1_row,0)',
    "off_x2": 'IF(input_unit="px",nadir_2_col,0)',
    "off_y2": 'IF(input_unit="px",nadir_2_row,0)',
}
PAIR_FORMULAS: Mapping[str, str] = {
    **{key: IDEAL_FORMULAS[key] for key in ("d_1", "sigma_r_max", "b_lever", "check_order")},
    "setup_missing": _missing_formula(_PAIR_NEEDED),
    "sigma_s": 'IF(COUNT(pixel_wall)=1,sigma_px*pixel_wall/m_1,"")',
    "m_1": "IF(COUNT(c_1)=1,1000*d_1/c_1,1000)",
    "e_x": "(d_1*n2_x-d_2*n1_x)/(d_1-d_2)",
    "e_y": "(d_1*n2_y-d_2*n1_y)/(d_1-d_2)",
}


def _stated(media: int) -> tuple[str, ...]:
    """Return the indices that tell that light is bent, with cells for so many media."""
    return index_names(media)[1:]


def groups(*, is_pair: bool, media: int) -> Groups:
    """Return the cells of `Setup` group by group; the last group is calculated.

    Parameters
    ----------
    is_pair : bool
        Whether the points are raw pixels of a general pair.
    media : int
        How many media there are cells for; 0 in air.
    """
    first, *others, last = PAIR_GROUPS if is_pair else IDEAL_GROUPS
    if not media:
        return (first, *others, last)
    return (first, media_names(media), *others, (*last, *calculated_names(media, is_pair=is_pair)))


def formulas(*, is_pair: bool, media: int) -> Mapping[str, str]:
    """Return the formulas of `Setup` by name."""
    own = PAIR_FORMULAS if is_pair else IDEAL_FORMULAS
    if not media:
        return own
    needed = _PAIR_NEEDED if is_pair else _IDEAL_NEEDED
    missing = _missing_formula(needed, _stated(media))
    return {**own, **setup_formulas(media, is_pair=is_pair), "setup_missing": missing}


def may_be_zero(name: str) -> bool:
    """Tell whether a length of media may be zero: a window, or a camera at it."""
    return name in HEIGHTS or name.startswith("thick_")
