"""The frame of a wall in another program's project: found, given by points, or by control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from bifocal.model import Interior, Lens
from bifocal.orientation import (
    LINES,
    WALLS,
    facade_rotation,
    largest_plane,
    planes_of_any_direction,
)
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Pinhole, Similarity, rotation_from_vector
from photocore.errors import GeometryError, InputError
from photocore.images import read_grey
from photocore.programs import ForeignProject, ForeignView

#: A façade leans by no more against the upright: sine of the angle. What is flatter is ground.
UPRIGHT = 0.5
#: The project's Z is up only if its photos, on the average, do not say otherwise: cosine.
AGREES = 0.7
#: Cells a side of the points' extent; in each, points count as one.
CELLS = 60
#: Photos, the squarest ones, whose lines say what is upright.
MOST_PHOTOS = 5
#: Façades of a smaller share of the largest are none.
LEAST = 0.1
#: Walls whose normals part by less face alike: cosine.
ALIKE = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProjectWall:
    """A façade of a project.

    Attributes
    ----------
    frame : Similarity
        From the project's frame to that of the wall, at the project's scale.
    points : ndarray, shape (n, 3)
        Those of the project that lie on it.
    share : float
        Of what the project's points cover.
    """

    frame: Similarity
    points: FloatArray
    share: float

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, lower, right and upper edge of nearly all its points. [unit of the project]"""
        low, high = np.quantile(self.frame(self.points)[:, :2], (0.01, 0.99), axis=0).tolist()
        return (*low, *high)


def walls_of(project: ForeignProject, points: FloatArray) -> list[ProjectWall]:
    """Return the façades among points, the largest first.

    Raises
    ------
    InputError
        If there is none.
    """
    centres = np.array([view.centre for view in project.views])
    distances = cKDTree(centres).query(points)[0]
    distance = float(np.median(distances)) if len(points) else 0.0
    near = points[distances < 5 * distance]
    if len(near) < 20:
        raise InputError(remark("projects.few_points", count=len(points)))
    low, high = np.quantile(near, (0.02, 0.98), axis=0)
    cells = np.floor((near - low) / (np.max(high - low) / CELLS))
    _, place, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    middle = np.median(near, axis=0)
    planes = planes_of_any_direction(near - middle, 1.0 / count[place.ravel()], distance=distance)
    up = upwards(project)
    faces = [plane for plane in planes if abs(plane.normal @ up) < UPRIGHT]
    if not faces:
        raise InputError(remark("projects.no_facade"))
    faces.sort(key=lambda plane: -plane.share)
    walls = []
    for face in faces:
        if face.share < LEAST * faces[0].share:
            break
        frame = framed(project, face.normal, near[face.members])
        wall = frame(near)
        # A narrow face beats a vague heap: the same choice as for pairs.
        plane = largest_plane(wall[face.members], band=WALLS.face_band * distance)
        normal = frame.rotation.T @ [-plane[1], -plane[2], 1.0]
        raised = wall @ [-plane[1], -plane[2], 1.0] - plane[0]
        members = np.abs(raised) < WALLS.face_band * distance
        frame = framed(project, normal, near[members])
        walls.append(ProjectWall(frame=frame, points=near[members], share=face.share))
    return walls


def beside(first: Similarity, second: Similarity) -> Similarity:
    """Return the frame of another wall moved so that its X, Y run on from the first one's.

    About the corner where both meet, at the height of the first one's origin; of walls that face
    alike X, Y are those of the first one seen square.
    """
    place = first.source_centre
    if abs(first.rotation[2] @ second.rotation[2]) < ALIKE:
        rows = np.array([first.rotation[2], second.rotation[2], first.rotation[1]])
        heights = [one.rotation[2] @ one.source_centre for one in (first, second)]
        place = np.linalg.solve(rows, [*heights, first.rotation[1] @ place])
    move = (first(place) - second(place)) * [1.0, 1.0, 0.0]
    return replace(second, target_centre=second.target_centre + move)


def framed(
    project: ForeignProject, normal: FloatArray, points: FloatArray, level: FloatArray | None = None
) -> Similarity:
    """Return the frame of a plane at the project's scale: X right, Y up, Z towards the cameras.

    Parameters
    ----------
    project : ForeignProject
    normal : ndarray, shape (3,)
        Of the plane, on either side.
    points : ndarray, shape (n, 3)
        On it; their middle becomes the origin.
    level : ndarray, shape (2, 3), optional
        Two points on a level line.
    """
    origin = np.median(points, axis=0)
    origin = origin + normal * ((points.mean(axis=0) - origin) @ normal) / (normal @ normal)
    z = normal / np.linalg.norm(normal) * side(project.views, normal, origin)
    y = upwards(project)
    if level is not None:
        along = level[1] - level[0]
        y = np.cross(z, along) * np.sign(np.cross(z, along) @ y)
    x = np.cross(y, z)
    if np.linalg.norm(x) < 0.1:
        raise GeometryError(remark("projects.level_plane"))
    x /= np.linalg.norm(x)
    rotation = np.array([x, np.cross(z, x), z])
    return Similarity(scale=1.0, rotation=rotation, source_centre=origin, target_centre=np.zeros(3))


def side(views: Sequence[ForeignView], normal: FloatArray, origin: FloatArray) -> float:
    """Return on which side of a plane the cameras that look at it stand; near ones decide."""
    heights = np.array([normal @ (view.centre - origin) for view in views])
    looks = np.array([normal @ view.rotation[2] for view in views]) / np.linalg.norm(normal)
    weight = np.minimum(looks * np.sign(heights), 0.0) ** 2
    total = np.sum(weight * np.sign(heights) / np.maximum(heights**2, 1e-300))
    return 1.0 if total >= 0 else -1.0


def upwards(project: ForeignProject) -> FloatArray:
    """Return the direction that is up: the project's Z, or what the photos say on the average."""
    up = -np.mean([view.rotation[1] for view in project.views], axis=0)
    up /= max(float(np.linalg.norm(up)), 1e-12)
    place = np.mean([view.centre for view in project.views], axis=0)
    # Geocentric coordinates count from the middle of the Earth.
    stated = place / np.linalg.norm(place) if np.linalg.norm(place) > 5e6 else np.eye(3)[2]
    return np.asarray(stated if project.metres and stated @ up > AGREES else up)


def turned_by_lines(
    frame: Similarity, photos: Sequence[tuple[Pinhole, Lens, Path]]
) -> tuple[Similarity, list[str]]:
    """Return a frame turned so that the façade's lines in photos are upright and level.

    Parameters
    ----------
    frame : Similarity
    photos : sequence of (Pinhole, Lens, Path)
        Camera in that frame, lens and file of each.
    """
    square = sorted(photos, key=lambda photo: photo[0].rotation[2, 2])[:MOST_PHOTOS]
    turns = []
    for camera, lens, path in square:
        turn, share = facade_rotation(
            read_grey(path), camera, Interior.from_lens(lens, source=str(path))
        )
        if share >= LINES.least_in_line:
            turns.append(turn)
    if not turns:
        return frame, [remark("projects.no_lines")]
    turn = float(np.median(turns))
    axes = rotation_from_vector([0.0, 0.0, -turn]) @ frame.rotation
    note = remark("projects.turned", angle=np.rad2deg(turn), count=len(turns))
    return replace(frame, rotation=axes), [note]
