"""A report as PDF: the same blocks on pages of A4, figures as vectors."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
#: Type of the cells of tables. [points]
_CELL = 8.0
#: Sizes of figures that are tried, until no page is a third empty; to which part of it a figure may
#: be made smaller to fit on the page begun; height of its caption. [mm]
SIZES, SMALLEST, CAPTION = tuple(round(1.0 - 0.04 * k, 2) for k in range(11)), 0.65, 12.0
#: A grid over the whole page, without gaps.
_WHOLE: dict[str, object] = {"left": 0, "right": 1, "bottom": 0, "top": 1, "wspace": 0, "hspace": 0}


def write_pdf(
    path: Path, document: Document, *, overwrite: bool = False, progress: Progress = no_progress
) -> None:
    """Write a report as PDF that says what its parts are."""
    import matplotlib as mpl

    from photocore.reports.tagged_pdf import TaggedPdf

    date = datetime.fromisoformat(today()).replace(tzinfo=UTC)
    info: dict[str, object] = {"Title": document.title, "Creator": document.subject}
    info |= {"Producer": "bifocal", "CreationDate": date, "ModDate": date}
    info["Subject"] = "; ".join(provenance().lines())
    emptiest: dict[float, float] = {}
    for size in SIZES:
        if 0.0 not in emptiest.values():
            emptiest[size] = _emptiest(document, size)
    size = min(emptiest, key=lambda size: (emptiest[size], -size))
    with atomic_path(path, overwrite=overwrite) as temporary:
        # Where the disk is full, matplotlib tries again as it closes the file, and zlib fails.
        written = BytesIO()
        with mpl.rc_context({"pdf.fonttype": 42}):  # whose letters can be read aloud and searched
            file = TaggedPdf(written, info, document.language)
            _set(_Pages(file, document.title, size), document, progress)
            file.finalize()
            file.close()
        temporary.write_bytes(written.getbuffer())


def _set(pages: _Pages, document: Document, progress: Progress = no_progress) -> None:
    """Set all blocks on pages."""
    for index, block in enumerate(document.blocks):
        progress(index, len(document.blocks), "report")
        pages.add(block, before=document.blocks[index + 1 : index + 2])
    pages.end()


def _emptiest(document: Document, size: float) -> float:
    """Return how much the emptiest page is emptier than a third, were figures of this size. [mm]"""
    pages = _Pages(None, document.title, size)
    _set(pages, document)
    return max(0.0, *(left - (PAGE[1] - 2 * MARGIN) / 3 for left in pages.left))


class _Pages:
    """Pages that fill from the top; lengths in millimetres.

    Parameters
    ----------
    file : TaggedPdf or None
        None: nothing is drawn, only how full the pages are is found.
    title : str
    size : float
        Of figures, over that in which two and a heading fit on a page.
    """

    def __init__(self, file: Any, title: str, size: float) -> None:
        self.file, self.title, self.size = file, title, size
        self.left: list[float] = []
        self.part: Any = None
        self._begin()

    def _begin(self) -> None:
        self.y = PAGE[1] - MARGIN
        if self.file is None:
            return
        from matplotlib.backends.backend_pdf import FigureCanvasPdf
        from matplotlib.figure import Figure

        self.figure = Figure(figsize=(PAGE[0] / 25.4, PAGE[1] / 25.4), dpi=200)
        FigureCanvasPdf(self.figure)
        foot = f"{self.title}  ·  {len(self.left) + 1}"
        self._put(foot, x=PAGE[0] - MARGIN, y=10.0, size=7, ha="right", color="0.3")

    def end(self) -> None:
        """Write the last page."""
        self.left.append(self.y - MARGIN)
        if self.file is not None:
            self.file.add_page(self.figure)

    @contextmanager
    def _within(self, tag: str, alt: str = "") -> Iterator[None]:
        """Let what is set within belong to a part of this kind."""
        outer = self.part
        if self.file is not None:
            self.part = (self.file.tree if outer is None else outer).add(tag, alt)
        yield
        self.part = outer

    def add(self, block: Block, *, before: Sequence[Block] = ()) -> None:
        """Set a block, on a new page where it does not fit; a heading beside what it is before."""
        if isinstance(block, Heading):
            self._heading(block, before)
        elif isinstance(block, Banner):
            with self._within("P"):
                self._banner(block)
        elif isinstance(block, Paragraph):
            with self._within("P"):
                self._text(block.text, size=7.5 if block.small else 9)
                for line in block.lines:
                    self._text(line, size=7, mono=True)
            self.y -= 1.0
        elif isinstance(block, TextTable):
            with self._within("Table"):
                self._table(block)
        else:
            self._picture(block)

    def _heading(self, block: Heading, before: Sequence[Block]) -> None:
        size = {1: 17, 2: 12.5}.get(block.level, 10)
        pictures = [
            SMALLEST * self._height(item) + CAPTION for item in before if isinstance(item, Picture)
        ]
        self._room(size * _MM * 2.2 + max(pictures, default=30.0))
        self.y -= size * _MM * 0.7
        with self._within(f"H{block.level}"):
            self._text(block.text, size=size, weight="bold")
        if block.level <= 2:
            self._line(PAGE[0] - MARGIN, y=self.y - 1.4)
            self.y -= 2.6

    def _height(self, block: Picture) -> float:
        """Return the height of a figure on the page, were all of it free. [mm]"""
        return self.size * min(INNER * block.ratio, (PAGE[1] - 2 * MARGIN - 40) / 2)

    def _room(self, height: float) -> None:
        """Begin a new page where less than a height is left."""
        if self.y - height < MARGIN and self.y < PAGE[1] - MARGIN:
            self.end()
            self._begin()

    def _put(self, text: str, *, x: float, y: float, size: float, **more: Any) -> None:
        if self.file is None or not text.strip():
            return
        more["gid"] = None if self.part is None else self.file.mark(self.part)
        # Dollars would begin a formula.
        self.figure.text(
            x / PAGE[0], y / PAGE[1], text.replace("$", r"\$"), fontsize=size, va="baseline", **more
        )

    def _text(self, text: str, *, size: float, weight: str = "normal", mono: bool = False) -> None:
        wide = _MONO if mono else _WIDE if weight == "normal" else _WIDEST
        letter, indent = size * _MM * wide, 4.0 if mono else 0.0
        width = int((INNER - indent) / letter)
        family = {"family": "monospace"} if mono else {}
        lines = textwrap.wrap(text, width, drop_whitespace=not mono) or [""]
        for line in lines:
            self._room(size * _MM * _LINE)
            self.y -= size * _MM * _LINE
            self._put(line, x=MARGIN + indent, y=self.y, size=size, weight=weight, **family)

    def _line(self, right: float, *, y: float, color: str = "black", lw: float = 0.8) -> None:
        if self.file is None:
            return
        from matplotlib.lines import Line2D

        ends = MARGIN / PAGE[0], right / PAGE[0]
        self.figure.add_artist(Line2D(ends, [y / PAGE[1]] * 2, color=color, lw=lw))

    def _banner(self, block: Banner) -> None:
        from matplotlib.patches import Rectangle

        width = int((INNER - 8) / (12 * _MM * _WIDEST))
        lines = [(line, 12, "bold") for line in textwrap.wrap(block.text, width)]
        for text in block.details:
            width = int((INNER - 8) / (10 * _MM * _WIDE))
            lines += [(line, 10, "normal") for line in textwrap.wrap(text, width)]
        height = sum(size for _, size, _ in lines) * _MM * _LINE + 5
        self._room(height + 4)
        colour = {True: "#1a6e2e", False: "#b00020", None: "black"}[block.good]
        for wide, fill in ((INNER, False), (4.0, True)) if self.file is not None else ():
            corner = MARGIN / PAGE[0], (self.y - height) / PAGE[1]
            sides = wide / PAGE[0], height / PAGE[1]
            box = Rectangle(corner, *sides, fill=fill, lw=1.5, fc=colour, ec=colour)
            self.figure.add_artist(box)
        y = self.y - 1.5
        for text, size, weight in lines:
            y -= size * _MM * _LINE
            self._put(text, x=MARGIN + 7, y=y, size=size, weight=weight)
        self.y -= height + 3

    def _table(self, block: TextTable) -> None:
        if block.caption:
            self._room(24)
            self.y -= 1.5
            with self._within("Caption"):
                self._text(block.caption, size=8.5, weight="bold")
        columns = zip(block.headings, *block.rows, strict=True)
        lengths = [max(4, *map(len, column)) for column in columns]
        # Columns of a table that is too wide share what there is, and their cells are folded.
        letters = INNER / (_CELL * _MM * _WIDEST) - 2.0 * len(lengths)
        while sum(lengths) > letters and max(lengths) > 12:
            lengths[lengths.index(max(lengths))] -= 1
        widths = [(length + 2.0) * _CELL * _MM * _WIDEST for length in lengths]
        for index, row in enumerate([block.headings, *block.rows]):
            cells = (textwrap.wrap(*cell) or [""] for cell in zip(row, lengths, strict=True))
            columns = zip(cells, widths, block.to_the_left, strict=True)
            with self._within("TR"):
                self._row(list(columns), heading=index == 0)
        self.y -= 2.5

    def _row(self, columns: Sequence[tuple[list[str], float, bool]], *, heading: bool) -> None:
        """Set the lines of the cells of a row, in columns of a width, to the left or the right."""
        weight, color, lw = ("bold", "black", 0.8) if heading else ("normal", "0.75", 0.4)
        step = _CELL * _MM * _LINE
        deep = max(len(lines) for lines, *_ in columns) * step
        self._room(deep)
        left = MARGIN
        for lines, width, to_the_left in columns:
            x, ha = (left + 1.0, "left") if to_the_left else (left + width - 1.0, "right")
            with self._within("TH" if heading else "TD"):
                for number, line in enumerate(lines, start=1):
                    y = self.y - number * step + 0.6
                    self._put(line, x=x, y=y, size=_CELL, ha=ha, weight=weight)
            left += width
        self.y -= deep
        self._line(left, y=self.y - 0.2, color=color, lw=lw)

    def _picture(self, block: Picture) -> None:
        height, room = self._height(block), self.y - MARGIN - CAPTION
        if SMALLEST * height <= room < height:
            height = room
        self._room(height + CAPTION)
        if self.file is not None:
            wide = height / block.ratio
            rows, beside = (PAGE[1] - self.y, height, self.y - height), (PAGE[0] - wide) / 2
            ratios = {"height_ratios": rows, "width_ratios": (beside, wide, beside)}
            grid = self.figure.add_gridspec(3, 3, **_WHOLE, **ratios)
            place = self.figure.add_subfigure(grid[1, 1])
            with self._within("Figure", block.caption):
                place.set_gid(self.file.mark(self.part))
            block.draw(place)
        self.y -= height + 1
        with self._within("P"):
            self._text(block.caption, size=7.5)
        self.y -= 2.5
