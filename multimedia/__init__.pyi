from .domain.bathymetry import BathymetryStatus, CorrectedPoints, Precision
from .domain.camera import (
    Camera,
    Sensor,
)
from .domain.flat_interface import (
    FlatInterface,
)
from .domain.height_field import (
    RasterSurface,
    WaveSurface,
)
from .domain.interfaces import (
    Interfaces,
)
from .domain.layers import (
    Layers,
)
from .domain.mesh_surface import (
    MeshSurface,
)
from .domain.ray_paths import (
    RayPaths,
    RayStatus,
)
from .domain.shift_table import (
    ShiftTable,
)
from .domain.shifting import (
    radial_shift,
    radial_shift_derivatives,
    radial_shift_ratio,
)
from .domain.surfaces import (
    Cylinder,
    Plane,
    Sphere,
)
from .iteration import (
    ShiftIteration,
    best_over_compensation,
    iterated_radius,
)
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
from .shift import (
    ShiftDerivatives,
)
from .snell import (
    critical_angle,
    refracted_angle,
    refracted_direction,
)
from .solvers.bathymetry import correct_bathymetry
from .solvers.projection import (
    project,
    projection_status,
)
from .solvers.raytrace import (
    aim_rays,
    trace_rays,
)
from .solvers.refracted_rays import RayIntersections, correct_lidar_beams, intersect_refracted_rays
from .solvers.resection import (
    Resection,
    resect,
)
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
    "WaveEffect",
    "wave_effect",
    "WaterLevel",
    "mean_water_level",
    "RayIntersections",
    "correct_lidar_beams",
    "intersect_refracted_rays",
    "correct_bathymetry",
    "BathymetryStatus",
    "CorrectedPoints",
    "Precision",
    "RasterSurface",
    "WaveSurface",
    "Interfaces",
    "MeshSurface",
    "RayPaths",
    "RayStatus",
    "Cylinder",
    "Plane",
    "Sphere",
    "aim_rays",
    "trace_rays",
    "ACRYLIC",
    "Camera",
    "FLOAT_GLASS",
    "FUSED_SILICA",
    "FlatInterface",
    "HOEHLE",
    "Layers",
    "Material",
    "N_BK7",
    "PARRISH",
    "POLYCARBONATE",
    "QUAN_FRY",
    "Resection",
    "SAPPHIRE",
    "Sensor",
    "ShiftDerivatives",
    "ShiftIteration",
    "ShiftTable",
    "WaterFormula",
    "WaterIndexDerivatives",
    "air_refractive_index",
    "best_over_compensation",
    "critical_angle",
    "iterated_radius",
    "project",
    "projection_status",
    "radial_shift",
    "radial_shift_derivatives",
    "radial_shift_ratio",
    "refracted_angle",
    "refracted_direction",
    "resect",
    "salinity_from_index",
    "temperature_from_index",
    "water_index_derivatives",
    "water_index_sigma",
    "water_refractive_index",
]
