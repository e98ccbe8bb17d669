"""A print sheet as PDF: picture at exact scale, frame, title block, grid, scale bar, level mark.

Written directly: the picture goes from the raster to the page strip by strip, so a sheet of
100 megapixels needs no more memory than a small one, and 1 mm of the page is 1 mm on paper.
"""

from __future__ import annotations

import math
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from bifocal.files.strips import Strips, predicted
from bifocal.orthophotos.canvas import BLUE, WHITE, Colour, Pen, Place, text_width
from bifocal.orthophotos.contour_lines import contour_labels
from bifocal.orthophotos.drawing import Drawing, PrintSheet
from bifocal.orthophotos.sheet_margins import SheetMargins
from bifocal.orthophotos.tuning import CONTOURS, SHEET, SPOTS
from photocore.output import atomic_path
from photocore.provenance import Provenance, provenance

#: PDF's own unit in millimetres: 72 to the inch.
_UNITS_PER_MM = 72 / 25.4
#: Dark red: seen on both colours of the relief and on stone.
_RED: Colour = (110, 20, 20)
_CONTOUR = Pen(layer="", width=0.1, colour=_RED)
_INDEX = Pen(layer="", width=0.22, colour=_RED)
_CUT = Pen(layer="", width=0.15, colour=BLUE, dashes=(6.0, 1.0, 0.6, 1.0))
#: White around a section line, whose blue is lost on dark glass.
_CUT_RIM = replace(_CUT, width=0.45, colour=WHITE)
_NAME = Pen(layer="")


class LeftOut(NamedTuple):
    """How many names of points had no room on a sheet, and how many points lie outside of it."""

    names: int
    points: int


def write_sheet(path: Path, drawing: Drawing, sheet: PrintSheet, strips: Strips) -> LeftOut:
    """Write a drawing on a sheet; empty pixels are white; return what was left out.

    Names that would lie over others are left out, and where points are many their names keep
    apart, so that they never bury the picture.
    """
    with atomic_path(path, overwrite=False) as temporary, temporary.open("wb") as file:
        pdf = _Pdf(file)
        picture = pdf.begin_stream(
            f"/Type /XObject /Subtype /Image /Width {drawing.grid.width} "
            f"/Height {drawing.grid.height} /ColorSpace /DeviceRGB /BitsPerComponent 8 "
            f"/DecodeParms << /Predictor 15 /Colors 3 /Columns {drawing.grid.width} >>"
        )
        above = np.zeros((1, drawing.grid.width * 3), np.uint8)
        for colours, valid in strips:
            paper = np.where(valid[:, :, None] > 0, colours, np.uint8(255))
            pixels = paper.reshape(len(paper), -1)
            pdf.add(predicted(pixels, above))
            above = pixels[-1:]
        pdf.end_stream()
        page = _Page(drawing, sheet)
        pdf.finish(page.commands(), picture, sheet)
    return LeftOut(names=page.nameless, points=page.outside)


class _Pdf:
    """The objects of a PDF file, with their places."""

    def __init__(self, file: BinaryIO) -> None:
        self.file, self.places = file, [0]
        file.write(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")

    def begin_stream(self, entries: str) -> int:
        """Open a compressed stream whose length is written after it."""
        number = self._begin()
        self.length_at = number + 1
        head = f"<< {entries} /Filter /FlateDecode /Length {self.length_at} 0 R >>\nstream\n"
        self.file.write(head.encode("ascii"))
        self._start, self._packer = self.file.tell(), zlib.compressobj(3)
        return number

    def add(self, data: bytes) -> None:
        """Add to the open stream."""
        self.file.write(self._packer.compress(data))

    def end_stream(self) -> None:
        """Close the stream and write its length."""
        self.file.write(self._packer.flush())
        length = self.file.tell() - self._start
        self.file.write(b"\nendstream\nendobj\n")
        self.object(str(length))

    def object(self, body: str) -> int:
        """Write an object and return its number."""
        number = self._begin()
        self.file.write(f"{body}\nendobj\n".encode("cp1252"))
        return number

    def _begin(self) -> int:
        number = len(self.places)
        self.places.append(self.file.tell())
        self.file.write(f"{number} 0 obj\n".encode("ascii"))
        return number

    def finish(self, commands: str, picture: int, sheet: PrintSheet) -> None:
        """Write page, catalogue and table of objects."""
        content = self.begin_stream("")
        self.add(commands.encode("cp1252", errors="replace"))
        self.end_stream()
        fonts = [
            self.object(
                f"<< /Type /Font /Subtype /Type1 /BaseFont /{name} /Encoding /WinAnsiEncoding >>"
            )
            for name in ("Helvetica", "Helvetica-Bold")
        ]
        pages = len(self.places) + 1
        width, height = sheet.width * _UNITS_PER_MM, sheet.height * _UNITS_PER_MM
        page = self.object(
            f"<< /Type /Page /Parent {pages} 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] "
            f"/Contents {content} 0 R /Resources << /XObject << /Im {picture} 0 R >> "
            f"/Font << /F1 {fonts[0]} 0 R /F2 {fonts[1]} 0 R >> >> >>"
        )
        self.object(f"<< /Type /Pages /Kids [{page} 0 R] /Count 1 >>")
        # Viewers must not fit the page to the paper: the scale would be lost.
        root = self.object(
            f"<< /Type /Catalog /Pages {pages} 0 R /ViewerPreferences << /PrintScaling /None >> >>"
        )
        info = self.object(_properties(provenance()))
        start = self.file.tell()
        rows = "".join(f"{place:010d} 00000 n \n" for place in self.places[1:])
        table = f"xref\n0 {len(self.places)}\n0000000000 65535 f \n{rows}"
        trailer = f"trailer\n<< /Size {len(self.places)} /Root {root} 0 R /Info {info} 0 R >>\n"
        self.file.write(f"{table}{trailer}startxref\n{start}\n%%EOF\n".encode("ascii"))


def _properties(origin: Provenance) -> str:
    """Return the entries that viewers show as properties of the file."""
    metadata = {
        "Creator": origin.program,
        "Producer": "bifocal",
        "Subject": "; ".join(origin.lines()),
    }
    texts = {key: f"\ufeff{text}".encode("utf-16-be").hex() for key, text in metadata.items()}
    entries = " ".join(f"/{key} <{text}>" for key, text in texts.items())
    return f"<< {entries} /CreationDate (D:{origin.date.replace('-', '')}000000Z) >>"


class _PdfCanvas:
    """Drawing commands of a page. [mm]"""

    def __init__(self) -> None:
        self.parts = [f"{_UNITS_PER_MM:.8f} 0 0 {_UNITS_PER_MM:.8f} 0 0 cm"]
        self._rim = False

    def line(self, points: Sequence[Place], pen: Pen) -> None:
        start, *rest = (f"{x:.4f} {y:.4f}" for x, y in points)
        steps = " ".join(f"{point} l" for point in rest)
        dashes = " ".join(f"{length:g}" for length in pen.dashes)
        self.parts.append(f"{_tint(pen.colour)} RG {pen.width:g} w [{dashes}] 0 d")
        self.parts.append(f"{start} m {steps} S")

    def area(self, corners: Sequence[Place], pen: Pen) -> None:
        start, *rest = (f"{x:.4f} {y:.4f}" for x, y in corners)
        steps = " ".join(f"{point} l" for point in rest)
        self.parts.append(f"{_tint(pen.colour)} rg {start} m {steps} f")

    def text(
        self, place: Place, words: str, pen: Pen, *, size: float = 2.5, bold: bool = False,
        middle: bool = False, angle: float = 0.0,
    ) -> None:  # fmt: skip
        clean = words.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
        turn = math.radians(angle)
        cos, sin = (0.0 if abs(v) < 1e-12 else v for v in (math.cos(turn), math.sin(turn)))
        shift = text_width(words, size) / 2 if middle else 0.0
        x, y = place[0] - shift * cos, place[1] - shift * sin
        matrix = f"{cos:g} {sin:g} {0.0 - sin:g} {cos:g} {x:.4f} {y:.4f}"
        self.parts.append(f"{_tint(pen.colour)} rg")
        if not _in_pdf_font(words):
            how = "S" if self._rim else "f"
            self.parts.append(f"q {matrix} cm {outlines(words, size, bold=bold)} {how} Q")
            return
        self.parts.append(f"BT /F{2 if bold else 1} {size} Tf {matrix} Tm ({clean}) Tj ET")

    def label(self, place: Place, words: str, pen: Pen, **how: Any) -> None:
        """Write with a white outline: legible on any colour."""
        self.parts.append("1 G 0.7 w [] 0 d 1 Tr")
        self._rim = True
        self.text(place, words, pen, **how)
        self._rim = False
        self.parts.append("0 Tr")
        self.text(place, words, pen, **how)


class _Page:
    """Everything on a sheet but the picture itself."""

    def __init__(self, drawing: Drawing, sheet: PrintSheet) -> None:
        self.drawing, self.sheet = drawing, sheet
        self.canvas = _PdfCanvas()
        self.margins = SheetMargins(self.canvas, drawing, sheet)
        #: Left, right, bottom, top of the names of points; how many points have none, or are
        #: not on the picture. [mm]
        self.labels: list[tuple[float, float, float, float]] = []
        self.nameless = self.outside = 0

    def commands(self) -> str:
        """Return all commands."""
        x, y = self.margins.origin
        wide, high = self.drawing.paper_size
        parts = self.canvas.parts
        parts.append(f"q {wide:.6f} 0 0 {high:.6f} {x:.6f} {y:.6f} cm /Im Do Q")
        self._crosses()
        # What runs to the edge of the picture must not be drawn beyond it.
        parts.append(f"q {x:.4f} {y:.4f} {wide:.4f} {high:.4f} re W n")
        self._contours()
        for cut in self.drawing.sections:
            line = [self.margins.place(*corner) for corner in cut.path.tolist()]
            self.canvas.line(line, _CUT_RIM)
            self.canvas.line(line, _CUT)
        parts.append("Q")
        self._spots()
        self._points()
        self.margins.draw()
        return "\n".join(parts) + "\n"

    def _crosses(self) -> None:
        for pen in (Pen(layer="", width=0.5, colour=WHITE), Pen(layer="", width=0.13)):
            for place in self.drawing.crosses().tolist():
                self._cross(self.margins.place(*place), 2, pen)

    def _cross(self, place: Place, size: float, pen: Pen) -> None:
        x, y = place
        self.canvas.line([(x - size, y), (x + size, y)], pen)
        self.canvas.line([(x, y - size), (x, y + size)], pen)

    def _contours(self) -> None:
        for contour in self.drawing.contours:
            line = [self.margins.place(x, y) for x, y in contour.line.tolist()]
            self.canvas.line(line, _INDEX if contour.index else _CONTOUR)
        for label in contour_labels(self.drawing.contours, self.drawing.scale):
            place = self.margins.place(*label.place)
            how = {"size": CONTOURS.label_size, "middle": True, "angle": label.angle}
            self.canvas.label(place, label.words, _INDEX, **how)

    def _spots(self) -> None:
        """Draw spot heights: a dot and its relief."""
        for x, y, words in self.drawing.spot_words():
            px, py = self.margins.place(x, y)
            self._cross((px, py), 0.8, _INDEX)
            self._label((px + 1.0, py + 0.5), words, size=SPOTS.size)

    def _label(self, place: Place, words: str, *, size: float) -> None:
        """Write on the picture, moved inwards where the frame would cut it."""
        left, bottom, right, top = self.sheet.frame
        x = max(left + 1, min(place[0], right - 1 - text_width(words, size)))
        y = max(bottom + SHEET.strip + 1, min(place[1], top - 1 - size))
        self.canvas.label((x, y), words, _NAME, size=size)

    def _points(self) -> None:
        """Draw all points, and the names that have room; control points come first."""
        for points, size in ((self.drawing.control, 1.6), (self.drawing.points, 1.0)):
            if points is None:
                continue
            if len(points.ids) > SHEET.many:
                size /= 2
            for name, (x, y, _) in zip(points.ids, points.xyz.tolist(), strict=True):
                if np.isfinite(x) and np.isfinite(y):
                    if not self._shown(x, y):
                        self.outside += 1
                        continue
                    place = self.margins.place(x, y)
                    self._point(name, place, size, points is self.drawing.control)

    def _shown(self, x: float, y: float) -> bool:
        """Return whether a point lies on the picture: elsewhere it might lie over the title."""
        xmin, ymin, xmax, ymax = self.drawing.grid.bounds
        slack = self.drawing.scale / 1000.0  # 1 mm on paper
        return xmin - slack <= x <= xmax + slack and ymin - slack <= y <= ymax + slack

    def _point(self, name: str, place: Place, size: float, is_control: bool) -> None:
        px, py = place
        if is_control:
            corners = [(px - size, py - size), (px + size, py - size), (px, py + size)]
            self.canvas.line([*corners, corners[0]], Pen(layer="", width=0.25))
        else:
            self._cross(place, size, _NAME)
        edge = self.margins.origin[0] + self.drawing.paper_size[0]
        beside, wide = px + size + 0.4, text_width(name, 2.0)
        if px <= edge < beside + wide:  # the edge of the picture would cut it
            beside = px - size - 0.4 - wide
        boxes = np.reshape(self.labels, (-1, 4))
        near = (boxes[:, 0] < beside + wide) & (beside < boxes[:, 1])
        if (near & (boxes[:, 2] < py + 2.4) & (py + 0.4 < boxes[:, 3])).any():
            self.nameless += 1
            return
        # Where points are many, names take a share of the picture, not all of it.
        clear = 3.0 if len(self.labels) > SHEET.many else 0.0
        self.labels.append((beside - clear, beside + wide + clear, py - clear, py + 2.0 + clear))
        self._label((beside, py + 0.4), name, size=2.0)


def _tint(colour: Colour) -> str:
    return " ".join(f"{value / 255:.3g}" for value in colour)


def _in_pdf_font(words: str) -> bool:
    """Return whether every viewer has the letters of a text: those of Western Europe."""
    try:
        words.encode("cp1252")
    except UnicodeEncodeError:
        return False
    return True


def outlines(words: str, size: float, *, bold: bool = False) -> str:
    """Return a text as a path of PDF, as wide as in Helvetica: letters of any script. [mm]"""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a letter that it lacks becomes a box
        path = TextPath((0, 0), words, size=size, prop=font, usetex=False)
    wide = path.vertices[:, 0].max() if len(path.vertices) else 0.0
    squeeze = min(1.0, text_width(words, size) / max(wide, 1e-9))
    commands, last = [], np.zeros(2)
    for flat, code in path.iter_segments(simplify=False):
        places = np.reshape(flat, (-1, 2)) * [squeeze, 1.0]
        if code == path.CLOSEPOLY:
            commands.append("h")
            continue
        if code == path.CURVE3:  # PDF knows cubic curves only
            bend, end = places
            places = np.array([last + 2 / 3 * (bend - last), end + 2 / 3 * (bend - end), end])
        letter = {path.MOVETO: "m", path.LINETO: "l"}.get(code, "c")
        commands.append(" ".join(f"{value:.4f}" for value in places.ravel()) + f" {letter}")
        last = places[-1]
    return " ".join(commands)
