"""Dense relief from a bifocal pair of photos."""

from bifocal.relief_maps.dense_matching import DenseRelief
from bifocal.relief_maps.set_relief import dense_relief

__all__ = ["DenseRelief", "dense_relief"]
