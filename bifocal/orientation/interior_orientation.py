"""What goes into setting up a pair, and what comes out: all plain, checked data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bifocal.model.lens import Lens
from bifocal.model.pair import Pair
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interior:
    """What is known of a photo's interior orientation before it is set up.

    Attributes
    ----------
    focal : float
        Principal distance in columns. [px]
    sigma_focal : float
        Its relative standard deviation: 0.0005 for a calibration, 0.5 for "a normal lens".
    centre : ndarray, shape (2,)
        Principal point (column, row). [px]
    sigma_centre : float
        Standard deviation of either coordinate. [px]
    aspect, sigma_aspect : float
        fy / fx and its standard deviation.
    image_size : tuple of int
        Width and height. [px]
    source : str
        Where it comes from, for the report.
    lens : Lens or None
        Distortion of the photo's pixels.
    sigma_radial : float
        Standard deviation of an unknown radial distortion k (relative shift at one principal
        distance off the axis); zero keeps k = 0.
    pixel_size : float or None
        [mm]
    is_calibrated : bool
        Whether it comes from a lens file.
    """

    focal: float
    sigma_focal: float
    centre: FloatArray
    sigma_centre: float
    image_size: tuple[int, int]
    source: str
    aspect: float = 1.0
    sigma_aspect: float = 0.001
    lens: Lens | None = None
    sigma_radial: float = 0.0
    pixel_size: float | None = None
    is_calibrated: bool = False

    @classmethod
    def from_lens(cls, lens: Lens, *, source: str) -> Interior:
        """Return the interior orientation of a calibrated lens (already of the photo's format)."""
        matrix = lens.camera_matrix
        distorted = bool(np.any(lens.coefficients)) or lens.model == "fisheye"
        return cls(
            focal=float(matrix[0, 0]),
            sigma_focal=0.0005,
            centre=np.array(matrix[:2, 2]),
            sigma_centre=0.0004 * float(matrix[0, 0]),
            image_size=lens.image_size,
            source=source,
            aspect=float(matrix[1, 1] / matrix[0, 0]),
            sigma_aspect=0.0001,
            lens=lens if distorted else None,
            is_calibrated=True,
        )

    @classmethod
    def from_focal(
        cls,
        focal: float,
        *,
        image_size: tuple[int, int],
        sigma: float,
        source: str,
        pixel_size: float | None = None,
    ) -> Interior:
        """Return what a focal length alone tells: the principal point near the photo's middle.

        Parameters
        ----------
        focal : float
            [px]
        image_size : tuple of int
            [px]
        sigma : float
            Relative standard deviation of the focal length.
        source : str
        pixel_size : float, optional
            [mm]
        """
        width, height = image_size
        return cls(
            focal=focal,
            sigma_focal=sigma,
            centre=np.array([(width - 1) / 2, (height - 1) / 2]),
            # Principal points of ordinary lenses scatter by half a per cent of the diagonal.
            sigma_centre=0.006 * float(np.hypot(width, height)),
            image_size=image_size,
            source=source,
            pixel_size=pixel_size,
        )

    @classmethod
    def unknown(cls, image_size: tuple[int, int]) -> Interior:
        """Return a normal lens: 1.2 times the longer side, within a factor of 1.65."""
        return cls.from_focal(
            1.2 * max(image_size),
            image_size=image_size,
            sigma=0.5,
            source="unknown, a normal lens assumed",
        )

    @property
    def is_assumed(self) -> bool:
        """Whether nothing but experience stands behind the principal distance."""
        return self.sigma_focal > 0.15

    def ideal(self, pixels: FloatArray) -> FloatArray:
        """Return pixels freed of the lens's distortion. [px]"""
        return pixels.copy() if self.lens is None else np.asarray(self.lens.undistort(pixels))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Control:
    """Control points: what was measured on site, and where it is seen.

    Attributes
    ----------
    ids : tuple of str
    xyz : ndarray, shape (n, 3)
        X, Y, r in the plane frame; NaN where not measured. [m]
    sigma : ndarray, shape (n, 3)
        Standard deviations of xyz. [m]
    pixels1, pixels2 : ndarray, shape (n, 2)
        Picks in the far and the near photo; NaN where not picked. [px]
    lengths : tuple of (int, int, float)
        Taped distances between two of the points: indices and metres.
    """

    ids: tuple[str, ...] = ()
    xyz: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    sigma: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    pixels1: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    pixels2: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    lengths: tuple[tuple[int, int, float], ...] = ()

    def __post_init__(self) -> None:
        count = len(self.ids)
        shapes = [self.xyz.shape, self.sigma.shape, self.pixels1.shape, self.pixels2.shape]
        if shapes != [(count, 3), (count, 3), (count, 2), (count, 2)]:
            raise InputError(f"control: {count} ids but arrays of shape {shapes}.")

    def exchanged(self) -> Control:
        """Return the same points with far and near photo exchanged."""
        return Control(
            ids=self.ids,
            xyz=self.xyz,
            sigma=self.sigma,
            pixels1=self.pixels2,
            pixels2=self.pixels1,
            lengths=self.lengths,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteMeasures:
    """Distances measured on site, None where not measured [m], and a spot of the wall.

    ``wall`` is a pixel (column, row) of the far photo that shows the wall. [px]
    """

    distance1: float | None = None
    distance2: float | None = None
    delta_d: float | None = None
    sigma: float = 0.02
    parallel: bool = False
    sigma_control: float = 0.003
    sigma_pick: float = 0.5
    wall: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alignment:
    """A pair set up, with what stands behind it.

    Attributes
    ----------
    pair : Pair
    way : str
        ``control``, ``site`` or ``auto``.
    deviations : mapping of str to float
        Standard deviations: ``distance1`` ... [m], ``focal1`` ... [px], ``scale`` (relative).
    control_ids : tuple of str
    control_residuals : ndarray, shape (n, 4)
        Observed minus computed column 1, row 1, column 2, row 2; NaN where not picked. [px]
    control_used : ndarray of bool, shape (n,)
    control_test : ndarray, shape (n,)
        Each point's misfit over its standard deviation.
    tie1, tie2 : ndarray, shape (m, 2)
        Homologous points found automatically, raw pixels. [px]
    tie_relief : ndarray, shape (m,)
        Their relief. [m]
    wall : ndarray of bool, shape (m,)
        Which of them lie on the wall.
    setup : mapping
        Diagnostics for the pair file.
    words : tuple of str
        The set-up in sentences.
    remarks : tuple of str
        What the user should be warned of.
    """

    pair: Pair
    way: str
    deviations: Mapping[str, float]
    control_ids: tuple[str, ...]
    control_residuals: FloatArray
    control_used: BoolArray
    control_test: FloatArray
    tie1: FloatArray
    tie2: FloatArray
    tie_relief: FloatArray
    wall: BoolArray
    setup: Mapping[str, Any]
    words: tuple[str, ...]
    remarks: tuple[str, ...] = ()
