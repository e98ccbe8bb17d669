from .domain.layers import Layers
from .domain.shifting import radial_shift, radial_shift_derivatives, radial_shift_ratio
from .shift import ShiftDerivatives
from .snell import critical_angle, refracted_angle, refracted_direction
from .water import water_refractive_index

__all__ = [
    "Layers",
    "ShiftDerivatives",
    "critical_angle",
    "radial_shift",
    "radial_shift_derivatives",
    "radial_shift_ratio",
    "refracted_angle",
    "refracted_direction",
    "water_refractive_index",
]
