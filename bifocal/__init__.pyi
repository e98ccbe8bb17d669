from .equations import (
    plane_coordinates,
    relief,
    relief_displacement,
    relief_displacements,
    relief_from_displacement,
)
from .model.intersection import Intersection
from .model.lens import Lens
from .model.pair import Pair, Photo
from .model.relief_map import Quality, ReliefMap
from .orthophotos.compose import orthophoto
from .orthophotos.ortho_image import OrthoOptions, Orthophoto
from .relief_maps.dense_matching import DenseRelief, dense_relief

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
