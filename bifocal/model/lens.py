"""A lens: camera matrix and distortion, pixels in, pixels out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bifocal.remarks import remark
from photocore.arrays import FloatArray, as_floats, as_points, not_negative, read_only
from photocore.camera import read_foreign_lens
from photocore.errors import InputError, located
from photocore.jsonfile import read_object, write_object

FORMAT = "bifocal-lens/1"
#: Key of `Lens.extra`: relative standard deviation of a principal distance that was assumed.
SIGMA_FOCAL = "sigma_focal"
#: No photo is larger. [px]
LARGEST_SIDE = 1e6
#: Points projected at once: what fits the processor's cache.
PROJECTED_AT_ONCE = 8192
#: Numbers of coefficients each model may have; empty: any even number from 8 on.
MODELS: Mapping[str, tuple[int, ...]] = {
    "opencv": (0, 4, 5, 8, 12, 14),
    "fisheye": (4,),
    "radial": (),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lens:
    """Interior orientation with distortion, in OpenCV's conventions.

    Attributes
    ----------
    camera_matrix : ndarray, shape (3, 3)
        fx, fy, cx, cy. [px]
    coefficients : ndarray, shape (k,)
        ``opencv``: k1 k2 p1 p2 [k3 ...]; ``fisheye``: k1..k4; ``radial``: pairs of ideal radius
        [px] and seen over ideal radius, from 0 to beyond the corner, for lenses whose profile no
        polynomial of Brown's fits (the lens database's zooms).
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
        _check_matrix(self.camera_matrix)
        terms = np.ravel(as_floats(self.coefficients, "coefficients"))
        set_(self, "coefficients", read_only(terms, "coefficients"))
        if not isinstance(self.model, str) or self.model not in MODELS:
            raise InputError(f"lens model: {self.model!r} is not one of {', '.join(MODELS)}.")
        count = len(self.coefficients)
        if self.model == "radial":
            _check_profile(self.coefficients)
        elif count not in MODELS[self.model]:
            raise InputError(
                f"lens model {self.model!r} takes {MODELS[self.model]} coefficients, found {count}."
            )
        size = as_floats(self.image_size, "image_size")
        if (
            size.shape != (2,)
            or not ((size >= 1) & (size <= LARGEST_SIDE) & (size == np.rint(size))).all()
        ):
            raise InputError(
                "image_size: expected width and height in whole pixels, found "
                f"{size.tolist()!r:.60}."
            )
        set_(self, "image_size", (int(size[0]), int(size[1])))
        if self.sigma0 is not None:
            set_(self, "sigma0", not_negative(self.sigma0, "sigma0", unit="px"))

    @classmethod
    def read(cls, path: Path | str) -> Lens:
        """Read a ``lens.json``, COLMAP ``cameras.txt``, Metashape ``.xml`` or OpenCV ``.yml``.

        Raises
        ------
        InputError
            If the file is missing or one of its values is unusable; the message names it.
        """
        if Path(path).suffix.lower() in {".txt", ".xml", ".yml", ".yaml"}:
            foreign = read_foreign_lens(path)
            with located(path):
                return cls(**foreign._asdict())
        if Path(path).suffix.lower() in {".csv", ".xlsx", ".jpg", ".tif"}:
            raise InputError(remark("lens.other_file", path=path))
        data = read_object(path, what="lens file")
        if str(data.get("format", "")).startswith("bifocal-pair"):
            raise InputError(f"{path}: is a pair file, not a lens file; name the lens.json.")
        data.pop("format", None)
        keys = ("camera_matrix", "coefficients", "image_size", "model", "sigma0", "source")
        stated = {name: data.pop(name) for name in keys if name in data}
        with located(path):
            for name in keys[:3]:
                if name not in stated:
                    raise InputError(f"the key {name!r} is missing.")
            sigma0 = stated.get("sigma0")
            if isinstance(sigma0, list | bool):  # an array of one, or true, would pass for a number
                raise InputError(f"sigma0: expected one number, found {sigma0!r:.40}.")
            return cls(**stated, extra=data)

    def to_dict(self) -> dict[str, object]:
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
        if self.model == "radial":
            return self._scaled(points, inverse=True)
        if not len(flat):
            return points.copy()
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
        matrix, terms = np.array(self.camera_matrix), np.array(self.coefficients)
        if self.model != "fisheye" and hasattr(cv2, "undistortPointsIter"):  # OpenCV 4
            ideal = cv2.undistortPointsIter(flat, matrix, terms, None, matrix, criteria)
        else:
            fisheye = self.model == "fisheye"
            undistort = cv2.fisheye.undistortPoints if fisheye else cv2.undistortPoints
            ideal = undistort(flat, matrix, terms, P=matrix, criteria=criteria)
        return np.asarray(ideal, dtype=np.float64).reshape(points.shape)

    def distort(self, pixels: ArrayLike) -> FloatArray:
        """Return where ideal points are seen through this lens, shape (..., 2). [px]"""
        points = as_points(pixels, "pixels", dimension=2)
        if self.model == "radial":
            return self._scaled(points, inverse=False)
        flat = points.reshape(-1, 2)
        out = np.empty_like(flat)
        for part, directions, _ in self._projected(flat):
            out[part] = directions
        return out.reshape(points.shape)

    def distorted_by_ideal(self, pixels: ArrayLike) -> FloatArray:
        """Return the derivative of `distort` at ideal points, shape (..., 2, 2)."""
        points = as_points(pixels, "pixels", dimension=2)
        if self.model == "radial":
            half = np.diag([0.5, 0.5])
            ahead, behind = (self.distort(points[..., None, :] + s * half) for s in (1, -1))
            return np.swapaxes(ahead - behind, -1, -2)
        flat = points.reshape(-1, 2)
        out = np.empty((len(flat), 2, 2))
        for part, _, by_shift in self._projected(flat):
            out[part] = by_shift / np.diag(self.camera_matrix)[:2]
        return out.reshape(*points.shape, 2)

    def _projected(self, points: FloatArray) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Yield OpenCV's distorted points and their derivative by a shift at depth 1, in parts.

        OpenCV makes all derivatives with every point: those of a whole photo take a gigabyte, and
        twice the time of parts that stay in the processor's cache.
        """
        import cv2

        matrix, coefficients = np.array(self.camera_matrix), np.array(self.coefficients)
        zero, by_pixel = np.zeros(3), np.linalg.inv(matrix)
        for start in range(0, len(points), PROJECTED_AT_ONCE):
            part = slice(start, start + PROJECTED_AT_ONCE)
            flat = points[part]
            rays = (np.column_stack([flat, np.ones(len(flat))]) @ by_pixel.T)[:, None]
            if self.model == "fisheye":
                pixels, by = cv2.fisheye.projectPoints(rays, zero, zero, matrix, coefficients)
                by_shift = by[:, 11:13]  # f, c (2 each), k (4), rotation (3), shift
            else:
                pixels, by = cv2.projectPoints(rays, zero, zero, matrix, coefficients)
                by_shift = by[:, 3:5]  # rotation (3), shift
            yield part, pixels.reshape(-1, 2), by_shift.reshape(-1, 2, 2)

    @property
    def principal_point(self) -> FloatArray:
        """Column and row where the axis meets the photo, shape (2,). [px]."""
        return self.camera_matrix[:2, 2]

    def _scaled(self, points: FloatArray, *, inverse: bool) -> FloatArray:
        """Return points moved along the radius by the tabulated profile."""
        from scipy.interpolate import CubicSpline

        ideal, factor = self.coefficients[0::2], self.coefficients[1::2]
        profile = CubicSpline(ideal, factor)
        offset = points - self.principal_point
        radius = np.hypot(offset[..., 0], offset[..., 1])
        if not inverse:
            return self.principal_point + offset * profile(radius)[..., None]
        # Seen radius rises with the ideal one (checked when made), so Newton from the inverse
        # of the table's nodes converges in three steps to rounding.
        guess = CubicSpline(ideal * factor, ideal)(radius)
        slope = profile.derivative()
        for _ in range(4):
            gap = guess * profile(guess) - radius
            guess = guess - gap / (profile(guess) + guess * slope(guess))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(radius > 0, guess / radius, 1.0 / profile(0.0))
        return self.principal_point + offset * ratio[..., None]


def _check_matrix(matrix: FloatArray) -> None:
    """Refuse what is no camera matrix: without focal lengths, or not ending in 0 0 1."""
    if not (np.diag(matrix) > 0).all() or tuple(matrix[2]) != (0.0, 0.0, 1.0):
        raise InputError(remark("lens.camera_matrix", matrix=matrix.tolist()))


def _check_profile(coefficients: FloatArray) -> None:
    """Refuse a radial profile that does not start on the axis or folds the photo over."""
    if len(coefficients) < 8 or len(coefficients) % 2:
        raise InputError("lens model 'radial' takes at least four pairs of radius and factor.")
    ideal, factor = coefficients[0::2], coefficients[1::2]
    if ideal[0] != 0 or (np.diff(ideal) <= 0).any() or (np.diff(ideal * factor) <= 0).any():
        raise InputError(remark("lens.radii"))
