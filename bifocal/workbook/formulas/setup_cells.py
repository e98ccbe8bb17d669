"""The sheet `Setup` as data: its cells in order, their formats, their formulas."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from bifocal.model import LEAST_COSINE, SCALE_TOLERANCE, SIGMA_PIXEL, UNCERTAIN_SHARE
from bifocal.options.commands import SolveCommand
from bifocal.survey import (
    HEIGHTS,
    SIGMA_PRINT,
    SIGMA_RADIAL,
    index_names,
    media_names,
    thickness_names,
)
from bifocal.workbook.formulas.columns import FORMULAS, other_numbers
from photocore.option_types import Number
from photocore.options import options_of

Groups = tuple[tuple[str, ...], ...]

#: Cells that name the photo files.
PHOTOS = ("photo_1", "photo_2")
#: Nadir points of an ideal pair measured in pixels.
IDEAL_NADIRS = ("nadir_1_col", "nadir_1_row", "nadir_2_col", "nadir_2_row")
#: Cells for the head of the printed results.
TITLE_BLOCK = ("project", "client", "surveyor", "survey_date")
_CHECKS = ("check_order", "check_scale")
MATRICES: Groups = tuple(
    tuple(f"h{image}_{row}{column}" for row in "123" for column in "123") for image in "12"
)
NADIRS: Groups = tuple(tuple(f"n{image}_{axis}" for axis in "xy") for image in "12")
#: The cells of options that are not called as these.
_OPTION_CELLS = {
    **{f"{name}{k}": (f"{name}_{k}",) for name in ("d", "c", "enlargement") for k in "12"},
    **{f"nadir{k}": (f"nadir_{k}_col", f"nadir_{k}_row") for k in "12"},
    "unit": ("input_unit",),
    "model": ("g_model",),
}
#: Cells that are yellow and hold a formula until something is typed over it.
TYPED_FORMULAS = ("d_1", "sigma_s", "sigma_r_max")
#: What may be typed as refractive index: vacuum to germanium.
INDEX_LIMITS = (1.0, 4.1)
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


def state_formula(words: Mapping[str, str], *, is_pair: bool) -> str:
    """Return the formula of the line that says what `Setup` still lacks.

    Parameters
    ----------
    words : mapping
        `STATES` to sentences.
    """
    rest = f'"{words["state_ready"]}"'
    for check in reversed(_CHECKS[:1] if is_pair else _CHECKS):
        rest = f'IF({check}="CHECK","{words[check.replace("check", "state")]}",{rest})'
    return f'IF(setup_missing<>"","{words["state_missing"]} "&setup_missing,{rest})'


#: Keys of the sentences about the set-up.
STATES = ("state_ready", "state_missing", "state_order", "state_scale")


def _stated(media: int) -> tuple[str, ...]:
    """Return the indices that tell that light is bent, with cells for so many media."""
    return index_names(media)[1:]


def lens_cells() -> Groups:
    """Return the cells of lens distortion: those typed, and those calculated."""
    typed, calculated = FORMULAS.content["setup"]["lens"]
    return tuple(typed.split()), tuple(calculated.split())


def groups(*, is_pair: bool, media: int, lens: bool = False, leaning: bool = False) -> Groups:
    """Return the cells of `Setup` group by group; the last group is calculated.

    Parameters
    ----------
    is_pair : bool
        Whether the points are raw pixels of a general pair.
    media : int
        How many media there are cells for; 0 in air.
    lens : bool
        Whether there are cells for the distortion of each lens.
    leaning : bool
        Whether there are cells for ports that lean.
    """
    cells = FORMULAS.content["setup"]["pair" if is_pair else "ideal"]
    first, *others, last = (tuple(group.split()) for group in cells)
    if lens:
        typed, calculated = lens_cells()
        others, last = [typed, *others], (*last, *calculated)
    if not media:
        return (first, *others, last)
    calculated = _of_media(media, is_pair=is_pair, leaning=leaning)
    return (first, media_names(media, leaning=leaning), *others, (*last, *calculated))


def _of_media(media: int, *, is_pair: bool, leaning: bool) -> tuple[str, ...]:
    """Return the cells that follow from those of the media.

    On the measured side every ray is known, so a spreadsheet follows it layer by layer without
    iterating: see `bifocal.media`, whose notation this is.
    """
    used = (f"n_used_{number}" for number in range(1, media + 1))
    axes = (f"axis_{axis}_{image}" for image in "12" for axis in "xyr")
    units = ("n_least", *axes) if leaning else ()
    rays = () if is_pair else ("c_rays_1", "c_rays_2", "mm_1", "m_seen")
    both = (f"{name}_{image}" for name in ("behind", "seen", "reach") for image in "12")
    return (*used, *units, *both, "r_top", *rays)


#: Cells of photo 2 beside which those of further photos stand: the typed ones and the others.
_BESIDE = {
    "c_2": "c_{}", "d_2": "d_{}", "enlargement_2": "enlargement_{}",
    "nadir_2_col": "nadir_{}_col", "nadir_2_row": "nadir_{}_row",
    "check_scale": "check_scale_{}", "m_2": "m_{}", "off_x2": "off_x{}", "off_y2": "off_y{}",
}  # fmt: skip


def beside(name: str, others: int) -> tuple[str, ...]:
    """Return the cells of further photos that stand beside a cell of the second one."""
    form = _BESIDE.get(name)
    return tuple(form.format(k) for k in other_numbers(others)) if form else ()


def other_cells(photo: int) -> tuple[str, ...]:
    """Return the cells to be typed for a further photo: c, d, enlargement, column, row."""
    return tuple(form.format(photo) for form in list(_BESIDE.values())[:5])


def formulas(
    *, is_pair: bool = False, media: int = 0, others: int = 0, leaning: bool = False
) -> Mapping[str, str]:
    """Return the formulas of `Setup` by name; there may be more than cells for them."""
    limits = {
        "sigma_print": SIGMA_PRINT,
        "sigma_pixel": SIGMA_PIXEL,
        "sigma_radial": SIGMA_RADIAL,
        "uncertain_share": UNCERTAIN_SHARE,
        "scale_tolerance": SCALE_TOLERANCE,
    }
    parts = {name: f"{value:g}" for name, value in limits.items()}
    parts |= {"last": str(media), "stated": ",".join(_stated(media)), "least": f"{LEAST_COSINE:g}"}
    parts["indices"] = ",".join(f"n_used_{n}" for n in range(1, media + 1))
    parts["inner"] = "".join(f"-N({name})" for name in thickness_names(media))
    parts["glass"] = "".join(f"+N(thick_{n})*n_used_1/n_used_{n}" for n in range(2, media))
    parts["others"] = " ".join(map(str, other_numbers(others)))
    conditions = {"pair": is_pair, "media": media, "leaning": leaning}
    facts = {name for name, holds in conditions.items() if holds}
    missing = _missing_formula(_PAIR_NEEDED if is_pair else _IDEAL_NEEDED, _stated(media))
    lines = FORMULAS.columns("setup", facts, parts, rows="lines")
    return {line.key: line.formula for line in lines} | {"setup_missing": missing}


def number_format(name: str) -> str:
    """Return how the cell of a name shows what it holds."""
    forms = FORMULAS.content["setup"]["forms"]
    return next((form for form, names in forms.items() if name in names.split()), "General")


def numbers() -> tuple[str, ...]:
    """Return the cells that hold the numbers of an ideal pair and of how points were measured."""
    return tuple(FORMULAS.content["setup"]["numbers"].split())


def is_text(name: str) -> bool:
    """Tell whether a cell holds a text."""
    return name in FORMULAS.content["setup"]["texts"].split()


def is_above_zero(name: str) -> bool:
    """Tell whether a cell must hold a number above zero, as the option in its place must."""
    options = options_of(SolveCommand).values()
    stated = (o.name for o in options if isinstance(o.attributes.get("type"), Number))
    return name in cells_of(stated)


def sensible_limits(name: str) -> tuple[float, float] | None:
    """Return the least and the largest number that can be meant, where a sheet knows them."""
    for limits, names in FORMULAS.content["setup"]["limits"].items():
        if name in names.split():
            low, high = map(float, limits.split())
            return low, high
    return None


def may_be_zero(name: str) -> bool:
    """Tell whether a length of media may be zero: a window, or a camera at it."""
    return name in HEIGHTS or name.startswith("thick_")
