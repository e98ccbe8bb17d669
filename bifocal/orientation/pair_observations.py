"""What is observed of a pair, and what is unknown: the unknowns by name."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bifocal.orientation.control_points import Control
from bifocal.orientation.interior_orientation import Cameras, Interiors
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import PARAMETERS

#: Parameters of one camera of the pair, and of the ties' wall.
CAMERA = (*PARAMETERS, "radial")
WALL = ("wall height", "wall slope X", "wall slope Y")
#: All parameters, in the order of the covariance.
NAMES = (*(f"{name} {number}" for number in (1, 2) for name in CAMERA), *WALL)
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
        Ties that take part; ties that lie on the wall plane.
    sigma_wall : ndarray, shape (m,)
        How precisely a tie of the wall lies where the plane puts it: its own precision and the
        wall's roughness, seen in photo 2. [px]
    sigma_body, sigma_zoom : float or None
        Both photos come from one body (same principal point [px], same aspect), or with one
        unchanged lens (same principal distance, relative).
    sigma_plane : float
        How far the ties' wall may lie from the reference plane; zero: they define it. [m]
    sigma_slope : float
        The same for the slope between the two. [m/m]
    measured : mapping of str to (value, sigma)
        ``distance1``, ``distance2``, ``delta_d``. [m]
    sigma_tilt : float or None
        Standard deviation of "image plane parallel to the wall". [rad]
    free_datum : bool
        Whether origin and turn of the plane frame are free and must be held.
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
    sigma_wall: FloatArray = field(default_factory=lambda: np.zeros(0))
    sigma_body: float | None = None
    sigma_zoom: float | None = None
    sigma_plane: float = 0.0
    sigma_slope: float = 0.0
    measured: dict[str, tuple[float, float]] = field(default_factory=dict)
    sigma_tilt: float | None = None
    free_datum: bool = False

    @property
    def estimated(self) -> BoolArray:
        """Which of `NAMES` are estimated, the others being held."""
        free = np.ones(len(NAMES), dtype=bool)
        for number, interior in enumerate(self.interiors, start=1):
            free[at("radial", number)] = interior.sigma_radial > 0
            free[at("aspect", number)] = interior.sigma_aspect > 0
        if self.free_datum:
            free[[at(name, 1) for name in ("turn Z", "X", "Y")]] = False
        free[-len(WALL) :] = self.sigma_plane > 0 and bool((self.wall & self.tie_used).any())
        return free

    def straight_ties(self, radial: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return the ties in both photos freed of the estimated radial distortion."""
        first, second = (
            interior.radial(k) for interior, k in zip(self.interiors, radial, strict=True)
        )
        return first.undistort(self.tie1), second.undistort(self.tie2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairUnknowns:
    """What is adjusted.

    Attributes
    ----------
    cameras : pair of Pinhole
    radial : pair of float
        Radial distortion k of either photo.
    plane : ndarray, shape (3,)
        The ties' wall, z = a + b X + c Y. [m, -, -]
    """

    cameras: Cameras
    radial: tuple[float, float] = (0.0, 0.0)
    plane: FloatArray = field(default_factory=lambda: np.zeros(3))

    def stepped(self, step: FloatArray) -> PairUnknowns:
        """Return the unknowns after a step of all `NAMES`."""
        parts = step[: -len(WALL)].reshape(2, len(CAMERA))
        first, second = (c.stepped(p) for c, p in zip(self.cameras, parts, strict=True))
        return PairUnknowns(
            cameras=(first, second),
            radial=(self.radial[0] + float(parts[0, -1]), self.radial[1] + float(parts[1, -1])),
            plane=self.plane + step[-len(WALL) :],
        )

    def values(self) -> FloatArray:
        """Return the unknowns in the order of `NAMES`, turns counted from here."""
        parts: list[float] = []
        for camera, k in zip(self.cameras, self.radial, strict=True):
            focal, aspect = camera.matrix[0, 0], camera.matrix[1, 1] / camera.matrix[0, 0]
            parts += [np.log(focal), np.log(aspect), *camera.matrix[:2, 2], 0.0, 0.0, 0.0]
            parts += [*camera.centre, k]
        return np.array([*parts, *self.plane])
