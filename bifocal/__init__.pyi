from .domain.intersection import Intersection
from .domain.lens import Lens
from .domain.ortho_image import OrthoOptions, Orthophoto
from .domain.pair import Pair, Photo
from .domain.relief_map import Quality, ReliefMap
from .equations import (
    plane_coordinates,
    relief,
    relief_displacement,
    relief_displacements,
    relief_from_displacement,
)
from .solvers.compose import orthophoto
from .solvers.dense.solve import DenseRelief, dense_relief

__all__ = [
    "DenseRelief",
    "Intersection",
    "Lens",
    "OrthoOptions",
    "Orthophoto",
    "Pair",
    "Photo",
    "Quality",
    "ReliefMap",
    "dense_relief",
    "orthophoto",
    "plane_coordinates",
    "relief",
    "relief_displacement",
    "relief_displacements",
    "relief_from_displacement",
]
