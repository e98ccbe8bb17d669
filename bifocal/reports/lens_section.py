"""The lenses that were estimated with a pair: coefficients, correlations, distortion curves."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from bifocal.model import CAMERA, Photo, pinhole
from bifocal.reports.content import PairContent
from photocore.arrays import FloatArray
from photocore.reports import Block, Heading, Paragraph, Picture, TextTable, Words

#: What belongs to the lens, of `CAMERA`, with its sign in tables.
_LENS = {
    "focal length": "c [px]", "aspect": "cy/cx", "column": "x0 [px]", "row": "y0 [px]",
    "k1": "k1", "k2": "k2",
}  # fmt: skip
#: Signs of what else is estimated of a camera.
_SIGNS = {"turn X": "ω", "turn Y": "φ", "turn Z": "κ"}
#: Correlations above this are told of. [-]
STRONG = 0.95
#: A parameter known better than this is held, not estimated. [ln, px]
_HELD = 1e-7
#: Named at most.
_MOST = 6


def lens_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield the section of the lenses; nothing where no lens was estimated with the pair."""
    covariance, cameras = content.orientation, content.cameras
    estimated = content.setup.get("focal_px") and covariance is not None
    if not estimated and not any(photo.lens for photo in cameras):
        return
    yield Heading(text=say("lens"))
    if covariance is not None and estimated:
        count = len(CAMERA) * len(cameras)
        matrix = np.asarray(covariance)[:count, :count]
        for number in range(1, len(cameras) + 1):
            yield from _coefficients(content, number, matrix, say)
        strong = _strong(matrix)
        if strong:
            yield Paragraph(text=say("lens_strong", names="; ".join(strong)), small=True)
    if any(photo.lens for photo in cameras):
        draw = partial(draw_distortion, content=content, say=say)
        yield Picture(draw=draw, ratio=0.38, caption=say("lens_curve_caption"))


def _coefficients(
    content: PairContent, number: int, covariance: FloatArray, say: Words
) -> Iterator[TextTable]:
    """Yield values, standard deviations and correlations of what was estimated of a lens."""
    camera = pinhole(content.cameras[number - 1]).matrix
    radial = content.setup.get("radial") or [[np.nan] * 2] * number
    focal = float(camera[0, 0])
    values = dict(
        zip(_LENS, (focal, camera[1, 1] / focal, *camera[:2, 2], *radial[number - 1]), strict=True)
    )
    rows_of = [(number - 1) * len(CAMERA) + CAMERA.index(name) for name in _LENS]
    sigma = np.sqrt(np.diag(covariance)[rows_of])
    unit = dict(zip(_LENS, (focal, values["aspect"], 1, 1, 1, 1), strict=True))
    free = [k for k, name in enumerate(_LENS) if sigma[k] > _HELD and np.isfinite(values[name])]
    names = list(_LENS)
    correlation = covariance[np.ix_(rows_of, rows_of)] / np.outer(sigma, sigma).clip(1e-300)
    rows = []
    for place, k in enumerate(free):
        digits = 5 if names[k] in ("aspect", "k1", "k2") else 2
        numbers = (values[names[k]], sigma[k] * unit[names[k]])
        beside = [f"{correlation[k, m]:.2f}" for m in free[: place + 1]]
        shown = [f"{value:.{digits}f}" for value in numbers]
        rows.append([_LENS[names[k]], *shown, *beside, *[""] * (len(free) - place - 1)])
    if rows:
        signs = [_LENS[names[k]].partition(" ")[0] for k in free]
        photo = content.names(say)[number - 1]
        yield TextTable(
            headings=[photo, say("value"), "σ", *signs], rows=rows, caption=say("lens_table")
        )


def _strong(covariance: FloatArray) -> list[str]:
    """Return which parameters of either camera are hardly told apart, the most alike first."""
    sigma = np.sqrt(np.diag(covariance))
    free = np.flatnonzero(sigma > _HELD)
    correlation = covariance[np.ix_(free, free)] / np.outer(sigma[free], sigma[free])
    upper = np.triu(np.abs(correlation), 1)
    places = np.argwhere(upper > STRONG)
    order = np.argsort(-upper[tuple(places.T)])[:_MOST]
    names = [f"{name} {k + 1}" for k in range(len(covariance) // len(CAMERA)) for name in CAMERA]
    signs = [_sign(names[k]) for k in free]
    return [f"{signs[a]} ~ {signs[b]} {correlation[a, b]:.2f}" for a, b in places[order].tolist()]


def _sign(name: str) -> str:
    """Return a parameter in the sign of its row, the same in every language.

    Examples
    --------
    >>> _sign("focal length 1"), _sign("turn Z 2"), _sign("X 2")
    ('c1', 'κ2', 'X2')
    """
    what, _, number = name.rpartition(" ")
    return f"{_SIGNS.get(what) or _LENS.get(what, what).partition(' ')[0]}{number}"


def radial_distortion(photo: Photo, radii: FloatArray) -> FloatArray:
    """Return by how much the lens moves pixels outwards at ideal distances from its centre. [px]"""
    assert photo.lens is not None
    centre = photo.lens.camera_matrix[:2, 2]
    ideal = np.column_stack([radii, np.zeros_like(radii)]) + centre
    seen = photo.lens.distort(ideal)
    return np.asarray(np.hypot(*(seen - centre).T) - radii)


def draw_distortion(figure: Any, content: PairContent, say: Words) -> None:
    """Draw the distortion of either lens by the distance from its centre, with its sigma."""
    axes = figure.add_axes((0.09, 0.17, 0.88, 0.78))
    covariance = content.orientation
    for number, (photo, label) in enumerate(
        zip(content.cameras, content.names(say), strict=True), start=1
    ):
        style, grey = ("-", "0.6") if number == 1 else ((0, (5, 2)), "0.8")
        if photo.lens is None or photo.image_size is None:
            continue
        radii = np.linspace(1.0, float(np.hypot(*photo.image_size)) / 2, 100)
        moved = radial_distortion(photo, radii)
        axes.plot(radii, moved, color="black", lw=1.2, ls=style, label=label)
        if covariance is not None and content.setup.get("radial"):
            square = (radii / pinhole(photo).matrix[0, 0]) ** 2
            rates = radii[:, None] * np.stack([square, square**2], axis=1)
            first = (number - 1) * len(CAMERA) + CAMERA.index("k1")
            own = np.asarray(covariance)[first : first + 2, first : first + 2]
            sigma = np.sqrt(np.einsum("ni,ij,nj->n", rates, own, rates).clip(0))
            axes.fill_between(radii, moved - sigma, moved + sigma, color=grey, lw=0, alpha=0.5)
    axes.axhline(0, color="black", lw=0.6)
    axes.legend(fontsize=8, frameon=False)
    axes.set_xlabel(say("radius_axis"), fontsize=8)
    axes.set_ylabel(say("distortion_axis"), fontsize=8)
    axes.tick_params(labelsize=8)
