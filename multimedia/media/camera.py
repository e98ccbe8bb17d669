"""A camera: where it stands, where it looks, and its interior orientation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats, as_points, positive, read_only
from photocore.camera import NAMES as DISTORTION
from photocore.camera import Brown as Brown
from photocore.camera import Fisheye as Fisheye
from photocore.camera import (
    angle_rates,
    angles_from_rotation,
    checked_rotation,
    rotation_from_vector,
    world_from_camera,
)
from photocore.errors import GeometryError, InputError

#: Parameters of the exterior orientation; angles in rad.
EXTERIOR = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
#: Parameters of the interior orientation; ``scale`` is that of x against y.
INTERIOR = ("c", "xh", "yh", *DISTORTION)
#: Those of any lens model; a camera has those of its own (`Camera.interior_names`).
ANY_INTERIOR = (*INTERIOR, "k4")
#: Models of a lens: Brown's formula on the central projection, or a fisheye.
Distortion = Brown | Fisheye
#: A full turn and a little: larger "radians" are degrees.
LARGEST_ANGLE = 6.2832

#: Finer than this no sensor's pixel is. [mm]
SMALLEST_PIXEL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensor:
    """Size of the sensor and its pixels: what pixels and image coordinates need of each other.

    Pixels count rows down, image coordinates y up: this is the only place y is flipped.

    Attributes
    ----------
    width, height : int
        [px]
    pixel_size : ndarray, shape (2,)
        Width and height of a pixel. [mm]
    origin : ndarray, shape (2,)
        (column, row) of the origin of the image coordinates, by default the centre of the
        sensor: ((width - 1) / 2, (height - 1) / 2), integers being pixel centres. [px]

    Examples
    --------
    >>> sensor = Sensor(width=1280, height=1024, pixel_size=[0.012, 0.012])
    >>> sensor.image_from_pixel([639.5, 500.0]).tolist()
    [0.0, 0.138]
    """

    width: int
    height: int
    pixel_size: FloatArray
    origin: FloatArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        for name in ("width", "height"):
            size = positive(getattr(self, name), f"sensor {name}", unit="px")
            if size != round(size):
                raise InputError(f"sensor {name}: must be a whole number of pixels, got {size:g}.")
            set_(self, name, round(size))
        sides = np.broadcast_to(as_floats(self.pixel_size, "pitch"), (2,))
        if not (sides >= SMALLEST_PIXEL).all():
            raise InputError(
                f"pitch: a pixel is {sides} mm wide and high; both must be {SMALLEST_PIXEL:g} mm "
                "or more."
            )
        origin = ((self.width - 1) / 2, (self.height - 1) / 2)
        set_(self, "pixel_size", read_only(sides, "pitch", shape=(2,)))
        set_(self, "origin", read_only(origin if self.origin is None else self.origin, "origin"))

    @property
    def half_diagonal(self) -> float:
        """Distance from the centre to a corner. [mm]"""
        return float(np.hypot(*(np.array([self.width, self.height]) * self.pixel_size)) / 2)

    def image_from_pixel(self, pixels: ArrayLike) -> FloatArray:
        """Return image coordinates of (column, row), shape (..., 2). [mm]"""
        offset = as_points(pixels, "pixels", dimension=2) - self.origin
        return offset * (self.pixel_size * (1.0, -1.0))

    def pixel_from_image(self, image: ArrayLike) -> FloatArray:
        """Return (column, row) of image coordinates, shape (..., 2). [px]"""
        scaled = as_points(image, "image", dimension=2) / (self.pixel_size * (1.0, -1.0))
        return scaled + self.origin


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """Exterior and interior orientation of one camera.

    Attributes
    ----------
    centre : ndarray, shape (3,)
        Projection centre. [object unit]
    rotation : ndarray, shape (3, 3)
        World from camera: its columns are the camera's axes, x to the right in the image, y up,
        z backwards.
    principal_distance : float
        [mm]
    principal_point : ndarray, shape (2,)
        Image coordinates of the foot of the projection centre. [mm]
    distortion : Brown or Fisheye
        Lens distortion, or the whole law of a fisheye lens.
    sensor : Sensor or None
        Needed only where pixels are read or written.
    name : str
        For tables and messages.

    Examples
    --------
    A camera 0.5 above the water, looking straight down:

    >>> camera = Camera.from_angles((0, 0, 0.5), 0.0, 0.0, 0.0, principal_distance=25.0)
    >>> camera.looks_along.tolist()
    [-0.0, 0.0, -1.0]
    """

    centre: FloatArray
    rotation: FloatArray
    principal_distance: float
    principal_point: FloatArray = (0.0, 0.0)  # type: ignore[assignment]
    distortion: Distortion = field(default_factory=Brown)
    sensor: Sensor | None = None
    name: str = ""

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        who = f"camera {self.name}: " if self.name else ""
        set_(self, "rotation", checked_rotation(self.rotation, f"{who}rotation"))
        set_(self, "centre", read_only(self.centre, f"{who}centre", shape=(3,)))
        distance = positive(self.principal_distance, f"{who}principal_distance", unit="mm")
        set_(self, "principal_distance", distance)
        point = read_only(self.principal_point, f"{who}principal_point", shape=(2,))
        set_(self, "principal_point", point)

    @classmethod
    def from_angles(
        cls,
        centre: ArrayLike,
        omega: float,
        phi: float,
        kappa: float,
        *,
        principal_distance: float,
        principal_point: ArrayLike = (0.0, 0.0),
        distortion: Distortion | None = None,
        sensor: Sensor | None = None,
        name: str = "",
    ) -> Camera:
        """Return a camera from its angles.

        Parameters
        ----------
        centre : array_like, shape (3,)
            Projection centre. [object unit]
        omega, phi, kappa : float
            Rotations about X, the once and the twice rotated axes; all zero looks down the Z
            axis with the image's x along X. [rad]
        principal_distance : float
            [mm]
        principal_point : array_like, shape (2,)
            [mm]
        distortion : Brown or Fisheye, optional
            None: no distortion.
        sensor : Sensor, optional
            Needed only where pixels are read or written.
        name : str
            For tables and messages.

        Raises
        ------
        InputError
            If an angle exceeds a full turn: it is in degrees, or needs unwinding.
        """
        angles = as_floats([omega, phi, kappa], "omega, phi, kappa")
        if not (np.abs(angles) <= LARGEST_ANGLE).all():
            raise InputError(
                f"{f'camera {name}: ' if name else ''}omega, phi, kappa = "
                f"{', '.join(f'{a:g}' for a in angles)}: angles are in radians and at most one "
                "full turn (6.2832). Are these degrees? Convert with numpy.radians; take whole "
                "turns off with numpy.remainder(angle, 2 * numpy.pi)."
            )
        return cls(
            centre=as_floats(centre, "centre"),
            rotation=world_from_camera(*(float(a) for a in angles)),
            principal_distance=principal_distance,
            principal_point=as_floats(principal_point, "principal_point"),
            distortion=distortion or Brown(),
            sensor=sensor,
            name=name,
        )

    @classmethod
    def looking_at(
        cls, centre: ArrayLike, target: ArrayLike, *, principal_distance: float, name: str = ""
    ) -> Camera:
        """Return a camera at ``centre`` whose axis goes through ``target``, image x level."""
        eye = as_points(centre, "centre", dimension=3)
        back = eye - as_points(target, "target", dimension=3)
        length = float(np.linalg.norm(back))
        if length == 0:
            raise GeometryError("looking_at: centre and target are the same point.")
        back = back / length
        # Straight down or up, "level" leaves kappa open: take the image's x along X.
        level = np.array([-back[1], back[0], 0.0])
        right = level / np.linalg.norm(level) if np.hypot(*level[:2]) > 1e-9 else np.eye(3)[0]
        right = right - (right @ back) * back
        right /= np.linalg.norm(right)
        rotation = np.column_stack([right, np.cross(back, right), back])
        return cls(centre=eye, rotation=rotation, principal_distance=principal_distance, name=name)

    @property
    def angles(self) -> tuple[float, float, float]:
        """Omega, phi, kappa. [rad]"""
        return angles_from_rotation(self.rotation)

    def described_sensor(self, why: str = "its sensor is not described; pixels need it.") -> Sensor:
        """Return the sensor.

        Raises
        ------
        InputError
            With ``why``, if the camera has none.
        """
        if self.sensor is None:
            raise InputError(f"camera {self.name}: {why}")
        return self.sensor

    @property
    def looks_along(self) -> FloatArray:
        """Unit vector of the viewing direction in the world, shape (3,)."""
        return -self.rotation[:, 2]

    @property
    def interior_names(self) -> tuple[str, ...]:
        """Names of the parameters of this camera's interior orientation, of `ANY_INTERIOR`."""
        return ("c", "xh", "yh", *self.distortion.names)

    def ideal(self, measured: ArrayLike) -> FloatArray:
        """Return image coordinates without distortion, about the principal point, (..., 2). [mm]

        NaN where no direction is seen there.
        """
        return self.distortion.ideal(measured, self.principal_point, self.principal_distance)

    def measured(self, ideal: ArrayLike) -> FloatArray:
        """Return where ideal image coordinates are measured: undoes `ideal`, (..., 2). [mm]"""
        return self.distortion.measured(ideal, self.principal_point, self.principal_distance)

    def vectors_to(self, points: FloatArray) -> FloatArray:
        """Return the vectors from the projection centre in the camera frame, shape (..., 3)."""
        vectors: FloatArray = (points - self.centre) @ self.rotation
        return vectors

    def value(self, name: str) -> float:
        """Return the parameter of `EXTERIOR` or `INTERIOR` called ``name``."""
        if name in self.distortion.names:
            return float(getattr(self.distortion, name))
        if name in ANY_INTERIOR[3:]:
            raise InputError(f"camera {self.name}: its lens model has no {name}.")
        values = (*self.centre, *self.angles, self.principal_distance, *self.principal_point)
        return float(values[(EXTERIOR + INTERIOR).index(name)])

    def stepped(self, names: Sequence[str], step: ArrayLike) -> Camera:
        """Return the camera after adding ``step`` to the named parameters.

        ``omega``, ``phi``, ``kappa`` here are the three components of a small rotation vector in
        the world frame if all three are named (the camera turns by it; no gimbal lock), so that a
        solver may use the derivatives of `project_with_jacobian` as they are. See
        `angle_rates` for the way back to angles.

        Raises
        ------
        InputError
            If some but not all angles are named, a name is unknown, or the lens has no such term.
        """
        change = dict(zip(names, as_floats(step, "step").tolist(), strict=True))
        parameters = EXTERIOR + self.interior_names
        unknown = [name for name in change if name not in parameters]
        angles = [change[name] for name in EXTERIOR[3:] if name in change]
        if unknown or len(angles) not in (0, 3):
            raise InputError(
                f"camera parameters {', '.join(names)}: name omega, phi and kappa together; the "
                f"others are {', '.join(EXTERIOR[:3] + self.interior_names)}."
            )
        rotation = self.rotation
        if angles:
            rotation = rotation_from_vector(angles) @ rotation
            # The product of many small turns drifts off by rounding; one polar step mends it.
            rotation = rotation @ (1.5 * np.eye(3) - 0.5 * rotation.T @ rotation)
        terms = {
            name: getattr(self.distortion, name) + change[name]
            for name in self.distortion.names
            if name in change
        }
        return replace(
            self,
            centre=self.centre + [change.get(name, 0.0) for name in EXTERIOR[:3]],
            rotation=rotation,
            principal_distance=self.principal_distance + change.get("c", 0.0),
            principal_point=self.principal_point + [change.get(n, 0.0) for n in ("xh", "yh")],
            distortion=replace(self.distortion, **terms) if terms else self.distortion,
        )

    def angle_rates(self) -> FloatArray:
        """Return d(omega, phi, kappa) / d(rotation vector), shape (3, 3); huge near phi = 90 deg.

        A covariance of rotation vectors C becomes one of angles as ``A C A.T``.
        """
        if np.hypot(*self.rotation[0, :2]) < 1e-9:
            raise GeometryError(remark("camera.gimbal", name=self.name))
        return angle_rates(self.rotation)
