"""A lens: camera matrix and distortion, pixels in, pixels out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_points, read_only
from photocore.errors import InputError
from photocore.jsonfile import read_object, write_object

FORMAT = "bifocal-lens/1"
#: Number of coefficients OpenCV knows for each model.
MODELS: Mapping[str, tuple[int, ...]] = {"opencv": (0, 4, 5, 8, 12, 14), "fisheye": (4,)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lens:
    """Interior orientation with distortion, in OpenCV's conventions.

    Attributes
    ----------
    camera_matrix : ndarray, shape (3, 3)
        fx, fy, cx, cy. [px]
    coefficients : ndarray, shape (k,)
        ``opencv``: k1 k2 p1 p2 [k3 ...]; ``fisheye``: k1..k4.
    model : str
        A key of `MODELS`.
    image_size : tuple of int
        Width and height of the photos it belongs to. [px]
    sigma0 : float or None
        RMS of the calibration residuals. [px]
    source : str
        Where it comes from.
    extra : mapping
        Keys of the file this class does not know; kept.
    """

    camera_matrix: FloatArray
    coefficients: FloatArray
    model: str = "opencv"
    image_size: tuple[int, int]
    sigma0: float | None = None
    source: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "camera_matrix", read_only(self.camera_matrix, "camera_matrix", shape=(3, 3)))
        set_(self, "coefficients", read_only(np.ravel(self.coefficients), "coefficients"))
        if self.model not in MODELS:
            raise InputError(f"lens model: {self.model!r} is not one of {', '.join(MODELS)}.")
        if len(self.coefficients) not in MODELS[self.model]:
            raise InputError(
                f"lens model {self.model!r} takes {MODELS[self.model]} coefficients, "
                f"found {len(self.coefficients)}."
            )

    @classmethod
    def read(cls, path: Path | str) -> Lens:
        """Read a ``lens.json``."""
        data = read_object(path, what="lens file")
        try:
            known = {
                "camera_matrix": data.pop("camera_matrix"),
                "coefficients": data.pop("coefficients"),
                "image_size": tuple(int(v) for v in data.pop("image_size")),
            }
            data.pop("format", None)
            return cls(
                **known,
                model=data.pop("model", "opencv"),
                sigma0=data.pop("sigma0", None),
                source=data.pop("source", ""),
                extra=data,
            )
        except KeyError as error:
            raise InputError(f"{path}: the key {error} is missing.") from None
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return what `read` understands."""
        return {
            "format": FORMAT,
            "camera_matrix": self.camera_matrix,
            "model": self.model,
            "coefficients": self.coefficients,
            "image_size": list(self.image_size),
            "sigma0": self.sigma0,
            "source": self.source,
            **self.extra,
        }

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write a ``lens.json``."""
        write_object(path, self.to_dict(), overwrite=overwrite)

    def undistort(self, pixels: ArrayLike) -> FloatArray:
        """Return where the points would be without distortion, shape (..., 2). [px]"""
        import cv2

        points = as_points(pixels, "pixels", dimension=2)
        flat = np.ascontiguousarray(points.reshape(-1, 1, 2))
        if not len(flat):
            return points.copy()
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
        matrix = np.array(self.camera_matrix)
        coefficients = np.array(self.coefficients)
        if self.model == "fisheye":
            ideal = cv2.fisheye.undistortPoints(
                flat, matrix, coefficients, P=matrix, criteria=criteria
            )
        else:
            ideal = cv2.undistortPoints(flat, matrix, coefficients, P=matrix, criteria=criteria)
        return np.asarray(ideal, dtype=np.float64).reshape(points.shape)

    def distort(self, pixels: ArrayLike) -> FloatArray:
        """Return where ideal points are seen through this lens, shape (..., 2). [px]"""
        import cv2

        points = as_points(pixels, "pixels", dimension=2)
        flat = points.reshape(-1, 2)
        if not len(flat):
            return points.copy()
        matrix = np.array(self.camera_matrix)
        rays = np.column_stack([flat, np.ones(len(flat))]) @ np.linalg.inv(matrix).T
        zero = np.zeros(3)
        coefficients = np.array(self.coefficients)
        if self.model == "fisheye":
            seen = cv2.fisheye.distortPoints(
                np.ascontiguousarray(rays[:, None, :2]), matrix, coefficients
            )
        else:
            seen, _ = cv2.projectPoints(rays[:, None, :], zero, zero, matrix, coefficients)
        return np.asarray(seen, dtype=np.float64).reshape(points.shape)
