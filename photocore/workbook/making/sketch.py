"""Line drawings on sheets, as DrawingML shapes: sharp at any size, text in any language, small.

Lengths are in points from the upper left corner, y down.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from photocore.workbook.making.look import FACE
from photocore.workbook.reading.grid import split_cell
from photocore.workbook.reading.xmltext import escaped, quoted

_EMU = 12700  # per point
_A = "http://schemas.openxmlformats.org/drawingml/2006/main"
_XDR = "http://schemas.openxmlformats.org/drawingml/2006/spreadsheetDrawing"
Place = tuple[float, float]


@dataclass(slots=True, eq=False)
class Sketch:
    """A drawing under construction.

    Parameters
    ----------
    size : tuple of float
        Width and height. [pt]
    told : str
        What it shows, for those who cannot see it.
    """

    size: Place
    told: str
    shapes: list[str] = field(default_factory=list)

    def line(
        self, start: Place, end: Place, colour: str, *, width: float = 1.0, dash: str = "solid",
        arrows: bool = False,
    ) -> None:  # fmt: skip
        """Draw a line; dashes are those of DrawingML: ``dash``, ``sysDot``, ``dashDot``."""
        (x0, y0), (x1, y1) = start, end
        left, top = min(x0, x1), min(y0, y1)
        flip = ' flipV="1"' if (x1 - x0) * (y1 - y0) < 0 else ""
        ends = "".join(
            f'<a:{end} type="triangle" w="sm" len="sm"/>'
            for end in ("headEnd", "tailEnd")
            if arrows
        )
        self.shapes.append(
            f'<xdr:cxnSp macro=""><xdr:nvCxnSpPr>{self._named("line")}<xdr:cNvCxnSpPr/>'
            f"</xdr:nvCxnSpPr><xdr:spPr>{_frame(left, top, abs(x1 - x0), abs(y1 - y0), flip)}"
            f'<a:prstGeom prst="line"><a:avLst/></a:prstGeom><a:ln w="{width * _EMU:.0f}">'
            f'{_filled(colour)}<a:prstDash val="{dash}"/>{ends}</a:ln></xdr:spPr></xdr:cxnSp>'
        )

    def dot(self, at: Place, colour: str, *, size: float = 6.0, form: str = "ellipse") -> None:
        """Draw a filled ``ellipse`` or ``diamond``."""
        frame = _frame(at[0] - size / 2, at[1] - size / 2, size, size)
        self.shapes.append(
            f'<xdr:sp macro="" textlink=""><xdr:nvSpPr>{self._named(form)}<xdr:cNvSpPr/>'
            f'</xdr:nvSpPr><xdr:spPr>{frame}<a:prstGeom prst="{form}"><a:avLst/></a:prstGeom>'
            f"{_filled(colour)}<a:ln><a:noFill/></a:ln></xdr:spPr></xdr:sp>"
        )

    def text(
        self, at: Place, text: str, colour: str, *, size: float = 11.0, bold: bool = False,
        italic: bool = False,
    ) -> None:  # fmt: skip
        """Write a text about a point; what follows ``_`` is set lower, as an index."""
        style = f'sz="{size * 100:.0f}" b="{bold:d}" i="{italic:d}"'
        runs = ""
        for i, part in enumerate(text.split("_")):
            lower = ' baseline="-25000"' if i else ""
            runs += (
                f'<a:r><a:rPr lang="en-US" {style}{lower}>{_filled(colour)}'
                f'<a:latin typeface="{FACE}"/></a:rPr><a:t>{escaped(part)}</a:t></a:r>'
            )
        width, height = size * (0.8 * len(text) + 1), size * 1.5
        frame = _frame(at[0] - width / 2, at[1] - height / 2, width, height)
        self.shapes.append(
            f'<xdr:sp macro="" textlink=""><xdr:nvSpPr>{self._named("text")}'
            f'<xdr:cNvSpPr txBox="1"/></xdr:nvSpPr><xdr:spPr>{frame}<a:prstGeom prst="rect">'
            "<a:avLst/></a:prstGeom><a:noFill/></xdr:spPr><xdr:txBody>"
            '<a:bodyPr wrap="none" lIns="0" tIns="0" rIns="0" bIns="0" anchor="ctr"/>'
            f'<a:p><a:pPr algn="ctr"/>{runs}</a:p></xdr:txBody></xdr:sp>'
        )

    def measure(self, start: Place, end: Place, text: str, colour: str, offset: Place) -> None:
        """Draw a measure between two points, its symbol beside the middle."""
        self.line(start, end, colour, width=0.75, arrows=True)
        middle = ((start[0] + end[0]) / 2 + offset[0], (start[1] + end[1]) / 2 + offset[1])
        self.text(middle, text, colour, size=14, italic=True)

    def part(self, cell: str) -> bytes:
        """Return the drawing as a part of a package, its upper left corner at a cell."""
        row, column = split_cell(cell)
        width, height = (f"{length * _EMU:.0f}" for length in self.size)
        extent = f'cx="{width}" cy="{height}"'
        return (
            f'<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
            f'<xdr:wsDr xmlns:xdr="{_XDR}" xmlns:a="{_A}"><xdr:oneCellAnchor><xdr:from>'
            f"<xdr:col>{column - 1}</xdr:col><xdr:colOff>0</xdr:colOff>"
            f"<xdr:row>{row - 1}</xdr:row><xdr:rowOff>0</xdr:rowOff></xdr:from>"
            f"<xdr:ext {extent}/><xdr:grpSp><xdr:nvGrpSpPr>"
            f'<xdr:cNvPr id="1" name="sketch" descr={quoted(self.told)}/><xdr:cNvGrpSpPr/>'
            f'</xdr:nvGrpSpPr><xdr:grpSpPr><a:xfrm><a:off x="0" y="0"/><a:ext {extent}/>'
            f'<a:chOff x="0" y="0"/><a:chExt {extent}/></a:xfrm></xdr:grpSpPr>'
            f"{''.join(self.shapes)}</xdr:grpSp><xdr:clientData/></xdr:oneCellAnchor></xdr:wsDr>"
        ).encode()

    def _named(self, kind: str) -> str:
        number = len(self.shapes) + 2
        return f'<xdr:cNvPr id="{number}" name="{kind} {number}"/>'


def _frame(left: float, top: float, width: float, height: float, more: str = "") -> str:
    x, y, cx, cy = (f"{length * _EMU:.0f}" for length in (left, top, width, height))
    return f'<a:xfrm{more}><a:off x="{x}" y="{y}"/><a:ext cx="{cx}" cy="{cy}"/></a:xfrm>'


def _filled(colour: str) -> str:
    return f'<a:solidFill><a:srgbClr val="{colour}"/></a:solidFill>'
