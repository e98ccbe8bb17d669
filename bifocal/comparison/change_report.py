"""What has changed, as the blocks of a report."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from bifocal.comparison.chance import LEAST
from bifocal.comparison.change import Comparison
from bifocal.remarks import in_language
from bifocal.reports import figures
from photocore.provenance import provenance
from photocore.reports import (
    Banner,
    Block,
    Document,
    Heading,
    Paragraph,
    Picture,
    TextTable,
    Words,
    dated_document,
    words_of,
)
from photocore.textfile import packaged

#: Pixels along a side of the map in the report.
_SIDE = 900


def change_document(done: Comparison, names: tuple[str, str], language: str) -> Document:
    """Return the report of a comparison of two files of these names."""
    say = words_of("bifocal.comparison", language)
    title = say("title", before=names[0], after=names[1])
    return dated_document(title, language, say, _blocks(done, say, language))


def _blocks(done: Comparison, say: Words, language: str) -> Iterator[Block]:
    n = len(done.regions)
    text = say("some" if n else "none", n=n, area=done.compared)
    notes = [in_language(note, language) for note in done.remarks]
    yield Banner(text=text, details=(say("meaning", level=done.level), *notes))
    yield Heading(text=say("map"))
    ratio = figures.ratio_of(done.difference.bounds)
    draw = partial(_draw_map, done=done, say=say)
    yield Picture(draw=draw, ratio=ratio, caption=say("map_caption"))
    if done.regions:
        yield Heading(text=say("regions"))
        headings = [say("number"), "X [m]", "Y [m]"]
        headings += [
            say(key) for key in ("area", "measured", "volume", "mean", "largest", "chance")
        ]
        yield TextTable(headings=headings, rows=_rows(done), caption=say("region_table"))
    yield Picture(draw=partial(_draw_histogram, done=done, say=say), ratio=0.35,
                  caption=say("histogram"))  # fmt: skip
    yield Heading(text=say("found"))
    rows = [
        [f"{area:.3g}", *(f"{1000 * one:.2g}" if np.isfinite(one) else "-" for one in least)]
        for area, *least in done.patches
    ]
    headings = [say("area"), say("least"), say("least_most")]
    yield TextTable(headings=headings, rows=rows, caption=say("found_table"))
    yield Heading(text=say("how"))
    yield Paragraph(text=say("method", length=done.correlation_length))
    offset, x, y = (1000 * value for value in done.trend)
    sigma = 1000 * done.sigma_trend[0]
    key = "fitted" if any(done.sigma_trend) else "as_given"
    yield Paragraph(text=say(key, offset=offset, sigma=sigma, x=x, y=y))
    if lines := provenance().lines():
        yield Paragraph(text="", small=True, lines=tuple(lines))


def _rows(done: Comparison) -> list[list[str]]:
    def pair(value: float, sigma: float, factor: float, digits: int, sign: str = "+") -> str:
        return f"{factor * value:{sign}.{digits}f} ± {factor * sigma:.{digits}f}"

    return [
        [
            str(one.number), f"{one.X:.2f}", f"{one.Y:.2f}",
            pair(one.area, one.sigma_area, 1, 3, "-"), f"{100 * one.measured:.0f} %",
            pair(one.volume, one.sigma_volume, 1000, 2),
            pair(one.mean, one.sigma_mean, 1000, 1),
            pair(one.largest, one.sigma_largest, 1000, 1),
            f"{one.probability:.1g}" if one.probability > LEAST else f"< {LEAST:g}",
        ]
        for one in done.regions
    ]  # fmt: skip


def _draw_map(figure: Any, done: Comparison, say: Words) -> None:
    """Draw the difference with the outlines and numbers of its regions."""
    bounds = done.difference.bounds
    axes = figures.plane_axes(figure, bounds, figures.BESIDE)
    axes.set_facecolor("0.8")
    styles = packaged(__package__, "styles")
    step = max(1, -(-max(done.difference.shape) // _SIDE))
    r, region = 1000 * done.difference.r[::step, ::step], done.region[::step, ::step]
    finite = np.abs(r[np.isfinite(r)])
    largest = max((1000 * abs(one.largest) for one in done.regions), default=0.0)
    reach = max(float(np.percentile(finite, 95)), largest, 0.01)
    image = axes.imshow(
        r, extent=figures.extent_of(bounds), vmin=-reach, vmax=reach, **styles["difference"]
    )
    x, y = done.difference.grid.columns_x[::step], done.difference.grid.rows_y[::step]
    if done.regions:
        axes.contour(x, y, (region > 0).astype(float), **styles["outline"])
    for one in done.regions:
        axes.annotate(str(one.number), (one.X, one.Y), **styles["number"])
    figures.colour_bar(figure, image, say("axis"), extend="both")
    figures.scale_bar(axes, bounds)


def _draw_histogram(figure: Any, done: Comparison, say: Words) -> None:
    """Draw how often which difference is, significant regions dark."""
    axes, styles = figure.add_axes((0.1, 0.2, 0.86, 0.72)), packaged(__package__, "styles")
    r = 1000 * done.difference.r.astype(float)
    finite = np.isfinite(r)
    reach = max(float(np.percentile(np.abs(r[finite]), 99)), 0.01)
    edges = np.linspace(-reach, reach, 61)
    axes.hist(r[finite], edges, **styles["all"])
    if (changed := finite & (done.region > 0)).any():
        axes.hist(r[changed], edges, **styles["changed"])
    axes.set_yscale("log")
    axes.set_xlabel(say("axis"), fontsize=8)
    axes.tick_params(labelsize=7)
