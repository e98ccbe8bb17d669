"""Charts of new workbooks: dots or lines that Excel and LibreOffice draw alike."""

from __future__ import annotations

from collections.abc import Mapping

from openpyxl.chart import BarChart, Reference, ScatterChart, Series
from openpyxl.chart.data_source import StrData, StrRef, StrVal
from openpyxl.chart.shapes import GraphicalProperties
from openpyxl.chart.text import RichText, Text
from openpyxl.chart.title import Title
from openpyxl.drawing.text import (
    CharacterProperties,
    Paragraph,
    ParagraphProperties,
    RegularTextRun,
)
from openpyxl.utils import absolute_coordinate

from photocore.workbook.making.look import BLUE

#: Colours and markers of series, told apart without colour too.
COLOURS = (BLUE, "C55A11")
_MARKERS = ("circle", "triangle")
_TITLE, _AXIS = 1200, 1000


def titled(text: str, size: int = _TITLE) -> Title:
    """Return a title in the scale of sizes of all sheets. [1/100 pt]"""
    font = CharacterProperties(sz=size, b=size == _TITLE)
    run = RegularTextRun(rPr=font, t=text)
    paragraph = Paragraph(pPr=ParagraphProperties(defRPr=font), r=[run])
    return Title(tx=Text(rich=RichText(p=[paragraph])), overlay=False)


def linked_title(sheet: str, cell: str, shown: StrVal) -> Title:
    """Return a title that follows a cell; ``shown`` is what the cell says now."""
    cache = StrData(ptCount=1, pt=[shown])
    font = CharacterProperties(sz=_TITLE, b=True)
    look = RichText(p=[Paragraph(pPr=ParagraphProperties(defRPr=font))])
    place = f"'{sheet}'!{absolute_coordinate(cell)}"
    return Title(tx=Text(strRef=StrRef(f=place, strCache=cache)), txPr=look, overlay=False)


def bars(title: str, numbers: Reference, names: Reference, *, series: str, colour: str) -> BarChart:
    """Return a chart of bars of one series, its axes shown."""
    chart = BarChart()
    chart.title, chart.legend = titled(title), None
    chart.series.append(Series(numbers, title=series))
    chart.series[0].graphicalProperties = GraphicalProperties(solidFill=colour)
    chart.set_categories(names)
    chart.x_axis.delete = chart.y_axis.delete = False
    return chart


def scatter(
    title: str, x_title: str, y_title: str, x: Reference, y: Mapping[str, Reference]
) -> ScatterChart:
    """Return a chart of dots: markers set one by one, or LibreOffice shows none."""
    chart = ScatterChart()
    chart.style, chart.scatterStyle = 13, "lineMarker"
    chart.title = titled(title)
    chart.x_axis.title, chart.y_axis.title = titled(x_title, _AXIS), titled(y_title, _AXIS)
    if len(y) == 1:
        chart.legend = None
    else:
        chart.legend.position = "b"
    for name, colour, marker in zip(y, COLOURS, _MARKERS, strict=False):
        series = Series(y[name], x, title=name)
        series.marker.symbol, series.marker.size = marker, 5
        series.marker.graphicalProperties = GraphicalProperties(solidFill=colour)
        series.marker.graphicalProperties.line.solidFill = colour
        series.graphicalProperties.line.noFill = True
        chart.series.append(series)
    for axis in (chart.x_axis, chart.y_axis):
        axis.delete, axis.tickLblPos, axis.crosses = False, "low", "min"
        axis.number_format = "0.00"
    return chart
