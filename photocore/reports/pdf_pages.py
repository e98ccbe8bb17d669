"""A report as PDF: the same blocks on pages of A4, figures as vectors."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

from photocore.cli import Progress, no_progress
from photocore.output import atomic_path
from photocore.provenance import provenance, today
from photocore.reports.document import (
    Banner,
    Block,
    Document,
    Heading,
    Paragraph,
    Picture,
    TextTable,
)

#: Page and margins. [mm]
PAGE, MARGIN = (210.0, 297.0), 18.0
INNER = PAGE[0] - 2 * MARGIN
#: Points of type to mm, height of a line over that of its type, widths of letters over it.
_MM, _LINE, _WIDE, _MONO = 0.3528, 1.35, 0.55, 0.61
#: Widths of letters where none may touch the next column or the frame: figures and bold type.
_WIDEST = 0.66


def write_pdf(
    path: Path, document: Document, *, overwrite: bool = False, progress: Progress = no_progress
) -> None:
    """Write a report as PDF."""
    from matplotlib.backends.backend_pdf import PdfPages

    made = datetime.fromisoformat(today()).replace(tzinfo=UTC)
    info = {
        "Title": document.title, "Creator": document.subject, "Producer": "bifocal",
        "CreationDate": made, "ModDate": made, "Subject": "; ".join(provenance().lines()),
    }  # fmt: skip
    with atomic_path(path, overwrite=overwrite) as temporary:
        # Where the disk is full, matplotlib tries again as it closes the file, and zlib fails.
        written = BytesIO()
        with PdfPages(written, metadata=info) as file:
            pages = _Pages(file, document.title)
            for index, block in enumerate(document.blocks):
                progress(index, len(document.blocks), "report")
                pages.add(block, before=document.blocks[index + 1 : index + 2])
            pages.end()
        temporary.write_bytes(written.getbuffer())


def _height(block: Picture) -> float:
    """Return the height of a figure on the page: two of them and a heading fit on one. [mm]"""
    return min(INNER * block.ratio, (PAGE[1] - 2 * MARGIN - 40) / 2)


class _Pages:
    """Pages that fill from the top; lengths in millimetres."""

    def __init__(self, file: Any, title: str) -> None:
        self.file, self.title, self.number = file, title, 0
        self._begin()

    def _begin(self) -> None:
        from matplotlib.backends.backend_pdf import FigureCanvasPdf
        from matplotlib.figure import Figure

        self.figure = Figure(figsize=(PAGE[0] / 25.4, PAGE[1] / 25.4), dpi=200)
        FigureCanvasPdf(self.figure)
        self.number += 1
        self.y = PAGE[1] - MARGIN
        foot = f"{self.title}  ·  {self.number}"
        self._put(foot, x=PAGE[0] - MARGIN, y=10.0, size=7, ha="right", color="0.3")

    def end(self) -> None:
        """Write the last page."""
        self.file.savefig(self.figure)

    def add(self, block: Block, *, before: Sequence[Block] = ()) -> None:
        """Set a block, on a new page where it does not fit; a heading beside what it is before."""
        if isinstance(block, Heading):
            size = {1: 17, 2: 12.5}.get(block.level, 10)
            pictures = [_height(item) + 12 for item in before if isinstance(item, Picture)]
            self._room(size * _MM * 2.2 + max(pictures, default=30.0))
            self.y -= size * _MM * 0.7
            self._text(block.text, size=size, weight="bold")
            if block.level <= 2:
                self._rule()
        elif isinstance(block, Banner):
            self._banner(block)
        elif isinstance(block, Paragraph):
            self._text(block.text, size=7.5 if block.small else 9)
            for line in block.lines:
                self._text(line, size=7, mono=True, indent=4)
            self.y -= 1.0
        elif isinstance(block, TextTable):
            self._table(block)
        else:
            self._picture(block)

    def _room(self, height: float) -> None:
        """Begin a new page where less than a height is left."""
        if self.y - height < MARGIN and self.y < PAGE[1] - MARGIN:
            self.end()
            self._begin()

    def _put(self, text: str, *, x: float, y: float, size: float, **more: Any) -> None:
        # Dollars would begin a formula.
        self.figure.text(
            x / PAGE[0], y / PAGE[1], text.replace("$", r"\$"), fontsize=size, va="baseline", **more
        )

    def _text(
        self, text: str, *, size: float, weight: str = "normal", mono: bool = False,
        indent: float = 0.0,
    ) -> None:  # fmt: skip
        letter = size * _MM * (_MONO if mono else _WIDE)
        width = int((INNER - indent) / letter)
        family = {"family": "monospace"} if mono else {}
        lines = textwrap.wrap(text, width, drop_whitespace=not mono) or [""]
        for line in lines:
            self._room(size * _MM * _LINE)
            self.y -= size * _MM * _LINE
            self._put(line, x=MARGIN + indent, y=self.y, size=size, weight=weight, **family)

    def _rule(self) -> None:
        from matplotlib.lines import Line2D

        self.y -= 1.4
        y = self.y / PAGE[1]
        ends = (MARGIN / PAGE[0], 1 - MARGIN / PAGE[0])
        self.figure.add_artist(Line2D(ends, (y, y), color="black", lw=0.8))
        self.y -= 1.2

    def _banner(self, block: Banner) -> None:
        from matplotlib.patches import Rectangle

        lines = textwrap.wrap(block.text, int((INNER - 8) / (12 * _MM * _WIDEST)))
        details = [
            line for text in block.details
            for line in textwrap.wrap(text, int((INNER - 8) / (10 * _MM * _WIDE)))
        ]  # fmt: skip
        height = (12 * len(lines) + 10 * len(details)) * _MM * _LINE + 5
        self._room(height + 4)
        colour = {True: "#1a6e2e", False: "#b00020", None: "black"}[block.good]
        for wide, fill in ((INNER, False), (4.0, True)):
            self.figure.add_artist(
                Rectangle(
                    (MARGIN / PAGE[0], (self.y - height) / PAGE[1]), wide / PAGE[0],
                    height / PAGE[1], fill=fill, facecolor=colour, edgecolor=colour, lw=1.5,
                )
            )  # fmt: skip
        y = self.y - 1.5
        for text, size, weight in (
            *((line, 12, "bold") for line in lines), *((line, 10, "normal") for line in details),
        ):  # fmt: skip
            y -= size * _MM * _LINE
            self._put(text, x=MARGIN + 7, y=y, size=size, weight=weight)
        self.y -= height + 3

    def _table(self, block: TextTable) -> None:
        if block.caption:
            self._room(24)
            self.y -= 1.5
            self._text(block.caption, size=8.5, weight="bold")
        columns = list(zip(block.headings, *block.rows, strict=True))
        lengths = [max(4, *(len(cell) for cell in column)) for column in columns]
        size = 8.0
        # Columns of a table that is too wide share what there is, and their cells are folded.
        letters = INNER / (size * _MM * _WIDEST) - 2.0 * len(lengths)
        while sum(lengths) > letters and max(lengths) > 12:
            lengths[lengths.index(max(lengths))] -= 1
        widths = [(length + 2.0) * size * _MM * _WIDEST for length in lengths]
        for index, row in enumerate([block.headings, *block.rows]):
            cells = [
                textwrap.wrap(cell, length) or [""]
                for cell, length in zip(row, lengths, strict=True)
            ]
            self._row(cells, widths, size, left_columns=block.to_the_left, heading=index == 0)
        self.y -= 2.5

    def _row(
        self, cells: list[list[str]], widths: list[float], size: float, *,
        left_columns: Sequence[bool], heading: bool,
    ) -> None:  # fmt: skip
        from matplotlib.lines import Line2D

        deep = max(map(len, cells)) * size * _MM * _LINE
        self._room(deep)
        left = MARGIN
        for column, (lines, width) in enumerate(zip(cells, widths, strict=True)):
            for number, line in enumerate(lines, start=1):
                words = left_columns[column]
                self._put(
                    line, x=left if words else left + width - 1.0,
                    y=self.y - number * size * _MM * _LINE + 0.6, size=size,
                    ha="left" if words else "right", weight="bold" if heading else "normal",
                )  # fmt: skip
            left += width
        self.y -= deep
        self.figure.add_artist(
            Line2D(
                (MARGIN / PAGE[0], left / PAGE[0]), [(self.y - 0.2) / PAGE[1]] * 2,
                color="black" if heading else "0.75", lw=0.8 if heading else 0.4,
            )
        )  # fmt: skip

    def _picture(self, block: Picture) -> None:
        height = _height(block)
        wide = height / block.ratio
        self._room(height + 12)
        grid = self.figure.add_gridspec(
            3, 3, left=0, right=1, bottom=0, top=1, wspace=0, hspace=0,
            height_ratios=(PAGE[1] - self.y, height, self.y - height),
            width_ratios=((PAGE[0] - wide) / 2, wide, (PAGE[0] - wide) / 2),
        )  # fmt: skip
        block.draw(self.figure.add_subfigure(grid[1, 1]))
        self.y -= height + 1
        self._text(block.caption, size=7.5)
        self.y -= 2.5
