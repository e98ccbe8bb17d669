from multimedia import Layers
from photocore.camera.distortion import RadialDivision
from photocore.camera.pinhole import Pinhole, ProjectedPoints
from photocore.camera.similarity import Similarity
from photocore.cli import Progress
from photocore.errors import (
    CellError,
    ConvergenceError,
    GeometryError,
    InputError,
    MissingExtraError,
    PhotogrammetryError,
    WorkbookError,
)
from photocore.images import read_image, write_image
from photocore.large_photos import LargePhoto, open_photo

from .calibration.board_calibration import Calibration
from .calibration.board_photos import calibrate
from .campaigns.rectification import Rectification, rectify
from .collimation.session import Session
from .collimation.workflow import PageServer, page_server, pick
from .comparison.change import ChangedRegion, Comparison, compare
from .demo import SAMPLE, WATER_SAMPLE
from .equations import (
    plane_coordinates,
    relief,
    relief_displacement,
    relief_displacements,
    relief_from_displacement,
)
from .faces.faces import BreakLine, Face, Faces, Occluder
from .faces.suggestions import suggest_faces
from .files.provenance import changed_photos, recording
from .matching.homologous_points import match
from .matching.matches import Matches
from .matching.matching import MatchSettings
from .media import MediaPath
from .model.flags import FlagLimits
from .model.grid import Bounds, Grid, Window
from .model.interior_orientation import Interior
from .model.intersection import Intersection, PlanePicks
from .model.length_checks import LengthCheck, length_check
from .model.lens import Lens
from .model.pair import Pair
from .model.pair_media import PairMedia
from .model.photo import Photo
from .model.photo_set import PhotoSet, RankedPair
from .model.points import Points
from .model.relief_map import Quality, ReliefMap
from .model.set_intersection import SetIntersection
from .model.surface import FlatSurface, MapSurface, Surface
from .model.world_frame import WorldFrame
from .networks.set_alignment import SetAlignment, align_set
from .orientation.alignment import Alignment
from .orientation.control_points import Control, SiteMeasures, read_control
from .orientation.photo_alignment import align
from .orthophotos.compose import orthophoto
from .orthophotos.mosaic_in_memory import Mosaic, MosaicOptions, mosaic
from .orthophotos.ortho_image import OrthoOptions, Orthophoto, Source
from .projects.colmap_workflow import write_colmap
from .projects.photos_workflow import ProjectOptions, ProjectPhotos, photos_from_project
from .rays import Foot
from .relief_maps.dense_matching import DenseRelief
from .relief_maps.registration import Registration
from .relief_maps.set_relief import dense_relief
from .reports.relief_view import relief_view
from .survey.georeferencing import georeference
from .survey.observations import PointObservations
from .survey.orientation_check import OrientationCheck
from .survey.reference import CheckResult, Georeference, KnownPoints, NamedPoints
from .survey.relief_table import ReliefTable
from .survey.setup import Measuring, SurveySetup, Taking
from .survey.solved_survey import SolvedSurvey, WorldPoints
from .survey.survey_input import SurveyInput
from .survey.survey_media import SurveyMedia
from .survey.taped import TapedCheck as TapedCheck
from .survey.taped import TapedDistance as TapedDistance
from .survey.tolerances import ToleranceRule
from .survey.transformation_precision import TransformationPrecision
from .workbook.reading.reader import ReadOptions
from .workbook.workflow import solve

__version__: str

__all__ = [
    "suggest_faces",
    "Occluder",
    "Faces",
    "Face",
    "BreakLine",
    "Alignment",
    "Bounds",
    "Calibration",
    "CellError",
    "ChangedRegion",
    "CheckResult",
    "Comparison",
    "Control",
    "ConvergenceError",
    "DenseRelief",
    "FlagLimits",
    "FlatSurface",
    "Foot",
    "GeometryError",
    "Georeference",
    "Grid",
    "InputError",
    "Interior",
    "Intersection",
    "KnownPoints",
    "LargePhoto",
    "Layers",
    "LengthCheck",
    "Lens",
    "MapSurface",
    "MatchSettings",
    "Matches",
    "Measuring",
    "MediaPath",
    "MissingExtraError",
    "Mosaic",
    "MosaicOptions",
    "NamedPoints",
    "OrientationCheck",
    "OrthoOptions",
    "Orthophoto",
    "PageServer",
    "Pair",
    "PairMedia",
    "Photo",
    "PhotoSet",
    "PhotogrammetryError",
    "Pinhole",
    "PlanePicks",
    "PointObservations",
    "Points",
    "Progress",
    "ProjectOptions",
    "ProjectPhotos",
    "ProjectedPoints",
    "Quality",
    "RadialDivision",
    "ReadOptions",
    "RankedPair",
    "Registration",
    "Rectification",
    "ReliefMap",
    "ReliefTable",
    "SAMPLE",
    "Session",
    "SetAlignment",
    "SetIntersection",
    "Similarity",
    "SiteMeasures",
    "SolvedSurvey",
    "Source",
    "Surface",
    "SurveyInput",
    "SurveyMedia",
    "SurveySetup",
    "Taking",
    "ToleranceRule",
    "TransformationPrecision",
    "WATER_SAMPLE",
    "Window",
    "WorkbookError",
    "WorldFrame",
    "WorldPoints",
    "align",
    "align_set",
    "calibrate",
    "changed_photos",
    "compare",
    "dense_relief",
    "georeference",
    "length_check",
    "match",
    "mosaic",
    "open_photo",
    "orthophoto",
    "page_server",
    "photos_from_project",
    "pick",
    "plane_coordinates",
    "read_control",
    "read_image",
    "recording",
    "rectify",
    "relief",
    "relief_displacement",
    "relief_displacements",
    "relief_from_displacement",
    "relief_view",
    "solve",
    "write_colmap",
    "write_image",
]
