"""What is observed of a pair, and what is unknown: the unknowns by name."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bifocal.model import CAMERA, NAMES, Cameras, Interiors, PairMedia
from bifocal.orientation.control_points import Control
from bifocal.orientation.facade_lines import FacadeDirection
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import RadialDivision

#: Ties count as so many independent ones: their errors are smooth over the photo. With 700 the
#: fitted offset, slopes and scale of relief were up to 2.2 of their sigma off, with 100 0.4 to 1.4.
INDEPENDENT = 100
#: Standardised misfits, shape (m,), and their rates by the unknowns, shape (m, len(NAMES)).
Equations = tuple[FloatArray, FloatArray]


def at(name: str, camera: int) -> int:
    """Return where a parameter of camera 1 or 2 stands in `NAMES`.

    Examples
    --------
    >>> NAMES[at("Z", 2)]
    'Z 2'
    """
    return NAMES.index(f"{name} {camera}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairObservations:
    """Everything observed. Pixels are free of the lens file's distortion.

    Attributes
    ----------
    interiors : pair of Interior
    control : Control
    pick_used : ndarray of bool, shape (n,)
        Control points that take part.
    sigma_pick : float
        Precision of control picks. [px]
    tie1, tie2 : ndarray, shape (m, 2)
    sigma_tie : float
        Precision of a tie point's coordinate. [px]
    tie_used, wall : ndarray of bool, shape (m,)
        Ties that take part; ties that lie on the wall.
    wall_rows : ndarray, shape (3, m)
        What the wall's ties tell of the reference plane: times how far each lies from where the
        plane puts it [px] they are its height and two slopes over their standard deviations.
        Zeros: nothing. A wall is no plane to a millimetre, so it gives three numbers and no more.
    sigma_body, sigma_zoom : float or None
        Both photos come from one body (same principal point [px], same aspect), or with one
        unchanged lens (same principal distance, relative, and same distortion).
    measured : mapping of str to (value, sigma)
        ``distance1``, ``distance2``, ``delta_d``. [m]
    sigma_tilt : float or None
        Standard deviation of "image plane parallel to the wall". [rad]
    lines : tuple of FacadeDirection
        Directions of the façade's lines, each along the wall.
    free_datum : bool
        Whether origin and turn of the plane frame are free and must be held.
    media : PairMedia
        What lies between cameras and object, as given, with its unknowns.
    """

    interiors: Interiors
    control: Control = field(default_factory=Control)
    pick_used: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    sigma_pick: float = 0.5
    tie1: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    tie2: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_tie: float = 0.5
    tie_used: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    wall: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    wall_rows: FloatArray = field(default_factory=lambda: np.zeros((3, 0)))
    sigma_body: float | None = None
    sigma_zoom: float | None = None
    measured: dict[str, tuple[float, float]] = field(default_factory=dict)
    sigma_tilt: float | None = None
    lines: tuple[FacadeDirection, ...] = ()
    free_datum: bool = False
    media: PairMedia = field(default_factory=PairMedia.none)

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns: `NAMES`, and those of the media."""
        return self.media.names

    @property
    def estimated(self) -> BoolArray:
        """Which of `names` are estimated, the others being held."""
        free = np.ones(len(self.names), dtype=bool)
        for number, interior in enumerate(self.interiors, start=1):
            free[[at("k1", number), at("k2", number)]] = interior.sigma_radial > 0
            free[at("aspect", number)] = interior.sigma_aspect > 0
        if self.free_datum:
            free[[at(name, 1) for name in ("turn Z", "X", "Y")]] = False
        return free

    @property
    def lines_bend_nothing(self) -> bool:
        """Whether lines turn the frame alone: ties know calibrated lenses better than lines do."""
        return not self.media and all(interior.is_calibrated for interior in self.interiors)

    @property
    def sigma_ties(self) -> float:
        """Standard deviation with which every tie counts, were they independent. [px]"""
        return self.sigma_tie * float(np.sqrt(max(self.tie_used.sum() / INDEPENDENT, 1.0)))

    def radial_models(self, radial: FloatArray) -> tuple[RadialDivision, RadialDivision]:
        """Return the distortions of both photos for their k1 and k2, shape (2, 2)."""
        first, second = (i.radial(*k) for i, k in zip(self.interiors, radial, strict=True))
        return first, second

    def straight_ties(self, radial: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the ties in both photos freed of the estimated radial distortion."""
        first, second = self.radial_models(radial)
        return first.undistort(self.tie1), second.undistort(self.tie2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairUnknowns:
    """What is adjusted.

    Attributes
    ----------
    cameras : pair of Pinhole
    radial : ndarray, shape (2, 2)
        Radial distortion k1, k2 of either photo.
    media : PairMedia
        What lies between cameras and object.
    """

    cameras: Cameras
    radial: FloatArray = field(default_factory=lambda: np.zeros((2, 2)))
    media: PairMedia = field(default_factory=PairMedia.none)

    def stepped(self, step: FloatArray) -> PairUnknowns:
        """Return the unknowns after a step of all names, as `PairMedia.stepped`."""
        media = self.media.stepped(step[len(NAMES) :])
        parts = step[: len(NAMES)].reshape(2, len(CAMERA))
        first, second = (c.stepped(p) for c, p in zip(self.cameras, parts, strict=True))
        return PairUnknowns(
            cameras=(first, second), radial=self.radial + parts[:, -2:], media=media
        )

    def values(self) -> FloatArray:
        """Return the unknowns in the order of `NAMES`, turns counted from here."""
        parts: list[float] = []
        for camera, radial in zip(self.cameras, self.radial, strict=True):
            focal, aspect = camera.matrix[0, 0], camera.matrix[1, 1] / camera.matrix[0, 0]
            parts += [np.log(focal), np.log(aspect), *camera.matrix[:2, 2], 0.0, 0.0, 0.0]
            parts += [*camera.centre, *radial]
        return np.array(parts)
