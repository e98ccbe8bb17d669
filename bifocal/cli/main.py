"""The ``bifocal`` command."""

from __future__ import annotations

import click

from photocore.cli import LazyGroup
from photocore.installation import DISTRIBUTION

#: One line about each command, in the order of work.
SUMMARIES = {
    "demo": "The whole workflow on the sample pair that ships with the package.",
    "template": "An empty survey workbook with live formulas.",
    "plan": "Camera stations, scale and expected precision for given lenses.",
    "calibrate": "Lens calibration from board photos or straight lines.",
    "undistort": "Photos freed of lens distortion.",
    "align": "A pair or set file from photos: control points, site distances or automatic.",
    "photos": "Another program's finished project as a set of photos of a wall.",
    "pick": "The page: orient photos, pick points, draw, in the browser.",
    "match": "Homologous points found automatically, as a survey workbook.",
    "solve": "Relief, coordinates and precision of measured points.",
    "relief": "Dense relief map of the wall.",
    "ortho": "Orthophoto to scale, and everything a drawing needs.",
    "rectify": "One photo alone to scale on the plane of its wall.",
    "adjust": "All pairs of one facade in one frame, by one adjustment.",
    "mosaic": "One orthophoto from several.",
    "facade": "Two photos and control points in, drawings and report out, in one line.",
    "survey": "The same for many pairs: resumable, in parallel, here or on a cluster.",
    "report": "What was measured and how good it is, as one HTML or PDF file.",
    "view": "A relief map in three dimensions, as one small HTML file.",
    "handover": "One HTML file to hand over: photos, orthophoto, relief, points, and a measure.",
    "compare": "What has changed on a wall between two dates, with significance.",
    "verify": "A delivery held against its records: hashes, worked point, products made anew.",
    "export": "Points as DXF, PLY, LAS, CSV, GeoJSON or workbook.",
    "doctor": "Versions, extras, memory: what a fault report needs; a workbook calculated anew.",
}
FIRST_STEPS = """\b
First steps:
  bifocal pick                      the page: from two photos to the drawing, in the browser
  bifocal demo                      the whole workflow on a sample pair
  bifocal template survey.xlsx      an empty survey workbook
  bifocal COMMAND --help            options and an example for each command
"""


@click.group(cls=LazyGroup, commands_package="bifocal.cli", summaries=SUMMARIES, epilog=FIRST_STEPS)
@click.version_option(package_name=DISTRIBUTION, prog_name="bifocal")
def main() -> None:
    """Relief, coordinates and orthophotos of a wall from two photos of the same scale."""
