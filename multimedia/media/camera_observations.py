"""Known points seen by one camera: the network of resection, and of a change of lens model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimedia.media.camera import EXTERIOR, Camera
from multimedia.media.projection import Media, project_with_jacobian
from photocore.adjustment.network import Network, NetworkState, Rows
from photocore.arrays import FloatArray
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraObservations:
    """Points without error of their own, and where one camera sees them.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        [object unit]
    image : ndarray, shape (n, 2)
        [mm]
    media : Layers, FlatInterface, Interfaces or None
        As for `project`.
    sigma : ndarray, shape (n, 2)
        Standard deviations of the image coordinates. [mm]
    what : str
        What is adjusted, for messages.
    """

    points: FloatArray
    image: FloatArray
    media: Media
    sigma: FloatArray
    what: str

    @property
    def rounding(self) -> float:
        """Size of residuals that are nothing but rounding. [mm]"""
        return 2e-16 * float(np.abs(self.image).max(initial=0.0))

    def network(self, names: tuple[str, ...] = EXTERIOR) -> Network:
        """Return the network of a camera with these unknowns, of `Camera.stepped`."""
        columns = {name: column for column, name in enumerate(names)}

        def images(state: NetworkState, rows: Rows) -> bool:
            try:
                points = project_with_jacobian(
                    camera_of(state), self.points, self.media, camera_names=names
                )
            except GeometryError:
                return False
            lines = rows.add((points.image - self.image) / self.sigma)
            rows.by_label(
                lines[..., None], np.arange(len(names)), points.by_camera / self.sigma[..., None]
            )
            return bool(np.isfinite(points.image).all())

        columns_of = {"camera": {0: columns}}
        return Network(
            labels=names,
            columns=columns_of,
            terms=(images,),
            what=self.what,
            rounding=self.rounding,
        )


def start_at(camera: Camera) -> NetworkState:
    """Return the state of a network of `CameraObservations` with the camera as it is."""
    return NetworkState(blocks={"camera": {0: camera}})


def camera_of(state: NetworkState) -> Camera:
    """Return the camera of a state of a network of `CameraObservations`."""
    camera: Camera = state.blocks["camera"][0]
    return camera
