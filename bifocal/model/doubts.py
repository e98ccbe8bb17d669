"""What a pair file says is wrong with its own pair: in words, and as a covariance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from contextlib import suppress
from typing import Any

import numpy as np

from bifocal.model.orientation_precision import NAMES
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.remarks import keys_in

#: A wall bent by certainly more than this, at 3000 px of width, is not that of an honest pair; by
#: how many standard deviations it is certain. [px]
MOST_BENT, CERTAIN = 0.2, 2.0
#: Root mean square bend at 3000 px of width by k of x (1 + k rho²), rho over half the diagonal, and
#: what of k the scale takes up, certainly and by chance: errors of r over sigma_r are 0.8 to
#: 1.4 on simulated pairs of nearly one axis whose lens bends the wall by 1 to 7 px. [px, -]
BEND_BY_K, TAKEN_UP, OR_MORE = 144.0, 0.2, 0.1
#: Unit of lengths to which nothing gives a scale, and of all others.
NO_UNIT, METRES = "none", "m"
#: Keys of doubts that leave no word of how good relief is, of those about which plane is the
#: wall, of lengths that check; how these began in files of versions that kept no keys.
MISFITS = frozenset(
    {"orientation.misses_lines", "orientation.bent", "pair.bent", "orientation.aside"}
)
RIVALS = frozenset({"orientation.rivals"})
LENGTHS = frozenset({"orientation.lengths_disagree", "orientation.scale_disagrees"})
_WITHOUT_KEYS = {"THE MODEL DOES NOT FIT": "pair.bent", "CHECK THE WALL": "orientation.rivals"}
#: What free diagnostics may lack or hold instead of numbers.
NO_NUMBER = (LookupError, TypeError, ValueError, ZeroDivisionError)


def shape_is_certain(px: float, sigma: float) -> bool:
    """Return whether a wall bent by so much between the photos says that the model does not fit."""
    return px - CERTAIN * sigma > MOST_BENT


def doubts_in_words(setup: Any) -> tuple[str, ...]:
    """Return what is known to be wrong with a pair, from the ``setup`` of its file."""
    doubts = setup.get("doubts") if isinstance(setup, dict) else ()
    if doubts is None and (bend := _bend(setup)):
        doubts = [remark("pair.bent", bend=bend, most=MOST_BENT)]
    return tuple(map(str, doubts)) if isinstance(doubts, list | tuple) else ()


def doubts_of(keys: Set[str], texts: Iterable[str]) -> list[str]:
    """Return the remarks that have one of some keys.

    Examples
    --------
    >>> bent = remark("pair.bent", bend=0.7, most=0.2)
    >>> doubts_of(MISFITS, ["It leans.", bent]) == [bent]
    True
    """
    return [text for text in texts if keys & _keys(text)]


def _keys(text: str) -> set[str]:
    return keys_in(text) | {key for words, key in _WITHOUT_KEYS.items() if text.startswith(words)}


def check_scale(extra: Mapping[str, object], name: object) -> None:
    """Refuse a drawing scale of a pair or set whose lengths are no metres.

    Parameters
    ----------
    extra : mapping
        Further keys of its file; ``"unit": "none"`` there, or a doubt in those of older versions.
    name : object
        What to call it.

    Raises
    ------
    InputError
        If it has no scale.
    """
    if unit_of(extra) == NO_UNIT:
        raise InputError(remark("projects.no_drawing_scale", of=name))


def unit_of(extra: Mapping[str, object]) -> str:
    """Return the unit of a pair's or set's lengths: ``m``, or ``none`` where nothing gave a scale.

    Examples
    --------
    >>> unit_of({}), unit_of({"unit": "none"})
    ('m', 'none')
    """
    untold = str(remark("projects.no_scale"))[:9]
    doubts = doubts_in_words(extra.get("setup"))
    return (
        NO_UNIT
        if extra.get("unit") == NO_UNIT or any(doubt.startswith(untold) for doubt in doubts)
        else METRES
    )


def untold(sentences: Iterable[str], remarks: Iterable[str]) -> list[str]:
    """Return the remarks that were not told before, be it without the file they are of.

    Examples
    --------
    >>> untold(["It is bent."], ["w.pair.json: It is bent.", "It leans.", "It leans."])
    ['It leans.']
    """
    earlier = tuple(sentences)
    new: list[str] = []
    for text in remarks:
        if not text.endswith((*earlier, *new)):
            new.append(text)
    return new


def covariance_of_doubts(setup: Any) -> FloatArray | None:
    """Return what doubts add to the covariance of both cameras; None where there are none.

    Parameters
    ----------
    setup : object
        As the pair file states it.

    Returns
    -------
    ndarray, shape (24, 24), or None
        Of `NAMES`.

    Notes
    -----
    A bend counts as radial distortion k of one photo against the other, with what a scale takes up
    of it; another face that may be the wall moves both cameras alike; a wall that repeats itself
    leaves the near camera some periods aside.
    """
    variance = np.zeros((len(NAMES), len(NAMES)))
    k1, scale, *both = (NAMES.index(name) for name in ("k1 1", "focal length 1", "Z 1", "Z 2"))
    with suppress(*NO_NUMBER):
        k = _bend(setup) / BEND_BY_K
        half = float(np.hypot(*setup["principal_point_px"][0]))
        bent = np.zeros(len(NAMES))
        bent[[k1, scale]] = k * (float(setup["focal_px"][0]) / half) ** 2, -TAKEN_UP * k
        variance = np.outer(bent, bent)
        variance[scale, scale] += (OR_MORE * k) ** 2
    for place in ("X 2", "Y 2"):
        with suppress(*NO_NUMBER):
            aside = float(setup["standard_deviations"][f"aside_{place[0].lower()}"])
            variance[NAMES.index(place), NAMES.index(place)] += aside**2
    with suppress(*NO_NUMBER):
        offset = float(setup["standard_deviations"]["relief_offset"])
        variance[np.ix_(both, both)] += offset**2
    return variance if variance.any() and np.isfinite(variance).all() else None


def _bend(setup: Any) -> float:
    """Return by how much the wall is certainly bent between the photos, else 0. [px]"""
    with suppress(*NO_NUMBER):
        bend, sigma = float(setup["wall_bend_px"]), float(setup.get("wall_bend_sigma_px") or 0.0)
        return bend if shape_is_certain(bend, sigma) else 0.0
    return 0.0
