"""Dense relief from a bifocal pair of photos."""

from bifocal.solvers.dense.solve import DenseRelief, dense_relief

__all__ = ["DenseRelief", "dense_relief"]
