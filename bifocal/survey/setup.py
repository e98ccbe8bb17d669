"""What the `Setup` sheet holds: two cameras in front of a wall, and how points were measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from photocore.arrays import positive
from photocore.errors import GeometryError, InputError

#: Scales of the two photos may differ by this share; what remains is taken out by `k_12`.
SCALE_TOLERANCE = 0.02
#: Precision of a careful pick [px], and of a radial distance where the pixel size is unknown [mm].
SIGMA_PIXEL, SIGMA_RADIAL = 0.5, 0.004
#: The flags' limits, as in `bifocal.model.pair`: blunder [sigma], on-plane [sigma], share of d2.
OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS, UNCERTAIN_SHARE = 3.5, 2.0, 0.02
UNITS = ("mm", "px")


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveySetup:
    """An ideal bifocal pair as the workbook's `Setup` sheet describes it.

    Attributes
    ----------
    d1, d2 : float
        Distances of the projection centres to the reference plane. [m]
    c1, c2 : float or None
        Principal distances; both or none. Without them there is relief but no X and Y. [mm]
    pitch : float or None
        Size of a pixel; needed when coordinates are in pixels. [mm/px]
    sigma_s : float or None
        Precision of a measured image coordinate; default 0.5 px, or 0.004 mm. [mm]
    nadir1, nadir2 : tuple of float
        (column, row) of the nadir points; used when coordinates are in pixels. [px]
    unit : str
        ``"mm"``: x, y from the nadir, y up. ``"px"``: (column, row) of the image.
    sigma_r_max : float or None
        Points of less precise relief are UNCERTAIN; default 2 % of the shorter distance. [m]
    off_radial_sigmas, on_plane_sigmas : float
        Beyond how many sigma a point is OFF-RADIAL, below how many ON-PLANE.
    """

    d1: float
    d2: float
    c1: float | None = None
    c2: float | None = None
    pitch: float | None = None
    sigma_s: float | None = None
    nadir1: tuple[float, float] = (0.0, 0.0)
    nadir2: tuple[float, float] = (0.0, 0.0)
    unit: str = "mm"
    sigma_r_max: float | None = None
    off_radial_sigmas: float = OFF_RADIAL_SIGMAS
    on_plane_sigmas: float = ON_PLANE_SIGMAS

    def __post_init__(self) -> None:
        for name in ("d1", "d2"):
            object.__setattr__(self, name, positive(getattr(self, name), name, unit="m"))
        for name in ("c1", "c2", "pitch", "sigma_s", "sigma_r_max"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, positive(value, name))
        if self.d1 == self.d2:
            raise GeometryError(
                f"d_1 and d_2 are both {self.d1:g} m: relief cannot be told from two photos taken "
                "at the same distance. Check d_1, d_2 and delta_d."
            )
        if (self.c1 is None) != (self.c2 is None):
            raise InputError("c_1 and c_2: give both principal distances or none.")
        if self.unit not in UNITS:
            raise InputError(f"input unit: {self.unit!r} is neither mm nor px.")
        if self.unit == "px" and self.pitch is None:
            raise InputError("pitch: the size of a pixel [mm/px] is needed to read pixels.")

    @property
    def is_exchanged(self) -> bool:
        """Whether image 1 is the near camera, against the convention."""
        return self.d1 < self.d2

    @property
    def scale_number(self) -> float | None:
        """Scale number m_1 = 1000 d1 / c1 of image 1."""
        return None if self.c1 is None else 1000.0 * self.d1 / self.c1

    @property
    def scale_ratio(self) -> float:
        """k_12 = m_2 / m_1, which brings image 2 to the scale of image 1."""
        if self.c1 is None or self.c2 is None:
            return 1.0
        return (1000.0 * self.d2 / self.c2) / (1000.0 * self.d1 / self.c1)

    @property
    def precision(self) -> float:
        """Precision of an image coordinate. [mm]"""
        if self.sigma_s is not None:
            return self.sigma_s
        return SIGMA_PIXEL * self.pitch if self.pitch is not None else SIGMA_RADIAL

    @property
    def relief_limit(self) -> float:
        """Standard deviation of r beyond which a point is UNCERTAIN. [m]"""
        return self.sigma_r_max or UNCERTAIN_SHARE * min(self.d1, self.d2)

    def exchanged(self) -> SurveySetup:
        """Return the same set-up with the images exchanged."""
        return replace(
            self,
            d1=self.d2,
            d2=self.d1,
            c1=self.c2,
            c2=self.c1,
            nadir1=self.nadir2,
            nadir2=self.nadir1,
        )

    def check_scales(self, tolerance: float = SCALE_TOLERANCE) -> str:
        """Return a remark on the scales of the photos; empty where they agree.

        Raises
        ------
        GeometryError
            If they differ by more than the tolerance: not a bifocal pair, or a wrong c or d.
        """
        if self.c1 is None or self.c2 is None:
            return ""
        share = self.scale_ratio - 1.0
        if abs(share) > tolerance:
            raise GeometryError(
                f"c_1/d_1 = {self.c1 / self.d1:.4g} and c_2/d_2 = {self.c2 / self.d2:.4g} differ "
                f"by {abs(share):.1%}: a bifocal pair has the same scale in both photos. Check "
                f"c_1, c_2, d_1 and d_2 (tolerance {tolerance:.1%}, --scale-tolerance)."
            )
        if abs(share) < 1e-4:
            return ""
        lever = self.d1 * self.d2 / abs(self.d1 - self.d2)
        return (
            f"the scales of the photos differ by {share:+.2%}; image 2 is brought to the scale of "
            f"image 1 (k_12). If c or d is wrong instead, this is {abs(share) * lever:.3f} m of "
            "false relief: points of known relief tell."
        )

    def image_mm(self, xy: np.ndarray, image: int) -> np.ndarray:
        """Return typed coordinates as millimetres from the nadir, y up, shape (n, 2)."""
        if self.unit == "mm" or self.pitch is None:
            return xy
        nadir = np.asarray(self.nadir1 if image == 1 else self.nadir2)
        scaled: np.ndarray = (xy - nadir) * np.array([self.pitch, -self.pitch])
        return scaled
