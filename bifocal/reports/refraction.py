"""What it would cost to take a pair through media for one in air."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bifocal.reports.accuracy import millimetres
from bifocal.reports.content import PairContent
from bifocal.survey import refraction_errors
from photocore.arrays import FloatArray
from photocore.reports import Block, Paragraph, Words

#: Places looked at across and along the near photo.
_GRID = 15


def refraction_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield the paragraph on neglected refraction; nothing in air."""
    if not content.pair.refracted:
        return
    yield Paragraph(text=say("refraction", **_sizes(plane_errors(content))))
    if content.solution is not None:
        errors = refraction_errors(content.solution.pair, content.solution.points)
        if len(errors):
            yield Paragraph(text=say("refraction_points", n=len(errors), **_sizes(errors)))


def plane_errors(content: PairContent) -> FloatArray:
    """Return the errors of X, Y, r over the wall if refraction were neglected.

    Returns
    -------
    ndarray, shape (n, 3)
        Sizes, at places of the reference plane that both photos show; without photo files at
        places up to 0.3 d2 from the near nadir. [m]
    """
    pair = content.pair
    if content.photos:
        width, height = content.photos[1].size
        steps = (np.linspace(0, size - 1, _GRID) for size in (width, height))
        pixels = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
        places = pair.image2.plane_from_pixels(pixels)
    else:
        reach = np.linspace(-0.3, 0.3, _GRID) * pair.d2
        places = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2) + pair.image2.nadir
    places = places[np.isfinite(places).all(axis=1)]
    xyz = np.column_stack([places, np.zeros(len(places))])
    first, second = pair.project(xyz)
    if content.photos:
        last = np.array(content.photos[0].size) - 1
        inside = ((first >= 0) & (first <= last)).all(axis=1)
        first = np.where(np.asarray(inside)[:, None], first, np.nan)
    # At the nadir itself nothing tells relief.
    off = np.abs(pair.in_air().intersect(first, second).xyz - xyz)
    return np.asarray(off[np.isfinite(off).all(axis=1)])


def _sizes(errors: FloatArray) -> dict[str, str]:
    """Return the largest and the median error of relief and the largest of places, in words."""
    if not len(errors):
        return dict.fromkeys(("most", "median", "aside"), "-")
    return {
        "most": millimetres(float(errors[:, 2].max())),
        "median": millimetres(float(np.median(errors[:, 2]))),
        "aside": millimetres(float(np.hypot(errors[:, 0], errors[:, 1]).max())),
    }
