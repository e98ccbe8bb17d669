"""How flat and how parallel the faces of a tank, a port or the water must be.

Points are seen through faces that are bent, wedged or wavy (ray-traced) and intersected as if these
were the planes of the project: what a deviation costs in object space. Everything happens in the
frame of the faces, their normal being Z, so walls and ports are studied like water surfaces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multimedia.media import (
    Camera,
    FlatInterface,
    Interfaces,
    Plane,
    RefractingSurface,
    Sphere,
    WaveSurface,
    aim_rays,
    project,
    tangents_of,
)
from multimedia.orientation import intersect
from photocore.arrays import FloatArray, positive
from photocore.errors import GeometryError, InputError

#: Deviations that are studied: sag over the part of the faces that rays cross [mm], angle between
#: the faces and slope of waves [rad]. Small enough for costs to grow with them.
SAG, WEDGE, SLOPE = 0.01, 1e-4, 1e-4
#: Errors below this share of the width that rays cross are rounding: media that do not refract.
ROUNDING = 1e-12
#: Lengths of waves as shares of the width that rays cross.
WAVELENGTHS = (2.0, 1.0, 0.5, 0.25, 0.125)


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """What faces that are not plane or not parallel cost.

    Attributes
    ----------
    kind : str
        ``bend``, ``wedge`` or ``waves``.
    size : float
        Sag of a bend [object unit], angle of a wedge, steepest slope of waves [rad].
    wavelength : float
        Of waves; NaN otherwise. [object unit]
    shift : tuple of float
        RMS error of X, Y, Z of the points. [object unit]
    largest : float
        Largest error of a point.
    allowed : float
        Size whose RMS error equals the expected standard deviation of the points, to first order
        (in proportion to ``size``); infinite where it costs nothing, as behind media of one index.
    left_out : int
        Points, counted in each variant, that two cameras no longer see and no figure here counts.
    """

    kind: str
    size: float
    wavelength: float
    shift: tuple[float, ...]
    largest: float
    allowed: float
    left_out: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Local:
    """One camera and the points in the frame of its faces, the last one being the plane Z = 0."""

    camera: Camera
    points: FloatArray
    faces: Interfaces

    @classmethod
    def of(cls, camera: Camera, interface: FlatInterface, points: FloatArray) -> _Local:
        """Return them for a camera of the project."""
        first, second = tangents_of(interface.normal)
        turn, origin = np.stack([first, second, interface.normal]), interface.point
        if interface.moves_with_camera:
            turn = turn @ camera.rotation.T
            origin = camera.centre + camera.rotation @ interface.point
        moved = replace(
            camera, centre=turn @ (camera.centre - origin), rotation=turn @ camera.rotation
        )
        faces = Interfaces.parallel(interface.layers)
        return cls(camera=moved, points=(points - origin) @ turn.T, faces=faces)

    def crossings(self) -> FloatArray:
        """Return where the rays cross the last face, shape (n, 2)."""
        vertices: FloatArray = aim_rays(self.camera.centre, self.points, self.faces).vertices
        return vertices[:, -1, :2]


def planarity_study(
    cameras: Sequence[Camera],
    media: Sequence[object],
    points: FloatArray,
    *,
    expected: float,
    millimetre: float = 1e-3,
) -> tuple[Deviation, ...]:
    """Return what faces cost that are bent, wedged or wavy.

    Parameters
    ----------
    cameras : sequence of Camera
        At least two.
    media : sequence of FlatInterface
        What each looks through.
    points : ndarray, shape (n, 3)
        Where measurements are planned. [object unit]
    expected : float
        Standard deviation of a point that the deviations are held against, RMS of X, Y, Z
        together. [object unit]
    millimetre : float
        A millimetre in object units.

    Returns
    -------
    tuple of Deviation
        A bend (all faces alike, as a pane bulges), a wedge (the last face against the others, in
        two directions; with glass only), waves of the last face of several lengths (two directions
        and two phases each).

    Raises
    ------
    InputError
        If media are no parallel layers.
    GeometryError
        If no point is seen by two cameras.
    """
    positive(expected, "expected")
    flat = [item for item in media if isinstance(item, FlatInterface)]
    if len(flat) < len(media) or len(cameras) < 2:
        raise InputError(
            "planarity: two cameras or more are needed, all before plane-parallel media."
        )
    views = [
        _Local.of(camera, deviations, points)
        for camera, deviations in zip(cameras, flat, strict=True)
    ]
    crossed = np.concatenate([view.crossings() for view in views])
    crossed = crossed[np.isfinite(crossed).all(axis=1)]
    if not len(crossed):
        raise GeometryError("planarity: no camera sees any of the points.")
    middle = (crossed.max(axis=0) + crossed.min(axis=0)) / 2
    width = 2.0 * float(np.linalg.norm(crossed - middle, axis=1).max())
    if len({len(view.faces.surfaces) for view in views}) > 1:
        raise InputError("planarity: the cameras look through different numbers of faces.")
    results = []
    deviations = [_deviations(view.faces, middle, width, millimetre) for view in views]
    for alike in zip(*deviations, strict=True):
        kind, size, wavelength, _ = alike[0]
        variants = zip(*(faces for *_, faces in alike), strict=True)
        moved = [_moved(cameras, flat, views, faces, points) for faces in variants]
        shift = np.sqrt(np.nanmean(np.square(moved), axis=(0, 1)))
        if not np.isfinite(shift).all():
            raise GeometryError("planarity: no point is seen by two cameras.")
        largest = float(np.nanmax(np.linalg.norm(moved, axis=-1)))
        cost = float(np.linalg.norm(shift))
        allowed = size * expected / cost if cost > ROUNDING * width else np.inf
        results.append(
            Deviation(
                kind=kind, size=size, wavelength=wavelength, shift=tuple(shift.tolist()),
                largest=largest, allowed=allowed,
                left_out=int(np.isnan(moved).any(axis=-1).sum()),
            )
        )  # fmt: skip
    return tuple(results)


def _moved(
    cameras: Sequence[Camera],
    media: Sequence[FlatInterface],
    views: Sequence[_Local],
    faces: Sequence[tuple[RefractingSurface, ...]],
    points: FloatArray,
) -> FloatArray:
    """Return by how much points seem to lie elsewhere behind other faces, shape (n, 3)."""
    images = []
    for view, deviating in zip(views, faces, strict=True):
        bent = Interfaces(surfaces=deviating, indices=view.faces.indices)
        images.append(project(view.camera, view.points, bent))
    return intersect(cameras, np.stack(images), list(media)).xyz - points


def _deviations(
    faces: Interfaces, middle: FloatArray, width: float, millimetre: float
) -> Iterator[tuple[str, float, float, list[tuple[RefractingSurface, ...]]]]:
    """Yield kind, size, wavelength and the faces of each deviation."""
    planes = [surface for surface in faces.surfaces if isinstance(surface, Plane)]
    heights = [plane.middle for plane in planes]
    sag = SAG * millimetre
    # The sagitta of a sphere over a width: s = w^2 / 8 R.
    radius = width**2 / (8 * sag)
    centre = np.array([*middle, -radius])
    yield "bend", sag, np.nan, [tuple(Sphere(centre=centre, radius=radius + h) for h in heights)]
    if len(planes) > 1:
        tilted = [
            Plane(point=np.array([*middle, heights[-1]]), normal=np.array([*side, 1.0]))
            for side in (np.tan(WEDGE) * np.eye(2))
        ]
        yield "wedge", WEDGE, np.nan, [(*planes[:-1], plane) for plane in tilted]
    for share in WAVELENGTHS:
        wavelength = share * width
        waves = [
            WaveSurface.sinusoid(
                heights[-1], amplitude=SLOPE * wavelength / (2 * np.pi), wavelength=wavelength,
                direction=direction, phase=phase,
            )
            for direction in (0.0, np.pi / 2) for phase in (0.0, np.pi / 2)
        ]  # fmt: skip
        yield "waves", SLOPE, wavelength, [(*planes[:-1], wave) for wave in waves]
