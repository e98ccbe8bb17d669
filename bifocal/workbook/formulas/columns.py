"""Tables of the survey workbook: what `formulas.toml` makes of them, by what a survey has.

Names never look like cells, so `d_1` and not the paper's `d1`.
"""

from __future__ import annotations

from collections.abc import Collection

from bifocal.model import DOUBTFUL_SHARE, UNCOUNTED, FlagLimits
from bifocal.survey import ALPHA_POINT, CHANCE, DOUBT_CODES
from bifocal.survey.other_photos import TURNS
from bifocal.workbook.formulas.placed_formulas import placed_parts
from photocore.workbook import FormulaBook, LiveColumn

FORMULAS = FormulaBook(__package__)
#: The functions with names of `bifocal template --functions`, a table each.
FUNCTIONS = FormulaBook(__package__, "functions")
#: E, N, H from a whole-metre origin: columns that refer to the sheet `Georeference`.
NEAR = ("n_E", "n_N", "n_H", "cov_EN", "shared", "sigma_E", "sigma_N", "sigma_H")
#: What the sheet `WhatIf` changes: distances [m], principal distances [mm], size of a pixel [mm].
CHANGED = ("d_1", "d_2", "c_1", "c_2", "pitch")
#: World coordinates carry no more than so many digits: what is below is no contradiction.
ROUNDING = 1e-9
#: Relief whose area of uncertainty the sheet `Planning` shows. [cm]
PLANNED_RELIEF = (1, 2, 5, 10, 20, 50, 100)
FRAME_SHARES = (10, 20, 30, 40, 50, 60, 70, 80, 90, 100)


def adjustment_names(image: int) -> tuple[str, ...]:
    """Return the names of the nine cells that correct the coordinates of an image, row by row."""
    return tuple(f"a{image}_{row}{column}" for row in "123" for column in "123")


def ideal_points(
    *,
    xy: bool = True,
    polar: bool = True,
    theta: bool = True,
    code: bool = True,
    adjusted: Collection[int] = (),
    media: int = 0,
    lens: bool = False,
    others: int = 0,
) -> tuple[LiveColumn, ...]:
    """Return the `Points` table of an ideal pair.

    Parameters
    ----------
    xy, polar, theta, code : bool
        Whether the table has the columns x1 y1 x2 y2, s1 s2, theta, and code; formulas name no
        others.
    adjusted : collection of int
        Images whose coordinates are corrected by the cells a1_11 ..., a2_11 ... of `Setup`.
    media : int
        How many media `Setup` has cells for; 0 in air.
    lens : bool
        Whether `Setup` has cells for the distortion of each lens: only coordinates are freed of it.
    others : int
        How many photos there are columns for beside those of the pair: coordinates in all.
    """
    coordinates = lens or others > 0
    polar, theta = polar and not coordinates, theta and not coordinates
    conditions = {
        "xy": xy,
        "polar": polar,
        "theta": theta,
        "code": code,
        "media": media,
        "lens": lens,
    }
    conditions["others"] = others
    facts = {name for name, has in conditions.items() if has} | {f"corrected{i}" for i in adjusted}
    codes = (f'LEFT(UPPER(TRIM([@code])),{len(word)})="{word}"' for word in DOUBT_CODES)
    doubt = {"doubt_codes": ",".join(codes), "doubt_share": repr(DOUBTFUL_SHARE)}
    parts = doubt | _layers(media) | placed_parts() | _sums(others)
    return FORMULAS.columns("ideal_points", facts, parts)


def other_numbers(others: int) -> range:
    """Return the numbers of so many photos beside those of a pair."""
    return range(3, 3 + others)


def other_keys(others: int) -> list[str]:
    """Return the keys of image coordinates of so many photos beside those of a pair."""
    return [f"{axis}{number}" for number in other_numbers(others) for axis in "xy"]


def pair_letter(photo: int) -> str:
    """Return what the pair of photo 1 and another one is called: A with photo 2.

    >>> pair_letter(2), pair_letter(3)
    ('A', 'B')
    """
    return chr(ord("A") + photo - 2)


def compared(others: int) -> tuple[tuple[str, str], ...]:
    """Return the columns of relief that are compared, and of their sigmas: pair A, B, ..., all."""
    pairs = [(f"r_1_{k}", f"sigma_1_{k}") for k in other_numbers(others)]
    return (("r", "sigma_r"), *pairs, ("r_all", "sigma_all"))


def compare_columns(others: int) -> tuple[LiveColumn, ...]:
    """Return the table of check points with relief of every pair beside each other."""
    kinds = " ".join(f"{r}:{sigma}" for r, sigma in compared(others))
    return FORMULAS.columns("compare", parts={"kinds": kinds, "contradictory": f"{CHANCE:.9g}"})


def _sums(others: int) -> dict[str, str]:
    """Return the parts of formulas that go through all photos."""
    photos = range(1, 3 + others)
    term = 'IF([@weight{0}]="",0,[@weight{0}]*{{{{1}} {0} {{2}}}})'
    before = (f'IF([@weight{k}]="",TRUE,[@turn_{TURNS}]<d_{k})' for k in photos)
    return {
        "sum": f"({'+'.join(term.format(k) for k in photos)})",
        "before": ",".join(before),
        "paired": "&".join(
            f'IF(ISNUMBER([@r_1_{k}])," {pair_letter(k)}","")' for k in other_numbers(others)
        ) or '""',
        "seen": ",".join(f"[@wall_x{k}]" for k in photos),
        "photos": " ".join(map(str, photos)),
        "others": " ".join(map(str, other_numbers(others))),
        "other_xy": " ".join(other_keys(others)),
        "turns": " ".join(f"{turn}:{turn + 1}" for turn in range(TURNS)),
        "last_r": f"turn_{TURNS}",
        "last_turn": str(TURNS),
        **{f"{axis}{k}": f"([@{axis}{k}]-off_{axis}{k})*unit_{axis}"
           for k in other_numbers(others) for axis in "xy"},
    }  # fmt: skip


def pair_points(
    *, undistorted: bool, media: int = 0, leaning: bool = False
) -> tuple[LiveColumn, ...]:
    """Return the `Points` table of a general pair measured in raw pixels.

    Parameters
    ----------
    undistorted : bool
        Whether the photos have lens distortion, which no formula can take out: the pixels freed of
        it are then written beside the raw ones.
    media : int
        How many media `Setup` has cells for; 0 in air.
    leaning : bool
        Whether `Setup` has cells for ports that lean.
    """
    conditions = {"undistorted": undistorted, "media": media, "pair": True, "leaning": leaning}
    facts = {name for name, has in conditions.items() if has}
    return FORMULAS.columns("pair_points", facts, _layers(media) | placed_parts())


def _layers(media: int) -> dict[str, str]:
    """Return the parts of formulas that depend on how many media there are cells for."""
    glass = (f"+N(thick_{n})*{{{{1}} {n} {{2}}}}" for n in range(2, media))
    plates = "".join(f"+N(thick_{n})" for n in range(2, media))
    return {"last": str(media), "glass": "".join(glass), "plates": plates}


def results_columns(*, is_pair: bool, older: bool = False) -> tuple[LiveColumn, ...]:
    """Return the columns of `Results`: what a survey found, on the wall and in the world.

    Parameters
    ----------
    is_pair : bool
        Whether `Points` keeps the covariances of the picks for one pixel, and apart from them what
        the photos' orientation adds: on the wall, and once placed in the world.
    older : bool
        Whether `Points` lacks the sigmas of E, N, H, as older versions wrote it.
    """
    facts = {name for name, holds in (("pair", is_pair), ("older", older)) if holds}
    return FORMULAS.columns("results", facts, placed_parts())


def georeference_columns(*, is_pair: bool) -> tuple[LiveColumn, ...]:
    """Return the table of control points: names, coordinates, weights, residuals.

    Parameters
    ----------
    is_pair : bool
        Whether `Points` keeps the covariances of the picks for one pixel, apart from what the
        photos' orientation is worth, which weighs nothing here.
    """
    limits = {"alpha": f"{ALPHA_POINT:g}", "rounding": f"{ROUNDING:g}"}
    return FORMULAS.columns("control", {"pair"} if is_pair else (), limits | placed_parts())


def check_columns() -> tuple[LiveColumn, ...]:
    """Return the table of check points: what was measured on site, errors, what does not count."""
    uncounted = ",".join(f'[@flag]="{flag}"' for flag in UNCOUNTED)
    return FORMULAS.columns("check", parts={"uncounted": uncounted})


def planning_facts(*, media: int, is_pair: bool) -> set[str]:
    """Return what the formulas of the sheet `Planning` depend on."""
    return {name for name, holds in (("media", media), ("pair", is_pair)) if holds}


#: Numbers in the formulas of the sheet `Planning`.
PLANNING = {"on_plane": f"{FlagLimits().on_plane:g}"}
