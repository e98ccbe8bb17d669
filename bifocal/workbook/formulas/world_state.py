"""What the sheets say of themselves while somebody types: sentences that are live formulas."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection

from bifocal.model import FARTHEST_WALL
from bifocal.survey import SCALE_SHARE, TAPED_SIGMAS, WIDEST_ANGLE
from bifocal.workbook.formulas.columns import FORMULAS

#: Names of the cells that judge the world coordinates, and what was measured on site.
STATE, SITE = "world_state", "site_state"
#: Names of all cells that hold a sentence: in workbooks of older versions they say less.
SPEAKING = (STATE, SITE, "title_world", "check_state", "points_state")
#: Keys of the sentences.
_SENTENCES = (
    *("world_few", "world_bad", "world_scale", "world_large", "world_good", "world_unchecked"),
    *("points_far", "points_wide", "points_twice", "names_unknown"),
    *("tape_good", "tape_bad", "tape_unknown", "site_unchecked"),
)


def sentence(
    key: str,
    word: Callable[[str], str],
    facts: Collection[str] = (),
    *,
    sheet: str = "Geo",
    note: str = "check_how",
) -> str:
    """Return the formula of a sentence of `formulas.toml`, ``[states]``.

    Parameters
    ----------
    key : str
        Which one.
    word : callable
        Returns a sentence in the language of the workbook by its key.
    facts : collection of str
        What holds.
    sheet : str
        The table whose names are looked up in `Points`, without "tbl".
    note : str
        The line of help where nothing is wrong.
    """
    parts = {name: word(name) for name in _SENTENCES}
    parts |= {"note": word(note)}
    parts |= {"share": f"{SCALE_SHARE:g}", "most_sigmas": f"{TAPED_SIGMAS:g}", "sheet": sheet}
    parts |= {"farthest": f"{FARTHEST_WALL:g}"}
    parts |= {"wide": f"{math.tan(math.radians(WIDEST_ANGLE)):.9g}"}
    lines = FORMULAS.columns("states", facts, parts, rows="lines")
    return next(line.formula for line in lines if line.key == key)
