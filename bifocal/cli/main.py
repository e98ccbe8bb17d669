"""The ``bifocal`` command."""

from __future__ import annotations

import click

from photocore.cli import LazyGroup
from photocore.installation import DISTRIBUTION

#: Name and one-line help of every command, in the order of work.
SUMMARIES: dict[str, str] = {
    "demo": "The whole workflow on the sample pair that ships with the package.",
    "template": "An empty survey workbook with live formulas.",
    "plan": "Camera stations, scale and expected precision for given lenses.",
    "calibrate": "Lens calibration from board photos or straight lines.",
    "undistort": "Photos freed of lens distortion.",
    "align": "A pair file from two photos: control points, site distances or automatic.",
    "pick": "The page: orient photos, pick points, draw, in the browser.",
    "match": "Homologous points found automatically, as a survey workbook.",
    "solve": "Relief, coordinates and precision of measured points.",
    "relief": "Dense relief map of the wall.",
    "ortho": "Orthophoto to scale, and everything a drawing needs.",
    "adjust": "All pairs of one facade in one frame, by one adjustment.",
    "mosaic": "One orthophoto from several.",
    "facade": "Two photos and control points in, drawings and report out, in one line.",
    "survey": "The same for many pairs: resumable, in parallel, here or on a cluster.",
    "report": "What was measured and how good it is, as one HTML or PDF file.",
    "view": "A relief map in three dimensions, as one small HTML file.",
    "export": "Points as DXF, PLY, LAS, CSV, GeoJSON or workbook.",
    "doctor": "Versions, extras, LibreOffice, memory: what a fault report needs.",
}

EPILOG = """\b
First steps:
  bifocal pick                      the page: from two photos to the drawing, in the browser
  bifocal demo                      the whole workflow on a sample pair
  bifocal template survey.xlsx      an empty survey workbook
  bifocal COMMAND --help            options and an example for each command
"""


@click.group(
    cls=LazyGroup,
    commands_package="bifocal.cli",
    summaries=SUMMARIES,
    epilog=EPILOG,
)
@click.version_option(package_name=DISTRIBUTION, prog_name="bifocal")
def main() -> None:
    """Relief, coordinates and orthophotos of a wall from two photos of the same scale."""
