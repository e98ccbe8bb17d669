from .domain.intersection import Intersection
from .domain.lens import Lens
from .domain.pair import Pair, Photo
from .equations import (
    plane_coordinates,
    relief,
    relief_displacement,
    relief_displacements,
    relief_from_displacement,
)

__all__ = [
    "Intersection",
    "Lens",
    "Pair",
    "Photo",
    "plane_coordinates",
    "relief",
    "relief_displacement",
    "relief_displacements",
    "relief_from_displacement",
]
