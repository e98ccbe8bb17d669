"""What lies between both cameras of a pair and the object: as stated, and as unknowns.

A flat port moves with its camera (``port``), the glass of a tank or the surface of water stays with
the object (``depth``). Indices, thicknesses and these lengths may be unknown, with what was given
as an observation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2

import numpy as np

from bifocal import rays
from bifocal.media import MediaOfPhoto, MediaPath, interface_axes, view
from bifocal.model.orientation_precision import (
    CAMERA,
    NAMES,
    common_names,
    names_of,
    pinhole,
    rates_of,
)
from bifocal.model.pair import Pair
from bifocal.model.photo import AXIS
from bifocal.rays import Foot, foot_of, straight
from bifocal.remarks import remark
from multimedia import Layers
from photocore.adjustment.priors import LEAST_INDEX, MOST_INDEX, typical_sigma
from photocore.arrays import FloatArray, not_negative, positive
from photocore.camera import (
    PARAMETERS,
    Pinhole,
    ProjectedPoints,
    ray_on_plane,
    rotation_from_vector,
    triangulate,
)
from photocore.errors import GeometryError, InputError

#: Normal of one camera's interfaces: a direction in the plane frame, square to the optical axis, or
#: None where they are parallel to the reference plane.
Normal = FloatArray | str | None
#: How far a port may lean off what was given, as an unknown without a prior of its own. [rad]
SIGMA_LEAN = float(np.radians(1.0))
#: Cosine of the most that it does.
STEEPEST = 0.7
#: What states the lean of the far and of the near camera's port as unknown.
LEANS = ("lean1", "lean2")
#: The media of a pair that looks through none.
AIR = Layers(indices=(1.0, 1.0))
#: Normal of interfaces parallel to the reference plane; normals that differ by less than `ALIKE`
#: are one and the same glass. [-]
SQUARE, ALIKE = np.array([0.0, 0.0, 1.0]), 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairMedia:
    """Plane-parallel media before both cameras of a pair; in air none (`PairMedia.none`).

    Attributes
    ----------
    layers : Layers
    port : pair of float, or None
        Each camera's centre to the first interface, where that moves with it. [m]
    depth : float or None
        Last interface to the reference plane, where that stays with the object. [m]
    normals : pair
        Of either camera's interfaces: (X, Y, r) in the plane frame, ``"axis"`` for a port square to
        its optical axis, None where they are parallel to the reference plane.
    turning : pair of bool
        Whether a normal is stated in its camera's own frame, with which the port then turns.
    leans : pair of ndarray, shape (3, 3)
        Small turns of either camera's interfaces from there, as found: rows are multiplied by it.
    sigmas : mapping of str to float
        The unknowns with the standard deviations of what was given; infinite: not known. Names:
        ``index1`` ..., ``thickness1`` ... counted from the camera, ``port`` (of both cameras
        alike), ``port1``, ``port2``, ``depth``; ``lean X 1``, ``lean Y 1``, ``lean X 2``,
        ``lean Y 2``: turns of a port about the axes of the plane frame. [-, m, rad]

    Raises
    ------
    InputError
        If ports and depth are both given or neither, an unknown is none of theirs, or a normal is
        stated for media that stay with the object.
    """

    layers: Layers
    port: tuple[float, float] | None = None
    depth: float | None = None
    normals: tuple[Normal, Normal] = (None, None)
    turning: tuple[bool, bool] = (False, False)
    leans: tuple[FloatArray, FloatArray] = field(default_factory=lambda: (np.eye(3), np.eye(3)))
    sigmas: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if (self.port is None) == (self.depth is None):
            raise InputError(remark("media.port_or_depth"))
        for number, value in enumerate(self.port or (), start=1):
            not_negative(value, f"port{number}")
        if self.depth is not None:
            positive(self.depth, "depth", unit="m")
            if any(normal is not None for normal in self.normals):
                raise InputError(remark("media.normal_without_port"))
        allowed = self._allowed
        possible = {unknown for name in allowed for unknown in _unknowns(name)}
        for name, sigma in self.sigmas.items():
            if name not in possible:
                raise InputError(remark("media.no_unknown", name=name, allowed=", ".join(allowed)))
            if not sigma > 0:
                raise InputError(f"--prior {name}={sigma:g}: expected a number above zero, or inf.")
        if "port" in self.sigmas and ({"port1", "port2"} & set(self.sigmas)):
            raise InputError("media: estimate port (of both cameras alike), or port1 and port2.")

    @classmethod
    def none(cls) -> PairMedia:
        """Return the media of a pair in air: nothing is refracted, nothing of them unknown."""
        return cls(layers=AIR, port=(0.0, 0.0))

    @classmethod
    def of(cls, pair: Pair) -> PairMedia:
        """Return what both cameras of a pair look through.

        Whether it is a port, or stays with the object, follows from z0: of a port both are alike,
        else both first interfaces are as high over the reference plane. Ports that lean turn with
        their cameras.

        Raises
        ------
        InputError
            If glass that stays with the object leans against the reference plane.
        """
        if not pair.layers:
            return cls.none()
        photos = (pair.image1, pair.image2)
        towards = [photo.towards_camera for photo in photos]
        first, second = (photo.z0 or 0.0 for photo in photos)
        heights = [
            float(normal @ [*photo.nadir, photo.distance]) - z0
            for normal, photo, z0 in zip(towards, photos, (first, second), strict=True)
        ]
        lean = [float(np.abs(normal - SQUARE).max()) >= ALIKE for normal in towards]
        one_glass = float(np.abs(towards[0] - towards[1]).max()) < ALIKE
        if one_glass and abs(heights[0] - heights[1]) < abs(first - second):
            if any(lean):
                raise InputError(remark("media.leaning_together"))
            return cls(layers=pair.layers, depth=heights[0] - pair.layers.thickness)
        normals = [
            pinhole(photo).rotation @ normal if leans else None
            for photo, normal, leans in zip(photos, towards, lean, strict=True)
        ]
        return cls(
            layers=pair.layers, port=(first, second), normals=(normals[0], normals[1]),
            turning=(lean[0], lean[1]),
        )  # fmt: skip

    @classmethod
    def of_cameras(cls, far: tuple[PairMedia, int], near: tuple[PairMedia, int]) -> PairMedia:
        """Return the media of two cameras, each 0 or 1 of a pair whose media are known."""
        (first, i), (second, j) = far, near
        if not (first and second):
            return cls.none()
        return replace(
            first,
            port=first.port and (first.port[i], (second.port or first.port)[j]),
            normals=(first.normals[i], second.normals[j]),
            turning=(first.turning[i], second.turning[j]),
        )

    def __bool__(self) -> bool:
        """Whether there are media at all: also those of another process, by their values."""
        return self.layers != AIR or bool(self.sigmas)

    @property
    def leaning(self) -> bool:
        """Whether a port leans by what counts in the plane frame: a stated normal, an unknown."""
        stated = any(isinstance(normal, np.ndarray) for normal in self.normals)
        return stated or any(name.startswith("lean") for name in self.sigmas)

    @property
    def counted(self) -> tuple[str, ...]:
        """What the covariance of a pair through them counts: `names_of`."""
        return names_of(self.layers if self else None)

    @classmethod
    def stated(
        cls,
        indices: Sequence[float],
        thicknesses: Sequence[float] = (),
        *,
        ports: tuple[float | None, float | None] = (None, None),
        depth: float | None = None,
        normals: tuple[Normal, Normal] = (None, None),
        estimate: Sequence[str] = (),
        priors: Mapping[str, float] | None = None,
    ) -> PairMedia:
        """Return media as typed: unknowns are what is to be estimated, or has a prior.

        Parameters
        ----------
        indices, thicknesses : sequence of float
            As of `multimedia.Layers`.
        ports, depth, normals
            As of the class; a port of one camera stands for the other's where that is None.
        estimate : sequence of str
            Unknowns; their sigmas are typical ones: indices 0.005, lengths a tenth, leans 1 degree.
            ``lean1`` and ``lean2`` stand for both turns of a port.
        priors : mapping of str to float, optional
            Unknowns with their sigmas. [-, m, rad]

        Raises
        ------
        InputError
            As of the class, or where indices and thicknesses do not go together.
        """
        first, second = ports
        if first is None:
            first = second
        port = None if first is None else (first, first if second is None else second)
        layers = Layers(indices=tuple(indices), thicknesses=tuple(thicknesses))
        media = cls(layers=layers, port=port, depth=depth, normals=normals)
        sigmas, usual_sigmas = {}, dict(priors or {})
        for name in (*estimate, *usual_sigmas):
            start = media.value(name) if name in media._allowed and name not in LEANS else 0.0
            usual = SIGMA_LEAN if name in LEANS else max(typical_sigma(name, start), 1e-6)
            for unknown in _unknowns(name):
                sigmas[unknown] = usual_sigmas.get(name, usual)
        return replace(media, sigmas=sigmas)

    @property
    def _allowed(self) -> tuple[str, ...]:
        """What may be stated as unknown."""
        placed = ("depth",) if self.port is None else ("port", "port1", "port2", *LEANS)
        return (*common_names(self.layers), *placed)

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns: the cameras', then those of the media."""
        return (*NAMES, *self.sigmas)

    def value(self, name: str) -> float:
        """Return an index, a length or a turn by the name it has as an unknown.

        Of ``port`` that of the first camera.
        """
        if name.startswith("lean"):
            aside, up, along = self.leans[int(name[-1]) - 1][2].tolist()
            return atan2(up if name[5] == "X" else 0.0 - aside, along)
        if name.startswith("index"):
            return self.layers.indices[int(name[5:]) - 1]
        if name.startswith("thickness"):
            return self.layers.thicknesses[int(name[9:]) - 1]
        if self.port is None:
            assert self.depth is not None
            return self.depth
        return self.port[int(name == "port2")]

    def stepped(self, step: FloatArray) -> PairMedia:
        """Return the media after a step of their unknowns.

        Raises
        ------
        GeometryError
            If that leaves what media can be.
        """
        if not self.sigmas:
            return self
        by_name = dict(zip(self.sigmas, step.tolist(), strict=True))
        indices, thicknesses = (
            tuple(value + by_name.get(f"{kind}{k}", 0.0) for k, value in enumerate(values, start=1))
            for kind, values in (
                ("index", self.layers.indices),
                ("thickness", self.layers.thicknesses),
            )
        )
        port, depth = self.port, self.depth
        if port is not None:
            both = by_name.get("port", 0.0)
            ends = (port[k] + both + by_name.get(f"port{k + 1}", 0.0) for k in (0, 1))
            port = (next(ends), next(ends))
        if depth is not None:
            depth += by_name.get("depth", 0.0)
        leans = tuple(
            lean @ rotation_from_vector([*(by_name.get(f"lean {a} {k}", 0.0) for a in "XY"), 0.0])
            for k, lean in enumerate(self.leans, start=1)
        )
        lost = min(*thicknesses, *(port or ()), depth or 0.0, 0.0) < 0 or depth == 0
        lost |= min(lean[2, 2] for lean in leans) < STEEPEST
        if lost or min(indices) < LEAST_INDEX or max(indices) > MOST_INDEX:
            raise GeometryError("media: the step leads to what no media can be.")
        layers = Layers(indices=indices, thicknesses=thicknesses)
        return replace(self, layers=layers, port=port, depth=depth, leans=(leans[0], leans[1]))

    def exchanged(self) -> PairMedia:
        """Return the media with far and near camera exchanged."""
        turned = {"port1": "port2", "port2": "port1"}
        turned |= {f"lean {a} {k}": f"lean {a} {3 - k}" for a in "XY" for k in (1, 2)}
        return replace(
            self,
            port=None if self.port is None else self.port[::-1],
            normals=self.normals[::-1],
            turning=self.turning[::-1],
            leans=self.leans[::-1],
            sigmas={turned.get(name, name): sigma for name, sigma in self.sigmas.items()},
        )

    def z0(self, number: int, camera: Pinhole) -> float:
        """Return camera 0's or 1's way to the first interface. [m]"""
        if self.port is not None:
            return self.port[number]
        assert self.depth is not None
        return float(camera.centre[2]) - self.depth - self.layers.thickness

    def normal(self, number: int, camera: Pinhole) -> FloatArray | None:
        """Return the unit normal of camera 0's or 1's interfaces towards it, shape (3,)."""
        stated, lean = self.normals[number], self.leans[number]
        if isinstance(stated, str):
            assert stated == AXIS
            return np.asarray(-camera.rotation[2] @ lean)
        if stated is None:
            return lean[2] if self._may_lean(number) else None
        if self.turning[number]:
            stated = stated @ camera.rotation
        return np.asarray(stated / np.linalg.norm(stated) @ lean)

    def _may_lean(self, number: int) -> bool:
        """Tell whether the lean of camera 0's or 1's port is unknown."""
        return any(f"lean {axis} {number + 1}" in self.sigmas for axis in "XY")

    def path(self, number: int, camera: Pinhole) -> MediaPath | None:
        """Return what camera 0's or 1's rays cross; None in air."""
        if not self:
            return None
        normal = self.normal(number, camera)
        return MediaPath(
            layers=self.layers,
            z0=self.z0(number, camera),
            distance=float(camera.centre[2]),
            rotation=None if normal is None else interface_axes(normal),
        )

    def foot(self, number: int, camera: Pinhole) -> Foot:
        """Return camera 0 or 1 with what its rays cross, reduced to what relief needs."""
        return foot_of(camera, self.path(number, camera))

    def view(self, number: int, camera: Pinhole, xyz: FloatArray) -> ProjectedPoints:
        """Return what `project_with_jacobian` does for camera 0 or 1, through media; NaN if unseen.

        Media that stay come nearer to a camera that goes up, a port moves and may turn with it.
        """
        points = view(camera, self.path(number, camera), xyz)
        if not self:
            return ProjectedPoints(points.pixels, points.by_point, points.by_camera)
        rates = rates_of(points, np.zeros((len(xyz), 2, 2)), number) @ self.by_unknowns()
        first = number * len(CAMERA)
        by_camera = rates[..., first : first + len(PARAMETERS)]
        return ProjectedPoints(points.pixels, points.by_point, by_camera)

    def on_plane(self, number: int, camera: Pinhole, pixels: FloatArray) -> FloatArray:
        """Return where rays of camera 0's or 1's ideal pixels meet the plane, (n, 3). [m]"""
        place = ray_on_plane(camera, pixels)
        if self:
            place[:, :2] = rays.object_rays(place[:, :2], self.foot(number, camera)).position
            place[:, 2] = np.where(np.isfinite(place[:, 0]), 0.0, np.nan)
        return place

    def meeting(
        self, cameras: Sequence[Pinhole], pixels1: FloatArray, pixels2: FloatArray
    ) -> FloatArray:
        """Return where the rays of ideal pixels of both cameras meet, shape (n, 3). [m]"""
        first, second = cameras
        if not self:
            return triangulate(first, second, pixels1, pixels2)
        far, near = self.foot(0, first), self.foot(1, second)
        both = zip(cameras, (pixels1, pixels2), strict=True)
        q1, q2 = (ray_on_plane(camera, pixels)[:, :2] for camera, pixels in both)
        return rays.point_on_ray(q1, rays.relief_of_rays(q1, q2, far, near), far)

    def near_axis(self, number: int, camera: Pinhole) -> tuple[float, float]:
        """Return the distance of the straight camera that sees alike near the axis, and its rate.

        By the camera's own distance, which it is in air. [m, -]
        """
        stays = self.depth is not None
        rate = self.layers.indices[-1] / self.layers.indices[0] if stays else 1.0
        return straight(self.foot(number, camera)).distance, rate

    def rates_by_unknowns(self, rates: FloatArray) -> FloatArray:
        """Return rates by what `counted` names, (..., k), by the unknowns `names`, (..., u)."""
        return rates @ self.by_unknowns() if self else rates

    def by_unknowns(self) -> FloatArray:
        """Return how what `names_of` counts moves with the unknowns `names`, shape (k, u).

        A port goes with its camera, and one square to the optical axis turns with it; what stays
        with the object is the farther from a camera that moves away.
        """
        rows, names = list(self.counted), self.names
        if not self:
            return np.eye(len(rows))
        out = np.zeros((len(rows), len(names)))
        stays = self.depth is not None
        out[: len(NAMES), : len(NAMES)] = np.eye(len(NAMES))
        for number, normal in enumerate(self.normals, start=1):
            if stays:
                out[rows.index(f"z0 {number}"), NAMES.index(f"Z {number}")] = 1.0
            for axis in "XYZ" if isinstance(normal, str) or self.turning[number - 1] else "":
                lean, turn = f"lean {axis} {number}", f"turn {axis} {number}"
                out[rows.index(lean), NAMES.index(turn)] = 1.0
        for number, turned in enumerate(self.leans, start=1):  # a lean turns with where it leans
            leans = [rows.index(f"lean {axis} {number}") for axis in "XYZ"]
            out[leans, : len(NAMES)] = turned.T @ out[leans, : len(NAMES)]
        for column, name in enumerate(names[len(NAMES) :], start=len(NAMES)):
            if name in rows:
                out[rows.index(name), column] = 1.0
            for number in (1, 2):
                z0 = rows.index(f"z0 {number}")
                if name in ("port", f"port{number}"):
                    out[z0, column] = 1.0
                elif stays and (name == "depth" or name.startswith("thickness")):
                    out[z0, column] = -1.0
        return out


def stated_by_photo(media: PairMedia, number: int, camera: Pinhole) -> MediaOfPhoto:
    """Return what the photo of camera 0 or 1 states of its media; nothing in air."""
    if not media:
        return {}
    return {
        "layers": media.layers,
        "z0": media.z0(number, camera),
        "interface_normal": media.normal(number, camera),
    }


def _unknowns(name: str) -> tuple[str, ...]:
    """Return the unknowns that a name states: of a lean both turns of the port."""
    return tuple(f"lean {axis} {name[4:]}" for axis in "XY") if name in LEANS else (name,)
