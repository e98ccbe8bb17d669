"""The slips people make when they type what was measured: one table, tried wherever numbers misfit.

A row is what may have been meant, as a function of what was typed. Of the rows that explain a
misfit the one with the fewest slips wins; whoever tries them says so, and takes none silently.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from photocore.arrays import FloatArray

#: Picks of the same points in two photos, each of shape (n, 2), and the photos' sizes. [px]
Picks = tuple[FloatArray, FloatArray]
Sizes = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True, slots=True)
class PickSlip:
    """What the pixels of points may have been meant as.

    Attributes
    ----------
    key : str
        Of its remark, ``slips.`` before it.
    meant : function
        Picks as typed and sizes of the photos in, picks as meant out.
    mended : bool
        Whether to go on with what was meant; else only a person can mend it.
    """

    key: str
    meant: Callable[[Picks, Sizes], Picks]
    mended: bool = True


def _from_bottom(picks: Picks, sizes: Sizes) -> Picks:
    first, second = (p * [1, -1] + [0, height - 1.0] for p, (_, height) in
                     zip(picks, sizes, strict=True))  # fmt: skip
    return first, second


def _enlarged(times: float) -> Callable[[Picks, Sizes], Picks]:
    """Return picks of copies so many times smaller, pixel centres at integers."""
    return lambda picks, _: (
        times * (picks[0] + 0.5) - 0.5,
        times * (picks[1] + 0.5) - 0.5,
    )


#: The scales of a bifocal pair, c / d, may differ by this much, relative.
SCALE_TOLERANCE = 0.02

#: Of the pixels of both photos.
PICKS = (
    PickSlip("picks", lambda picks, _: picks[::-1]),
    PickSlip("control_rows", _from_bottom, mended=False),
    *(PickSlip(f"copies_{times}", _enlarged(times)) for times in (2, 4)),
)
#: Of coordinates X, Y, r, shape (n, 3), by the key of the remark.
COORDINATES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "control_y": lambda xyz: xyz * [1, -1, 1],
    "control_x": lambda xyz: xyz * [-1, 1, 1],
    "control_xy": lambda xyz: xyz[:, [1, 0, 2]],
    "control_r": lambda xyz: xyz * [1, 1, -1],
}
#: Typed over meant lengths, by the unit they were measured in; 2: of a radius for a diameter.
FACTORS = {"mm": 1000.0, "cm": 100.0, "dm": 10.0, "ft": 1 / 0.3048, "double": 2.0}
#: Degrees of an angle's unit.
ANGLES = {"rad": 180 / np.pi, "gon": 0.9}


def picks_meant(picks: Picks, sizes: Sizes) -> Iterator[tuple[PickSlip, Picks]]:
    """Yield what picks may have been meant as, where that puts no more of them outside a photo."""
    for slip in PICKS:
        meant = slip.meant(picks, sizes)
        if _outside(meant, sizes) <= _outside(picks, sizes):
            yield slip, meant


def _outside(picks: Picks, sizes: Sizes) -> int:
    """Return how many picks lie outside the photos."""
    pairs = zip(picks, sizes, strict=True)
    return sum(int(((p < -0.5) | (p > size)).any(axis=1).sum()) for p, size in pairs)


def unit_of(ratio: float, within: float = 0.03) -> str:
    """Return the unit that explains how many times too long something was typed; empty: none.

    Examples
    --------
    >>> unit_of(3.29), unit_of(980.0), unit_of(1.4)
    ('ft', 'mm', '')
    """
    name, factor = min(FACTORS.items(), key=lambda one: abs(np.log(ratio / one[1])))
    return name if abs(np.log(ratio / factor)) < within else ""
