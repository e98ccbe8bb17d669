"""What may lie between a camera and the object: one protocol for all that projects through it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multimedia.media.camera import Camera
from photocore.arrays import FloatArray
from photocore.camera import by_rotation
from photocore.errors import InputError


class SightDerivatives(NamedTuple):
    """Derivatives of image coordinates; by exterior orientation in the order of `EXTERIOR`."""

    by_point: FloatArray  # (n, 2, 3)
    by_exterior: FloatArray  # (n, 2, 6), with respect to centre and small rotation vector
    by_media: FloatArray  # (n, 2, m), with respect to the parameters asked for


class Sight(NamedTuple):
    """Directions in which points are seen, and what follows for their images.

    Attributes
    ----------
    vectors : ndarray, shape (n, 3)
        In the camera frame and the camera's medium, of any length.
    derivatives : callable
        From the derivatives of the image by those vectors, (n, 2, 3), to those by everything else.
    """

    vectors: FloatArray
    derivatives: Callable[[FloatArray], SightDerivatives]


class OpticalMedia(ABC):
    """Media between one camera and the object, placed in the world or before the camera."""

    __slots__ = ()

    @property
    @abstractmethod
    def indices(self) -> tuple[float, ...]:
        """Refractive indices from the camera's medium to the object's."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of everything that an adjustment may estimate; none unless a subclass says so."""
        return ()

    def value(self, name: str) -> float:
        """Return the value of a parameter."""
        raise InputError(f"interface parameter {name}: these media have none to estimate.")

    def stepped(self, names: Sequence[str], step: ArrayLike) -> Self:  # noqa: ARG002
        """Return the media after adding ``step`` to the named parameters."""
        if names:
            raise InputError(f"interface parameter {names[0]}: these media have none to estimate.")
        return self

    @property
    def curves_in_object(self) -> bool:
        """Whether rays are curved in the object's medium itself; not unless a subclass says so."""
        return False

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is odd about the media, in words; nothing unless a subclass says so."""
        return ()

    def apparent_vectors(self, camera: Camera, points: FloatArray) -> FloatArray:
        """Return where points seem to be: vectors in the camera frame, (n, 3); NaN if unseen."""
        return self.seen(camera, points)[0]

    def mirror_normal(self, points: FloatArray) -> FloatArray:
        """Return a unit vector along which to mirror points so that they stay in their medium.

        Where nothing is known of the faces, the direction in which the points spread most.
        """
        normal: FloatArray = np.linalg.svd(points - points.mean(axis=0))[2][0]
        return normal

    def seen_from_afar(self, points: FloatArray) -> FloatArray | None:  # noqa: ARG002
        """Return where points seem to be to any camera far away, (n, 3); None where that varies."""
        return None

    @abstractmethod
    def seen(self, camera: Camera, points: FloatArray) -> tuple[FloatArray, NDArray[np.object_]]:
        """Return `apparent_vectors`, and for each point why it is not seen; empty if it is."""

    @abstractmethod
    def sight(
        self, camera: Camera, points: FloatArray, *, exterior: bool, names: Sequence[str] = (),
        before: float = 0.0,
    ) -> Sight:  # fmt: skip
        """Return the directions with derivatives.

        Parameters
        ----------
        camera : Camera
            From where.
        points : ndarray, shape (n, 3)
            To where, in the world.
        exterior : bool
            Whether the derivatives by the exterior orientation are wanted.
        names : sequence of str
            Parameters of the media by which to differentiate.
        before : float
            Share of the camera's height above flat faces by which points may lie before the last
            one, as on the way of an adjustment: as if their rays went back from it in the
            object's medium. Other media have nothing there (NaN).
        """

    @abstractmethod
    def object_rays(self, camera: Camera, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Follow directions of the camera frame, (n, 3), into the object's medium.

        Returns
        -------
        origins, directions : ndarray, shape (n, 3)
            In the world; unit vectors, NaN where a ray does not get there.
        """


class StraightRays(OpticalMedia):
    """Nothing between camera and object, or one medium for both."""

    __slots__ = ()

    @property
    def indices(self) -> tuple[float, ...]:
        """One medium."""
        return (1.0,)

    def apparent_vectors(self, camera: Camera, points: FloatArray) -> FloatArray:
        """Return the vectors to the points themselves."""
        return camera.vectors_to(points)

    def seen(self, camera: Camera, points: FloatArray) -> tuple[FloatArray, NDArray[np.object_]]:
        """Return the vectors; nothing is in the way."""
        return self.apparent_vectors(camera, points), np.full(len(points), "", dtype=object)

    def sight(
        self, camera: Camera, points: FloatArray, *, exterior: bool, names: Sequence[str] = (),
        before: float = 0.0,  # noqa: ARG002
    ) -> Sight:  # fmt: skip
        """Return the vectors with derivatives.

        Raises
        ------
        InputError
            If derivatives by parameters of media are asked for.
        """
        if names:
            raise InputError("interface parameters: there is no interface to differentiate by.")
        vectors = self.apparent_vectors(camera, points)

        def derivatives(by_seen: FloatArray) -> SightDerivatives:
            by_point, by_exterior = by_pose(
                camera, by_seen, (by_seen, vectors) if exterior else None
            )
            return SightDerivatives(by_point, by_exterior, np.empty((len(points), 2, 0)))

        return Sight(vectors, derivatives)

    def object_rays(self, camera: Camera, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the projection centre and the directions."""
        rays = directions @ camera.rotation.T
        rays /= np.sqrt((rays * rays).sum(-1, keepdims=True))
        return np.broadcast_to(camera.centre, rays.shape).copy(), rays


def by_pose(
    camera: Camera, by_vector: FloatArray, turning: tuple[FloatArray, FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives by the point in the world and by centre and rotation of the camera.

    Parameters
    ----------
    camera : Camera
        The camera.
    by_vector : ndarray, shape (n, 2, 3)
        Derivatives by the vector to the point in the camera frame.
    turning : (ndarray, ndarray) or None
        Derivatives by the vectors that turn with the camera, (n, 2, 3), and those vectors, (n, 3);
        without them the exterior orientation is left out, shape (n, 2, 0).
    """
    by_point = (by_vector.reshape(-1, 3) @ camera.rotation.T).reshape(-1, 2, 3)
    if turning is None:
        return by_point, np.empty((len(by_point), 2, 0))
    # Turning the camera by a small vector v of the world: R^T d changes by R^T (d x v), as
    # turning -d by v would; then v back from the camera frame to the world.
    turned, vectors = turning
    by_vector = by_rotation(turned, -vectors) @ camera.rotation.T
    return by_point, np.concatenate([-by_point, by_vector], axis=-1)
