"""What the transformation to the world adds to the covariance of a point, as formulas."""

from __future__ import annotations

from collections.abc import Mapping

#: Turns about E, N, H and the logarithm of the scale, K.
SMALL = "ENHK"
#: What a small change of each moves E, N, H by: sign and coordinate from the origin.
_MOVED = {
    "E": {"N": (1, "H"), "H": (-1, "N"), "K": (1, "E")},
    "N": {"E": (-1, "H"), "H": (1, "E"), "K": (1, "N")},
    "H": {"E": (1, "N"), "N": (-1, "E"), "K": (1, "H")},
}
#: Whether the point of a row is a control point in use, which shares its error with the fit.
IS_CONTROL = 'SUMPRODUCT((tblGeo[id]&""=[@id]&"")*tblGeo[w])>0'


def ordered(one: str, other: str) -> str:
    """Return the key of an entry of the covariance of turns and stretch, whichever way round."""
    return one + other if SMALL.index(one) <= SMALL.index(other) else other + one


def added_covariance(one: str, other: str, cells: Mapping[str, str]) -> str:
    """Return what the transformation adds to the covariance of two of E, N, H, as a formula.

    Parameters
    ----------
    one, other : str
        ``E``, ``N`` or ``H``, in that order; the same for a variance.
    cells : mapping
        Where the point's E, N, H from the whole-metre origin stand.
    """
    terms = [f"g_z_{one if one == other else one + other}"]
    for own, across in ((one, other), (other, one)):
        for small, (sign, axis) in _MOVED[across].items():
            terms.append(f"{'-' if sign > 0 else '+'}g_u_{own}{small}*{cells[axis]}")
    for left, (sign, axis) in _MOVED[one].items():
        for right, (turned, along) in _MOVED[other].items():
            mark = "+" if sign * turned > 0 else "-"
            terms.append(f"{mark}g_w_{ordered(left, right)}*{cells[axis]}*{cells[along]}")
    return "".join(terms)


def turned_covariance(one: str, other: str, cell: str) -> str:
    """Return the covariance of two of E, N, H, for scale 1, that one on the wall gives.

    Parameters
    ----------
    one, other : str
        ``E``, ``N`` or ``H``.
    cell : str
        Where its entries stand, with ``{}`` for their keys XX, XY ...
    """
    first, second = ("ENH".index(name) + 1 for name in (one, other))
    return "+".join(
        f"g_{first}{i}*g_{second}{j}*{cell.format(min(a, b) + max(a, b))}"
        for i, a in enumerate("XYZ", start=1)
        for j, b in enumerate("XYZ", start=1)
    )
