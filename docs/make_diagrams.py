"""Draw what words of the pages mean, and the checklist: `python docs/make_diagrams.py`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from photocore.reports.document import Document, Heading, Paragraph, TextTable
from photocore.reports.pdf_pages import write_pdf

HERE = Path(__file__).parent
INK, FAR, NEAR, RED = "#1b2733", "#2e75b6", "#c77700", "#b00020"
#: The pair of the pages: distances [m], relief of the point and its place above the nadir [m].
D1, D2, R, Y = 17.5, 9.5, 1.2, 4.0


def plain(figure: Figure, place: tuple[float, float, float, float], limits: Any) -> Axes:
    """Return axes to scale without a frame."""
    axes = figure.add_axes(place)
    axes.set(aspect="equal", xlim=limits[:2], ylim=limits[2:])
    axes.set_axis_off()
    return axes


def note(axes: Axes, words: str, at: tuple[float, float], **more: Any) -> None:
    """Write words at a place."""
    axes.text(*at, words, fontsize=9, color=more.pop("color", INK), **more)


def camera(axes: Axes, d: float, name: str, colour: str) -> None:
    """Draw a camera on the line square to the wall, from the side."""
    axes.plot([-d], [0], marker=">", ms=11, color=colour)
    note(axes, name, (-d, -0.75), ha="center", color=colour)


def nadir(figure: Figure) -> None:
    """From the side: cameras, nadir, a point that stands out and where both photos show it."""
    axes = plain(figure, (0, 0, 1, 1), (-19.5, 5.6, -3.2, 8.6))
    axes.plot([0, 0], [-2, 7.5], color=INK, lw=5, solid_capstyle="butt")
    note(axes, "wall (r = 0)", (0.35, 7.0))
    axes.plot([-D1, 0], [0, 0], color=INK, lw=0.7, ls=":")
    for d, name, colour, below in (
        (D1, "far, long lens", FAR, -2.0),
        (D2, "near, short lens", NEAR, -2.7),
    ):
        camera(axes, d, name, colour)
        seen = Y * d / (d - R)
        axes.plot([-d, 0], [0, seen], color=colour, lw=1.2)
        axes.plot([0], [seen], "o", color=colour, ms=6)
        axes.annotate(
            "",
            (0, below + 0.3),
            (-d, below + 0.3),
            arrowprops={"arrowstyle": "<->", "color": colour},
        )
        note(axes, f"d{1 if d == D1 else 2}", (-d / 2, below + 0.45), color=colour)
    axes.plot([-R, 0], [Y, Y], color=RED, lw=2)
    axes.plot([-R], [Y], "o", color=RED, ms=7)
    note(axes, "point stands out by r", (-R - 0.2, Y + 0.35), ha="right", color=RED)
    axes.plot([0], [0], "x", color=INK, ms=9, mew=2)
    note(axes, "nadir: foot of\nthe cameras", (0.35, -0.4))
    note(axes, "seen by the near one", (0.35, Y * D2 / (D2 - R) + 0.05), color=NEAR)
    note(axes, "seen by the far one", (0.35, Y * D1 / (D1 - R) - 0.45), color=FAR)


def radial(figure: Figure) -> None:
    """Both photos over each other: points on radial lines, the blind spot about the nadir."""
    axes = plain(figure, (0, 0, 1, 1), (-7.6, 7.6, -4.6, 4.8))
    axes.add_patch(mpl.patches.Rectangle((-6.6, -4.2), 13.2, 8.4, fill=False, color=INK, lw=1.2))
    axes.add_patch(mpl.patches.Circle((0, 0), 1.0, color="0.85"))
    axes.plot([0], [0], "x", color=INK, ms=9, mew=2)
    note(
        axes,
        "nadir, and the blind spot about it:\nno relief can be measured here",
        (0, -1.25),
        ha="center",
        va="top",
    )
    for angle, size, words in (
        (0.35, 1.15, "stands out: the near photo\nshows it farther out"),
        (2.6, 0.87, "lies back: the near photo\nshows it farther in"),
    ):
        way = np.array([np.cos(angle), np.sin(angle)])
        axes.plot(*np.outer(way, [0, 6.4]), color=INK, lw=0.7, ls=":")
        axes.plot(*(4.0 * way), "o", color=FAR, ms=7)
        axes.plot(*(4.0 * size * way), "o", color=NEAR, ms=7)
        note(axes, words, tuple(4.0 * way + [0, 0.55]), ha="center", va="bottom")
    point = np.array([4.2, -2.6])
    axes.plot(*np.outer(point, [0, 1.35]), color=INK, lw=0.7, ls=":")
    axes.plot(*point, "o", color=FAR, ms=10)
    axes.plot(*point, "o", color=NEAR, ms=5)
    note(
        axes,
        "wall point: both photos\nshow it at one place",
        (point[0] - 0.35, point[1] - 0.15),
        ha="right",
        va="top",
    )
    note(
        axes, "blue: far photo    orange: near photo    dotted: radial line", (0, 4.4), ha="center"
    )


def blind_spot(figure: Figure) -> None:
    """Precision of relief along the wall, which is lost about the nadir."""
    axes = figure.add_axes((0.1, 0.17, 0.87, 0.78))
    x = np.linspace(-6, 6, 601)
    pixel, factor = 0.5 * 3.69, D1 * D2 / (D1 - D2)
    with np.errstate(divide="ignore"):
        sigma = np.sqrt(2) * pixel * factor / np.abs(x)
    axes.plot(x, sigma, color=INK)
    axes.axvspan(-1.1, 1.1, color="0.88")
    note(axes, "blind spot", (0, 70), ha="center")
    axes.set(ylim=(0, 80), xlim=(-6, 6))
    axes.set_xlabel("way along the wall from the nadir [m]", fontsize=9)
    axes.set_ylabel("standard deviation of r [mm]", fontsize=9)
    axes.tick_params(labelsize=8)


def one_scale(figure: Figure) -> None:
    """From above: the same piece of wall fills both photos, since c1/d1 = c2/d2."""
    axes = plain(figure, (0, 0, 1, 1), (-22.5, 2.6, -5.6, 5.6))
    axes.plot([0, 0], [-5.2, 5.2], color=INK, lw=5, solid_capstyle="butt")
    for d, c, name, colour in ((D1, 35, "35 mm at 17.5 m", FAR), (D2, 19, "19 mm at 9.5 m", NEAR)):
        for side in (-1, 1):
            axes.plot([-d, 0], [0, 4.6 * side], color=colour, lw=1)
            axes.plot([-d, -d - 0.05 * c], [0, -4.6 / d * 0.05 * c * side], color=colour, lw=1)
        half = 4.6 / d * 0.05 * c
        axes.plot([-d - 0.05 * c] * 2, [-half, half], color=colour, lw=4, solid_capstyle="butt")
        note(axes, name, (-d - 0.05 * c, 1.0), ha="center", color=colour)
    note(
        axes,
        "35 / 17.5 = 19 / 9.5 = 2: a metre of wall is\n2 mm on both sensors: one scale",
        (-11, -4.6),
        ha="center",
    )
    note(axes, "wall", (0.4, 4.6))


def pixels(figure: Figure) -> None:
    """How pixels are counted here, and in picture viewers."""
    axes = plain(figure, (0, 0, 1, 1), (-1.1, 9.2, 4.2, -1.3))
    for column in range(4):
        for row in range(3):
            axes.add_patch(
                mpl.patches.Rectangle((column, row), 1, 1, fill=False, color=INK, lw=0.8)
            )
            note(axes, f"{column}, {row}", (column + 0.5, row + 0.55), ha="center", va="center")
    axes.plot([0.5], [0.5], "o", ms=26, mfc="none", color=RED)
    note(
        axes,
        "(0, 0): the middle of the first pixel;\ncolumn to the right, row downwards",
        (4.4, 0.4),
        color=RED,
        va="center",
    )
    note(
        axes,
        "Viewers that begin with 1: take off 1 from each.\n"
        "Those that count from the corner of the first\n"
        "pixel (0.5, 0.5 is its middle): take off 0.5.",
        (4.4, 2.0),
        va="center",
    )
    axes.annotate(
        "column", (3.9, -0.3), (0.1, -0.3), arrowprops={"arrowstyle": "->"}, fontsize=9, va="center"
    )
    axes.annotate(
        "row", (-0.3, 2.9), (-0.3, 0.1), arrowprops={"arrowstyle": "->"}, fontsize=9, ha="center"
    )


def refracted(figure: Figure) -> None:
    """Draw a ray through glass into water, and where the point seems to be from the air."""
    axes = plain(figure, (0, 0, 1, 1), (-6.5, 6.5, -5.2, 3.6))
    axes.axhspan(-5.2, -0.5, color="#dbe9f4")
    axes.axhspan(-0.5, 0.0, color="#b9c4cc")
    tangent, slopes = 0.9, []
    sine = tangent / np.hypot(1, tangent)
    for index in (1.0, 1.49, 1.337):
        inside = sine / index
        slopes.append(inside / np.sqrt(1 - inside**2))
    x = np.cumsum([-4.2, 3 * slopes[0], 0.5 * slopes[1], 4 * slopes[2]])
    axes.plot(x, [3, 0, -0.5, -4.5], color=FAR, lw=1.6)
    axes.plot([x[0], x[0] + 7.5 * tangent], [3, -4.5], color=INK, lw=0.8, ls=":")
    axes.plot([x[0]], [3], marker="v", ms=11, color=FAR)
    axes.plot([x[3]], [-4.5], "o", color=RED, ms=7)
    axes.plot([x[3], x[0] + 7.5 * tangent], [-4.5, -4.5], color=RED, lw=1)
    for words, at in (("air, n = 1", 1.6), ("glass, n = 1.49", -0.33), ("water, n = 1.337", -2.4)):
        note(axes, words, (-6.3, at))
    note(axes, "where it is", (x[3] - 0.2, -4.4), ha="right", color=RED)
    note(
        axes,
        "where it is looked for\nif nobody thinks of water",
        (x[0] + 7.5 * tangent + 0.2, -4.6),
    )


def checklist(language: str, words: dict[str, Any]) -> Document:
    """Return the list to print for the site."""
    blocks: list[Any] = [Heading(text=words["title"], level=1)]
    for part in words["part"]:
        rows = [["☐", text] for text in part["items"]]
        blocks.append(TextTable(headings=["", part["name"]], rows=rows))
    blank = [[name, "", "", ""] for name in words["fields"]]
    # Room to write in.
    wide = [name.ljust(22, "\N{NO-BREAK SPACE}") for name in words["columns"]]
    blocks.append(TextTable(headings=[words["notes"], *wide], rows=blank))
    blocks.append(Paragraph(text=words["foot"], small=True))
    return Document(
        title=words["title"], language=language, subject="bifocal", blocks=tuple(blocks)
    )


DIAGRAMS = {
    nadir: (7.2, 3.7), radial: (7.2, 4.45), blind_spot: (6.4, 2.6), one_scale: (7.2, 3.5),
    pixels: (7.2, 3.85), refracted: (7.2, 4.87),
}  # fmt: skip


def main() -> None:
    """Draw everything into docs/images."""
    mpl.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "bifocal"}
    for draw, size in DIAGRAMS.items():
        figure = Figure(figsize=size, facecolor="white")
        draw(figure)
        name = draw.__name__.replace("_", "-")
        figure.savefig(HERE / "images" / f"{name}.svg", metadata={"Date": None})
    lists = tomllib.loads((HERE / "checklist.toml").read_text(encoding="utf-8"))
    for language, words in lists.items():
        path = HERE / "images" / f"checklist-{language}.pdf"
        write_pdf(path, checklist(language, words), overwrite=True)


if __name__ == "__main__":
    main()
