from .domain.camera import Camera, Sensor
from .domain.flat_interface import FlatInterface
from .domain.layers import Layers
from .domain.shifting import radial_shift, radial_shift_derivatives, radial_shift_ratio
from .shift import ShiftDerivatives
from .snell import critical_angle, refracted_angle, refracted_direction
from .solvers.projection import project, projection_status
from .water import water_refractive_index

__all__ = [
    "Camera",
    "FlatInterface",
    "Layers",
    "Sensor",
    "ShiftDerivatives",
    "critical_angle",
    "project",
    "projection_status",
    "radial_shift",
    "radial_shift_derivatives",
    "radial_shift_ratio",
    "refracted_angle",
    "refracted_direction",
    "water_refractive_index",
]
