"""What the transformation to the world adds to the covariance of a point, as formulas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement

#: Turns about E, N, H and the logarithm of the scale, K.
SMALL = "ENHK"
#: What a small change of each moves E, N, H by: sign and coordinate from the origin.
_MOVED = {
    "E": {"N": (1, "H"), "H": (-1, "N"), "K": (1, "E")},
    "N": {"E": (-1, "H"), "H": (1, "E"), "K": (1, "N")},
    "H": {"E": (1, "N"), "N": (-1, "E"), "K": (1, "H")},
}


def entry(first: str, second: str) -> str:
    """Return the name of an entry of a symmetric matrix, whichever way round."""
    return min(first, second) + max(first, second)


def ordered(first: str, second: str) -> str:
    """Return the key of an entry of the covariance of turns and stretch, whichever way round."""
    return first + second if SMALL.index(first) <= SMALL.index(second) else second + first


def added_covariance(first: str, second: str, cells: Mapping[str, str]) -> str:
    """Return what the transformation adds to the covariance of two of E, N, H, as a formula.

    Parameters
    ----------
    first, second : str
        ``E``, ``N`` or ``H``, in that order; the same for a variance.
    cells : mapping
        Where the point's E, N, H from the whole-metre origin stand.
    """
    sums: dict[str, list[tuple[int, str]]] = {}

    def add(axes: str, sign: int, name: str) -> None:
        sums.setdefault("".join(sorted(axes, key="ENH".index)), []).append((sign, name))

    for row, across in ((first, second), (second, first)):
        for small, (sign, axis) in _MOVED[across].items():
            add(axis, -sign, f"g_u_{row}{small}")
    for unit, (sign, axis) in _MOVED[first].items():
        for right, (turned, along) in _MOVED[second].items():
            add(axis + along, sign * turned, f"g_w_{ordered(unit, right)}")
    # Each coordinate is named as rarely as can be: these formulas stand in every row.
    whole = f"g_z_{first if first == second else first + second}"
    for axis in "ENH":
        terms = [
            (axes.removeprefix(axis), named) for axes, named in sums.items() if axes[0] == axis
        ]
        inner = "".join(_multiplied(named, cells.get(rest, "")) for rest, named in terms)
        if inner:
            whole += f"+{cells[axis]}*({inner.removeprefix('+')})"
    return whole


def _multiplied(named: Sequence[tuple[int, str]], cell: str) -> str:
    """Return the terms of names with signs, equal ones once, times a cell if there is one."""
    text = ""
    for name, sum_of_signs in _summed(named).items():
        count = "" if abs(sum_of_signs) == 1 else f"{abs(sum_of_signs)}*"
        if sum_of_signs:
            times = f"*{cell}" if cell else ""
            text += f"{'+' if sum_of_signs > 0 else '-'}{count}{name}{times}"
    return text


def _summed(named: Sequence[tuple[int, str]]) -> dict[str, int]:
    """Return how often each name is added."""
    sums: dict[str, int] = {}
    for sign, name in named:
        sums[name] = sums.get(name, 0) + sign
    return sums


def turned_covariance(one: str, cross: str) -> str:
    """Return the covariance of two of E, N, H, for scale 1, that one on the wall gives.

    Its entries XX, XY ... are parts of a formula: ``{1}`` calls them by what ``{2}`` begins.
    """
    first, second = ("ENH".index(name) + 1 for name in (one, cross))
    terms = []
    for (i, a), (j, b) in combinations_with_replacement(enumerate("XYZ", start=1), 2):
        factor = f"g_{first}{i}*g_{second}{j}"
        if i != j and one == cross:
            factor = f"2*{factor}"
        elif i != j:
            factor = f"({factor}+g_{first}{j}*g_{second}{i})"
        terms.append(f"{factor}*{{{{1}} {{2}}{a}{b}}}")
    return "+".join(terms)


def placed_parts() -> dict[str, str]:
    """Return parts of formulas, each of a pair: ``turned_EN``, ``added_EN`` and the variances."""
    cells = {axis: f"{{{{1}} n_ {axis}}}" for axis in "ENH"}
    pairs = [first + second for first, second in combinations_with_replacement("ENH", 2)]
    return {
        **{f"turned_{pair}": turned_covariance(pair[0], pair[1]) for pair in pairs},
        **{f"added_{pair}": added_covariance(pair[0], pair[1], cells) for pair in pairs},
    }
