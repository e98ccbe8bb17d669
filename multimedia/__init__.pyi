from photocore.camera.distortion import Convention
from photocore.errors import (
    CellError,
    ConvergenceError,
    GeometryError,
    InputError,
    MissingExtraError,
    PhotogrammetryError,
    WorkbookError,
)

from .adjustment.bundle import bundle_adjust
from .adjustment.extensions import Extension, diagnose
from .adjustment.unknowns import Adjustment, ScaleBar, Unknowns
from .bathymetry.corrected_points import BathymetryStatus, CorrectedPoints, Precision
from .bathymetry.mean_water_level import WaterLevel, mean_water_level
from .bathymetry.refracted_rays import (
    RayIntersections,
    correct_lidar_beams,
    intersect_refracted_rays,
)
from .bathymetry.refraction_correction import correct_bathymetry
from .bathymetry.soundings import DepthClass, DepthOffsets, DepthTrend, depth_offsets
from .bathymetry.wave_statistics import WaveCase, wave_statistics
from .bathymetry.waves import WaveEffect, wave_effect
from .design.accuracy import (
    calibration_costs,
    compare_placements,
    object_grid,
    ring_of_cameras,
    study_setup,
)
from .design.dispersion import (
    colour_positions,
    correct_dispersion,
    layers_per_colour,
    seam_width,
    shift_per_colour,
)
from .design.simplified_models import Approximation, agrafiotis, lavest, telem
from .design.studies import CalibrationCosts, Placement, Study
from .exchange.workflow import Conversion, convert
from .media.camera import Brown, Camera, Fisheye, Sensor
from .media.collinearity import Medium
from .media.flat_interface import FlatInterface
from .media.height_field import HeightField, RasterSurface, WaterSurface, WaveSurface
from .media.interfaces import Interfaces
from .media.mesh_surface import MeshSurface
from .media.optical_media import OpticalMedia, Sight
from .media.projection import Media, project, projection_status
from .media.ray_paths import RayPaths, RayStatus
from .media.ray_tracing import aim_rays, trace_rays
from .media.surface_motion import Body
from .media.surface_sequence import SurfaceSequence
from .media.surfaces import Cylinder, Plane, RefractingSurface, Sphere
from .openptv.correspondences import correspondences
from .openptv.experiment import Experiment, read_experiment, write_experiment
from .openptv.openptv_files import DetectedTargets
from .openptv.plane_sets import PlaneCandidates
from .orientation.epipolar_curves import (
    Candidates,
    EpipolarCurves,
    epipolar_candidates,
    epipolar_curve,
)
from .orientation.intersection import IntersectedPoints, intersect, intersect_pairs, intersect_rays
from .orientation.many_resections import CameraPoses, resect_many
from .orientation.object_rays import image_rays
from .orientation.point_status import PointStatus
from .orientation.resection import Resection, resect
from .projects.model import ImagePoints, ObjectPoints, Project
from .projects.project_file import read_project, write_project
from .refraction.iteration import ShiftIteration, best_over_compensation, iterated_radius
from .refraction.layers import Layers
from .refraction.materials import (
    ACRYLIC,
    FLOAT_GLASS,
    FUSED_SILICA,
    N_BK7,
    POLYCARBONATE,
    SAPPHIRE,
    Material,
    air_refractive_index,
)
from .refraction.shift import ShiftDerivatives
from .refraction.shift_table import ShiftTable
from .refraction.shifting import radial_shift, radial_shift_derivatives, radial_shift_ratio
from .refraction.snell import critical_angle, refracted_angle, refracted_direction
from .refraction.water import (
    HOEHLE,
    PARRISH,
    QUAN_FRY,
    Term,
    WaterFormula,
    WaterIndexDerivatives,
    salinity_from_index,
    temperature_from_index,
    water_index_derivatives,
    water_index_sigma,
    water_refractive_index,
)
from .targets.target_images import TargetImages, find_targets
from .tracking.self_calibration import SelfCalibration, calibrated_on_particles
from .tracking.tracks import Tracks, track_particles

__version__: str

__all__ = [
    "ACRYLIC",
    "FLOAT_GLASS",
    "FUSED_SILICA",
    "HOEHLE",
    "N_BK7",
    "PARRISH",
    "POLYCARBONATE",
    "QUAN_FRY",
    "SAPPHIRE",
    "Adjustment",
    "Approximation",
    "BathymetryStatus",
    "Body",
    "Brown",
    "CalibrationCosts",
    "Camera",
    "CameraPoses",
    "Candidates",
    "CellError",
    "Convention",
    "ConvergenceError",
    "Conversion",
    "CorrectedPoints",
    "Cylinder",
    "DepthClass",
    "DepthOffsets",
    "DepthTrend",
    "DetectedTargets",
    "EpipolarCurves",
    "Experiment",
    "Extension",
    "Fisheye",
    "FlatInterface",
    "GeometryError",
    "HeightField",
    "ImagePoints",
    "InputError",
    "Interfaces",
    "IntersectedPoints",
    "Layers",
    "Material",
    "Media",
    "Medium",
    "MeshSurface",
    "MissingExtraError",
    "ObjectPoints",
    "OpticalMedia",
    "PhotogrammetryError",
    "Placement",
    "Plane",
    "PlaneCandidates",
    "PointStatus",
    "Precision",
    "Project",
    "RasterSurface",
    "RayIntersections",
    "RayPaths",
    "RayStatus",
    "RefractingSurface",
    "Resection",
    "ScaleBar",
    "SelfCalibration",
    "Sensor",
    "ShiftDerivatives",
    "ShiftIteration",
    "ShiftTable",
    "Sight",
    "Sphere",
    "Study",
    "SurfaceSequence",
    "TargetImages",
    "Term",
    "Tracks",
    "Unknowns",
    "WaterFormula",
    "WaterIndexDerivatives",
    "WaterLevel",
    "WaterSurface",
    "WaveCase",
    "WaveEffect",
    "WaveSurface",
    "WorkbookError",
    "agrafiotis",
    "aim_rays",
    "air_refractive_index",
    "best_over_compensation",
    "bundle_adjust",
    "calibrated_on_particles",
    "calibration_costs",
    "colour_positions",
    "compare_placements",
    "convert",
    "correct_bathymetry",
    "correct_dispersion",
    "correct_lidar_beams",
    "correspondences",
    "critical_angle",
    "depth_offsets",
    "diagnose",
    "epipolar_candidates",
    "epipolar_curve",
    "find_targets",
    "image_rays",
    "intersect",
    "intersect_pairs",
    "intersect_rays",
    "intersect_refracted_rays",
    "iterated_radius",
    "lavest",
    "layers_per_colour",
    "mean_water_level",
    "object_grid",
    "project",
    "projection_status",
    "radial_shift",
    "radial_shift_derivatives",
    "radial_shift_ratio",
    "read_experiment",
    "read_project",
    "refracted_angle",
    "refracted_direction",
    "resect",
    "resect_many",
    "ring_of_cameras",
    "salinity_from_index",
    "seam_width",
    "shift_per_colour",
    "study_setup",
    "telem",
    "temperature_from_index",
    "trace_rays",
    "track_particles",
    "water_index_derivatives",
    "water_index_sigma",
    "water_refractive_index",
    "wave_effect",
    "wave_statistics",
    "write_experiment",
    "write_project",
]
