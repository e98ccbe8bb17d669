"""What ray tracing returns: broken rays and a reason for every ray that has none."""

from __future__ import annotations

from dataclasses import dataclass

from photocore.arrays import FloatArray, IntArray
from photocore.labelled import LabelledCode


class RayStatus(LabelledCode):
    """Why a ray has no path; written to tables by its label."""

    OK = 0, "ok"
    MISSED = 1, "misses an interface"
    TOTAL_REFLECTION = 2, "total reflection"
    WRONG_SIDE = 3, "point and camera not on the sides the interfaces demand"
    NOT_CONVERGED = 4, "not converged"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RayPaths:
    """Rays through k interfaces, from the camera's medium to the object's.

    Attributes
    ----------
    vertices : ndarray, shape (..., k, 3)
        Where each ray meets each interface; NaN where it has no path.
    directions : ndarray, shape (..., k + 1, 3)
        Unit direction within each medium; NaN where it has no path. ``directions[..., 0, :]``
        leaves the camera.
    status : ndarray of int, shape (...)
        `RayStatus` of each ray.
    jacobian : ndarray, shape (..., 3, 3), or None
        Derivative of ``directions[..., 0, :]`` with respect to the object point, where asked for.
    """

    vertices: FloatArray
    directions: FloatArray
    status: IntArray
    jacobian: FloatArray | None = None
