"""What a change of the set-up would do to every relief, exactly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import Taking
from photocore.arrays import FloatArray

#: What may be changed: distances [m], principal distances [mm], size of a pixel [mm].
CHANGED = ("d_1", "d_2", "c_1", "c_2", "pitch")


def what_if(
    taking: Taking, table: ReliefTable, changes: Mapping[str, float]
) -> dict[str, FloatArray]:
    """Return what changes of a set-up do to solved points.

    Parameters
    ----------
    taking : Taking
        The set-up, with principal distances.
    table : ReliefTable
        The points solved with it.
    changes : mapping of str to float
        A name of `CHANGED` to what is added to it; in metres or millimetres.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        ``s_1``, ``s_2`` as measured [mm], ``r``, ``r_d_1`` ... (relief with one change), ``r_new``
        (with all), ``by_d_1`` ... and ``change`` (minus ``r``), ``moved`` (how much farther from
        the nadir point a point then lies on the wall) [m]; NaN where undefined.

    Notes
    -----
    Eq. (6) of what was measured, with ``s / c`` for the radius on the wall over its distance:
    ``r = (s_2 d_2 / c_2 - s_1 d_1 / c_1) / (s_2 / c_2 - s_1 / c_1)``. The size of a pixel is a
    factor of both radii: it moves points on the wall and leaves their relief.
    """
    now = (taking.d1, taking.d2, taking.c1, taking.c2, taking.pitch)
    values = {n: np.nan if v is None else v for n, v in zip(CHANGED, now, strict=True)}
    larger1, larger2 = taking.enlargements
    scale1 = values["d_1"] / (values["c_1"] * larger1)
    scale2 = values["d_2"] / (values["c_2"] * larger2)
    s1, s2 = table["s1_used"], table["s2_used"] / (scale2 / scale1)

    def solved(*names: str) -> tuple[FloatArray, FloatArray]:
        new = {n: v + (changes.get(n, 0.0) if n in names else 0.0) for n, v in values.items()}
        d1, d2 = new["d_1"], new["d_2"]
        tan1, tan2 = s1 / (new["c_1"] * larger1), s2 / (new["c_2"] * larger2)
        grown = new["pitch"] / values["pitch"] if taking.pitch else 1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            r = (tan2 * d2 - tan1 * d1) / (tan2 - tan1)
            meet = (s1 > 0) & ((tan2 - tan1) * (d1 - d2) > 0)
            place = tan1 * (d1 - r) * grown
        return np.where(meet, r, np.nan), np.where(meet, place, np.nan)

    r, place = solved()
    found = {"s_1": s1, "s_2": s2, "r": r}
    for name in CHANGED:
        found[f"r_{name}"] = solved(name)[0]
        found[f"by_{name}"] = found[f"r_{name}"] - r
    found["r_new"], there = solved(*CHANGED)
    return found | {"change": found["r_new"] - r, "moved": there - place}
