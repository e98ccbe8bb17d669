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
from .solvers.projection import (
    project,
    projection_status,
)
from .solvers.raytrace import (
    aim_rays,
    trace_rays,
)
from .solvers.resection import (
    Resection,
    resect,
)
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
    "Camera",
    "Cylinder",
    "FLOAT_GLASS",
    "FUSED_SILICA",
    "FlatInterface",
    "HOEHLE",
    "Interfaces",
    "Layers",
    "Material",
    "MeshSurface",
    "N_BK7",
    "PARRISH",
    "POLYCARBONATE",
    "Plane",
    "QUAN_FRY",
    "RasterSurface",
    "RayPaths",
    "RayStatus",
    "Resection",
    "SAPPHIRE",
    "Sensor",
    "ShiftDerivatives",
    "ShiftIteration",
    "ShiftTable",
    "Sphere",
    "WaterFormula",
    "WaterIndexDerivatives",
    "WaveSurface",
    "aim_rays",
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
    "trace_rays",
    "water_index_derivatives",
    "water_index_sigma",
    "water_refractive_index",
]
