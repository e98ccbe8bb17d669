"""What ray tracing returns: broken rays and a reason for every ray that has none."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from photocore.arrays import FloatArray, IntArray


class RayStatus(IntEnum):
    """Why a ray has no path; written to tables by its label."""

    OK = 0
    MISSED = 1
    TOTAL_REFLECTION = 2
    WRONG_SIDE = 3
    NOT_CONVERGED = 4

    @property
    def label(self) -> str:
        """The reason in words."""
        return _LABELS[self]


_LABELS = {
    RayStatus.OK: "ok",
    RayStatus.MISSED: "misses an interface",
    RayStatus.TOTAL_REFLECTION: "total reflection",
    RayStatus.WRONG_SIDE: "point and camera not on the sides the interfaces demand",
    RayStatus.NOT_CONVERGED: "not converged",
}


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
