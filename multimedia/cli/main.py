"""The ``multimedia`` command."""

from __future__ import annotations

import click

from photocore.cli import LazyGroup
from photocore.installation import DISTRIBUTION

#: One line about each command, in the order of work.
SUMMARIES = {
    "index": "Refractive index of water, and its inverse.",
    "shift": "Radial shift of a table of points.",
    "template": "Workbook with radial shift and refractive index as live formulas.",
    "project": "Image coordinates of object points through the media.",
    "intersect": "Object points from image points of two or more cameras.",
    "resect": "Orientation and calibration of each camera from control points.",
    "boards": "Points of a chessboard, ChArUco or dot board in photos, for adjust.",
    "adjust": "Bundle adjustment: cameras, points, media.",
    "epipolar": "Epipolar curves and the candidates along them.",
    "bathymetry": "Refraction correction of a DEM or point cloud.",
    "waterlevel": "Mean water height from tie points on the surface.",
    "soundings": "A corrected bottom held against soundings, by depth.",
    "targets": "Images of particles in photos: where, how precisely, how large.",
    "openptv": "Project file from an OpenPTV experiment folder.",
    "particles": "Particles of a frame from the targets of all cameras.",
    "track": "Tracks and velocities of particles through many frames.",
    "convert": "Cameras of COLMAP, Metashape, OpenCV, AquaCal, in and out.",
    "design": "Accuracy studies before anyone gets wet.",
}
FIRST_STEPS = """\b
First steps:
  multimedia index --wavelength 520 --temperature 20 --salinity 0 --depth 1
  multimedia template tank.xlsx     radial shift and refractive index as live formulas
  multimedia COMMAND --help         options and an example for each command
"""


@click.group(
    cls=LazyGroup, commands_package="multimedia.cli", summaries=SUMMARIES, epilog=FIRST_STEPS
)
@click.version_option(package_name=DISTRIBUTION, prog_name="multimedia")
def main() -> None:
    """Photogrammetry through air, glass and water."""
