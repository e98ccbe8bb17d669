from .calibration.board_calibration import Calibration
from .calibration.board_photos import calibrate
from .collimation.workflow import PageServer, page_server, pick
from .equations import (
    plane_coordinates,
    relief,
    relief_displacement,
    relief_displacements,
    relief_from_displacement,
)
from .files.provenance import recording
from .matching.homologous_points import match
from .matching.matching import Matches, MatchSettings
from .model.interior_orientation import Interior
from .model.intersection import Intersection
from .model.lens import Lens
from .model.pair import Pair
from .model.pair_media import PairMedia
from .model.photo import Photo
from .model.relief_map import Quality, ReliefMap
from .orientation.alignment import Alignment
from .orientation.control_points import Control, SiteMeasures
from .orientation.photo_alignment import align
from .orthophotos.compose import orthophoto
from .orthophotos.mosaic_in_memory import Mosaic, MosaicOptions, mosaic
from .orthophotos.ortho_image import OrthoOptions, Orthophoto
from .relief_maps.dense_matching import DenseRelief, dense_relief
from .reports.relief_view import relief_view
from .survey.georeferencing import georeference
from .survey.reference import Georeference
from .survey.setup import Measuring, Taking
from .survey.solved_survey import SolvedSurvey
from .workbook.reading.reader import ReadOptions
from .workbook.workflow import solve

__version__: str

__all__ = [
    "Alignment",
    "Calibration",
    "Control",
    "DenseRelief",
    "Georeference",
    "Interior",
    "Intersection",
    "Lens",
    "MatchSettings",
    "Matches",
    "Measuring",
    "Mosaic",
    "MosaicOptions",
    "OrthoOptions",
    "Orthophoto",
    "PageServer",
    "Pair",
    "PairMedia",
    "Photo",
    "Quality",
    "ReadOptions",
    "ReliefMap",
    "SiteMeasures",
    "SolvedSurvey",
    "Taking",
    "align",
    "calibrate",
    "dense_relief",
    "georeference",
    "match",
    "mosaic",
    "orthophoto",
    "page_server",
    "pick",
    "plane_coordinates",
    "recording",
    "relief",
    "relief_displacement",
    "relief_displacements",
    "relief_from_displacement",
    "relief_view",
    "solve",
]
