"""A print sheet as PDF: picture at exact scale, frame, title block, grid, scale bar, level mark.

Written directly: the picture goes from the raster to the page strip by strip, so a sheet of
100 megapixels needs no more memory than a small one, and 1 mm of the page is 1 mm on paper.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bifocal.files.geotiff import RasterReader
from bifocal.files.strips import colour_strips, predicted
from bifocal.orthophotos.drawing import BAND, STRIP, Drawing, PrintSheet, multiples
from photocore.output import atomic_path
from photocore.provenance import Provenance, provenance

#: PDF's own unit in millimetres: 72 to the inch.
_UNITS_PER_MM = 72 / 25.4
#: Mean width of Helvetica's letters in its size; digits have exactly this.
_WIDTH = 0.556
#: More points than this are drawn smaller, and their names further apart.
_MANY = 60


def write_sheet(
    path: Path, drawing: Drawing, sheet: PrintSheet, reader: RasterReader, *, overwrite: bool
) -> int:
    """Write a drawing on a sheet; empty pixels are white; return how many points bear no name.

    Names that would lie over others are left out, and where points are many their names keep
    apart, so that they never bury the picture.
    """
    with atomic_path(path, overwrite=overwrite) as temporary, temporary.open("wb") as file:
        pdf = _Pdf(file)
        picture = pdf.begin_stream(
            f"/Type /XObject /Subtype /Image /Width {drawing.grid.width} "
            f"/Height {drawing.grid.height} /ColorSpace /DeviceRGB /BitsPerComponent 8 "
            f"/DecodeParms << /Predictor 15 /Colors 3 /Columns {drawing.grid.width} >>"
        )
        above = np.zeros((1, drawing.grid.width * 3), np.uint8)
        for colours, valid in colour_strips(reader):
            paper = np.where(valid[:, :, None] > 0, colours, np.uint8(255))
            pixels = paper.reshape(len(paper), -1)
            pdf.add(predicted(pixels, above))
            above = pixels[-1:]
        pdf.end_stream()
        page = _Page(drawing, sheet)
        pdf.finish(page.commands(), picture, sheet)
    return page.nameless


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


def _properties(made: Provenance) -> str:
    """Return the entries that viewers show as properties of the file."""
    known = {"Creator": made.program, "Producer": "bifocal", "Subject": "; ".join(made.lines())}
    texts = {key: f"\ufeff{text}".encode("utf-16-be").hex() for key, text in known.items()}
    entries = " ".join(f"/{key} <{text}>" for key, text in texts.items())
    return f"<< {entries} /CreationDate (D:{made.date.replace('-', '')}000000Z) >>"


class _Page:
    """The drawing commands of a sheet, in millimetres."""

    def __init__(self, drawing: Drawing, sheet: PrintSheet) -> None:
        self.drawing, self.sheet = drawing, sheet
        self.parts = [f"{_UNITS_PER_MM:.8f} 0 0 {_UNITS_PER_MM:.8f} 0 0 cm"]
        self.origin = sheet.origin(drawing)
        self.factor = 1000.0 / drawing.scale
        #: Left, right, bottom, top of the names of points; how many points have none. [mm]
        self.labels: list[tuple[float, float, float, float]] = []
        self.nameless = 0

    def commands(self) -> str:
        """Return all commands."""
        x, y = self.origin
        wide, high = self.drawing.paper_size
        self.parts.append(f"q {wide:.6f} 0 0 {high:.6f} {x:.6f} {y:.6f} cm /Im Do Q")
        for draw in (
            self._frame, self._grid, self._contours, self._points, self._title, self._scale_bar,
            self._level, self._legend,
        ):  # fmt: skip
            draw()
        return "\n".join(self.parts) + "\n"

    def _place(self, x: float, y: float) -> tuple[float, float]:
        """Return where a plane position is on the sheet. [mm]"""
        xmin, ymin, _, _ = self.drawing.grid.bounds
        return self.origin[0] + (x - xmin) * self.factor, self.origin[1] + (y - ymin) * self.factor

    def _line(self, points: list[tuple[float, float]], *, width: float = 0.18) -> None:
        start, *rest = (f"{x:.4f} {y:.4f}" for x, y in points)
        steps = " ".join(f"{point} l" for point in rest)
        self.parts.append(f"{width} w {start} m {steps} S")

    def _cross(self, x: float, y: float, size: float, *, width: float = 0.18) -> None:
        self._line([(x - size, y), (x + size, y)], width=width)
        self._line([(x, y - size), (x, y + size)], width=width)

    def _box(self, x: float, y: float, wide: float, high: float, *, fill: bool = False) -> None:
        self.parts.append(f"0.18 w {x:.4f} {y:.4f} {wide:.4f} {high:.4f} re {'B' if fill else 'S'}")

    def _text(
        self, x: float, y: float, text: str, *, size: float = 2.5, bold: bool = False,
        middle: bool = False, turned: bool = False,
    ) -> None:  # fmt: skip
        clean = text.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
        # Helvetica's digits are 0.556 of the size wide; close enough to centre short labels.
        shift = 0.278 * size * len(text) if middle else 0.0
        upright = f"1 0 0 1 {x - shift:.4f} {y:.4f}"
        matrix = f"0 1 -1 0 {x:.4f} {y - shift:.4f}" if turned else upright
        self.parts.append(f"BT /F{2 if bold else 1} {size} Tf {matrix} Tm ({clean}) Tj ET")

    def _frame(self) -> None:
        left, bottom, right, top = self.sheet.frame
        self.parts.append("0 G 0 g")
        self.parts.append(f"0.5 w {left} {bottom} {right - left:.4f} {top - bottom:.4f} re S")
        self._line([(left, bottom + STRIP), (right, bottom + STRIP)], width=0.35)
        x, y = self.origin
        self._box(x, y, *self.drawing.paper_size)

    def _grid(self) -> None:
        """Draw crosses on the picture, and ticks with coordinates around it."""
        xmin, ymin, xmax, ymax = self.drawing.grid.bounds
        step = self.drawing.grid_step()
        for shade, width in (("1 G", 0.5), ("0 G", 0.13)):  # white halo: legible on any colour
            self.parts.append(shade)
            for place in self.drawing.crosses().tolist():
                self._cross(*self._place(*place), 2, width=width)
        digits = 0 if step >= 1 else (1 if step >= 0.1 else 2)
        for x in multiples(xmin, xmax, step).tolist():
            for y, tick, beside in ((ymin, -1.5, -4.2), (ymax, 1.5, 2.2)):
                px, py = self._place(x, y)
                self._line([(px, py), (px, py + tick)])
                self._text(px, py + beside, f"{x:.{digits}f}", size=2.2, middle=True)
        for y in multiples(ymin, ymax, step).tolist():
            for x, tick, beside in ((xmin, -1.5, -2.2), (xmax, 1.5, 4.0)):
                px, py = self._place(x, y)
                self._line([(px, py), (px + tick, py)])
                text = f"{y:.{digits}f}"
                self._text(px + beside, py, text, size=2.2, middle=True, turned=True)

    def _contours(self) -> None:
        self.parts.append("0.75 0.1 0.1 RG")
        for _, line in self.drawing.contours:
            self._line([self._place(x, y) for x, y in line.tolist()], width=0.1)
        self.parts.append("0.1 0.2 0.8 RG")
        for cut in self.drawing.sections:
            self._line([self._place(x, y) for x, y in cut.path.tolist()], width=0.2)
        for cut in self.drawing.sections:
            x, y = self._place(*cut.path[0].tolist())
            self._label(x + 0.8, y + 0.8, cut.name, size=2.4)
        self.parts.append("0 G")

    def _label(self, x: float, y: float, text: str, *, size: float) -> None:
        """Write on the picture, moved inwards where the frame would cut it."""
        left, bottom, right, top = self.sheet.frame
        wide = _WIDTH * size * len(text)
        x = max(left + 1, min(x, right - 1 - wide))
        y = max(bottom + STRIP + 1, min(y, top - 1 - size))
        self.parts.append("1 G 0.7 w 1 Tr")  # white outline: legible on any colour
        self._text(x, y, text, size=size)
        self.parts.append("0 G 0 Tr")
        self._text(x, y, text, size=size)

    def _legend(self) -> None:
        """Draw the colours of a relief, and what the hatching means."""
        legend = self.drawing.legend
        if legend is None:
            return
        left, bottom, _, _ = self.sheet.frame
        x, y, wide, high = left + 6, bottom + 17.0, 36.0, 2.2
        part = wide / len(legend.colours)
        for number, colour in enumerate(legend.colours):
            tint = " ".join(f"{value / 255:.3f}" for value in colour)
            box = f"{x + number * part:.4f} {y} {part + 0.02:.4f} {high}"
            self.parts.append(f"{tint} rg {box} re f")
        self.parts.append("0 g")
        self._box(x, y, wide, high)
        low, top = legend.limits
        for share, unit in ((0.0, ""), (0.5, ""), (1.0, " m")):
            text = f"{low + share * (top - low):+.2f}{unit}"
            self._text(x + share * wide, y + 3, text, size=2.2, middle=True)
        if not legend.guessed:
            return
        x += wide + 5
        self.parts.append(f"0.8 g {x:.4f} {y} 4 {high} re f 0 g")
        for step in range(4):
            self._line([(x + step, y), (x + step + 1, y + high)], width=0.25)
        self._text(x + 5, y + 0.3, f"not measured {legend.guessed:.1%}", size=2.2)

    def _points(self) -> None:
        """Draw all points, and the names that have room; control points come first."""
        for points, size in ((self.drawing.control, 1.6), (self.drawing.points, 1.0)):
            if points is None:
                continue
            if len(points.ids) > _MANY:
                size /= 2
            for name, (x, y, _) in zip(points.ids, points.xyz.tolist(), strict=True):
                if np.isfinite(x) and np.isfinite(y):
                    self._point(name, self._place(x, y), size, points is self.drawing.control)

    def _point(self, name: str, place: tuple[float, float], size: float, is_control: bool) -> None:
        px, py = place
        if is_control:
            corners = [(px - size, py - size), (px + size, py - size), (px, py + size)]
            self._line([*corners, corners[0]], width=0.25)
        else:
            self._cross(px, py, size)
        edge = self.origin[0] + self.drawing.paper_size[0]
        beside, wide = px + size + 0.4, _WIDTH * 2.0 * len(name)
        if px <= edge < beside + wide:  # the edge of the picture would cut it
            beside = px - size - 0.4 - wide
        boxes = np.reshape(self.labels, (-1, 4))
        near = (boxes[:, 0] < beside + wide) & (beside < boxes[:, 1])
        if (near & (boxes[:, 2] < py + 2.4) & (py + 0.4 < boxes[:, 3])).any():
            self.nameless += 1
            return
        # Where points are many, names take a share of the picture, not all of it.
        clear = 3.0 if len(self.labels) > _MANY else 0.0
        self.labels.append((beside - clear, beside + wide + clear, py - clear, py + 2.0 + clear))
        self._label(beside, py + 0.4, name, size=2.0)

    def _title(self) -> None:
        left, bottom, right, _ = self.sheet.frame
        block = left + 0.44 * (right - left)
        self._line([(block, bottom), (block, bottom + STRIP)], width=0.35)
        room = right - block - 5

        def fitting(text: str, size: float) -> float:
            """Return the size at which a text does not run into the frame."""
            return round(min(size, room / (1.08 * _WIDTH * max(len(text), 1))), 3)

        title = self.drawing.title
        self._text(block + 3, bottom + STRIP - 8, title, size=fitting(title, 5.0), bold=True)
        kind = f"{self.drawing.subtitle} 1:{self.drawing.scale:g}"
        self._text(block + 3, bottom + STRIP - 14, kind, size=3.5)
        self._text(right - 30, bottom + 2.5, self.sheet.name, size=2.2)
        for number, note in enumerate(self.drawing.notes[:5]):
            self._text(block + 3, bottom + STRIP - 19 - 3.2 * number, note, size=fitting(note, 2.2))

    def _scale_bar(self) -> None:
        left, bottom, _, _ = self.sheet.frame
        length = self.drawing.bar_length()
        wide = length * self.factor
        x, y = left + 6, bottom + 8
        for part in range(5):
            self.parts.append("0 g" if part % 2 == 0 else "1 g")
            self._box(x + part * wide / 5, y, wide / 5, 1.8, fill=True)
        self.parts.append("0 g")
        for part in (0, 1, 5):
            text = f"{length * part / 5:g}{' m' if part == 5 else ''}"
            self._text(x + part * wide / 5, y + 3, text, size=2.4, middle=True)
        self._text(x, y - 4.2, f"1:{self.drawing.scale:g}  (print at 100 %)", size=2.2)

    def _level(self) -> None:
        """Draw the level mark: the triangle that says how high Y = 0 is, and where up is."""
        left, bottom, _, _ = self.sheet.frame
        x, y = left + 8, bottom + STRIP - 7
        self._line([(x - 2.2, y + 3), (x + 2.2, y + 3), (x, y), (x - 2.2, y + 3)], width=0.25)
        self._line([(x - 4, y), (x + 22, y)], width=0.25)
        self._text(x + 4, y + 1, "±0.00 = Y 0", size=2.6)
        arrow = left + 40
        self._line([(arrow, y - 3), (arrow, y + 4)], width=0.3)
        self._line([(arrow - 1, y + 2), (arrow, y + 4), (arrow + 1, y + 2)], width=0.3)
        self._text(arrow + 2, y, "Y up", size=2.4)
        xmin, ymin, _, ymax = self.drawing.grid.bounds
        if ymin <= 0 <= ymax:
            px, py = self._place(xmin, 0.0)
            tip = px - BAND + 2.2
            self._line([(tip - 1.4, py + 2), (tip + 1.4, py + 2), (tip, py), (tip - 1.4, py + 2)])
