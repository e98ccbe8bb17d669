from .domain.adjustment import Adjustment, ScaleBar, Unknowns
from .domain.bathymetry import BathymetryStatus, CorrectedPoints, Precision
from .domain.camera import Camera, Sensor
from .domain.design import CalibrationCosts, Placement, Study
from .domain.flat_interface import FlatInterface
from .domain.height_field import RasterSurface, WaveSurface
from .domain.interfaces import Interfaces
from .domain.layers import Layers
from .domain.mesh_surface import MeshSurface
from .domain.point_status import PointStatus
from .domain.project import ImagePoints, ObjectPoints, Project
from .domain.ray_paths import RayPaths, RayStatus
from .domain.shift_table import ShiftTable
from .domain.shifting import radial_shift, radial_shift_derivatives, radial_shift_ratio
from .domain.surfaces import Cylinder, Plane, Sphere
from .io.openptv import read_experiment, write_experiment
from .io.project_file import read_project, write_project
from .iteration import ShiftIteration, best_over_compensation, iterated_radius
from .materials import (
    ACRYLIC,
    FLOAT_GLASS,
    FUSED_SILICA,
    N_BK7,
    POLYCARBONATE,
    SAPPHIRE,
    Material,
    air_refractive_index,
)
from .shift import ShiftDerivatives
from .snell import critical_angle, refracted_angle, refracted_direction
from .solvers.approximations import Approximation, agrafiotis, lavest, telem
from .solvers.bathymetry import correct_bathymetry
from .solvers.bundle import bundle_adjust
from .solvers.design import (
    calibration_costs,
    compare_placements,
    object_grid,
    ring_of_cameras,
    study_setup,
)
from .solvers.dispersion import (
    colour_positions,
    correct_dispersion,
    layers_per_colour,
    seam_width,
    shift_per_colour,
)
from .solvers.epipolar import Candidates, EpipolarCurves, epipolar_candidates, epipolar_curve
from .solvers.intersection import Intersection, intersect, intersect_pairs, intersect_rays
from .solvers.object_rays import image_rays
from .solvers.projection import project, projection_status
from .solvers.raytrace import aim_rays, trace_rays
from .solvers.refracted_rays import RayIntersections, correct_lidar_beams, intersect_refracted_rays
from .solvers.resection import Resection, resect
from .solvers.water_surface import WaterLevel, mean_water_level
from .solvers.waves import WaveEffect, wave_effect
from .water import (
    HOEHLE,
    PARRISH,
    QUAN_FRY,
    WaterFormula,
    WaterIndexDerivatives,
    salinity_from_index,
    temperature_from_index,
    water_index_derivatives,
    water_index_sigma,
    water_refractive_index,
)

__all__ = [
    "ACRYLIC",
    "Adjustment",
    "Approximation",
    "BathymetryStatus",
    "CalibrationCosts",
    "Camera",
    "Candidates",
    "CorrectedPoints",
    "Cylinder",
    "EpipolarCurves",
    "FLOAT_GLASS",
    "FUSED_SILICA",
    "FlatInterface",
    "HOEHLE",
    "ImagePoints",
    "Interfaces",
    "Intersection",
    "Layers",
    "Material",
    "MeshSurface",
    "N_BK7",
    "ObjectPoints",
    "PARRISH",
    "POLYCARBONATE",
    "Placement",
    "Plane",
    "PointStatus",
    "Precision",
    "Project",
    "QUAN_FRY",
    "RasterSurface",
    "RayIntersections",
    "RayPaths",
    "RayStatus",
    "Resection",
    "SAPPHIRE",
    "ScaleBar",
    "Sensor",
    "ShiftDerivatives",
    "ShiftIteration",
    "ShiftTable",
    "Sphere",
    "Study",
    "Unknowns",
    "WaterFormula",
    "WaterIndexDerivatives",
    "WaterLevel",
    "WaveEffect",
    "WaveSurface",
    "agrafiotis",
    "aim_rays",
    "air_refractive_index",
    "best_over_compensation",
    "bundle_adjust",
    "calibration_costs",
    "colour_positions",
    "compare_placements",
    "correct_bathymetry",
    "correct_dispersion",
    "correct_lidar_beams",
    "critical_angle",
    "epipolar_candidates",
    "epipolar_curve",
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
    "ring_of_cameras",
    "salinity_from_index",
    "seam_width",
    "shift_per_colour",
    "study_setup",
    "telem",
    "temperature_from_index",
    "trace_rays",
    "water_index_derivatives",
    "water_index_sigma",
    "water_refractive_index",
    "wave_effect",
    "write_experiment",
    "write_project",
]
