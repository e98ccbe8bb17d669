"""What a stated precision rests on, in one line: what was measured, typed, found or assumed."""

from __future__ import annotations

import numpy as np

from bifocal.model.orientation_precision import NAMES
from bifocal.model.pair import Pair
from bifocal.precision import false_relief_of_scale


def rests_on(pair: Pair, *, setup: str, picks: str, more: str = "") -> str:
    """Return the line that goes with every report of precision.

    Parameters
    ----------
    pair : Pair
        The geometry; its distances say what a slip of 1 % costs.
    setup : str
        Where distances and scales come from.
    picks : str
        Where the precision of the picks comes from.
    more : str
        Anything else, e.g. control points.

    Examples
    --------
    >>> from dataclasses import replace
    >>> pair = Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19)
    >>> rests_on(pair, setup="distances as typed", picks="picks of 0.5 px assumed")
    'Sigmas rest on: picks of 0.5 px assumed; distances as typed, of which 1 % of scale is 0.21 m \
of relief and in no sigma.'
    >>> beside = replace(pair, image2=replace(pair.image1, nadir=(3.0, 0.0), distance=17.4))
    >>> rests_on(beside, setup="the pair as given", picks="picks of 0.5 px")
    'Sigmas rest on: picks of 0.5 px; the pair as given, of whose base of 3.00 m 1 % is 1 % of \
relief and in no sigma.'
    """
    d1, d2 = pair.straight_distances
    aside = float(np.hypot(*np.subtract(pair.image1.nadir, pair.image2.nadir)))
    if aside > abs(d1 - d2):  # the base lies along the wall: relief scales with it
        share = f"of whose base of {aside:.2f} m 1 % is 1 % of relief and in no sigma"
    else:
        slip = float(false_relief_of_scale(0.01, d1=d1, d2=d2))
        share = f"of which 1 % of scale is {slip:.2f} m of relief and in no sigma"
    if (whole := pair.whole_orientation) is not None:
        lens = [NAMES.index(f"focal length {number}") for number in (1, 2)]
        share = "with the covariance of its orientation"
        if not whole[lens].any():  # another program's cameras, placed in a frame by what is known
            share = "with the covariance of its frame and scale alone"
    return f"Sigmas rest on: {picks}; {setup}, {share}{'; ' + more if more else ''}."
