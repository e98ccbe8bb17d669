"""Start values of a bundle adjustment: new points from their rays, plates from their points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multimedia.projects.model import Project
from photocore.arrays import FloatArray, IntArray
from photocore.errors import GeometryError

Pose = tuple[FloatArray, FloatArray]


def start_points(project: Project, ids: Sequence[str], points: FloatArray) -> FloatArray:
    """Return the points with unknown ones intersected from the cameras' start orientations.

    Raises
    ------
    GeometryError
        If the rays of a point do not meet beyond the interface from these starts.
    """
    wanted = [j for j, xyz in enumerate(points) if np.isnan(xyz).any()]
    if not wanted:
        return points
    names = [ids[j] for j in wanted]
    found = _intersected(project, names)
    lost = [name for name, xyz in zip(names, found, strict=True) if np.isnan(xyz).any()]
    if lost:
        raise GeometryError(
            f"adjust: from the start orientations the rays of {', '.join(lost[:8])} do not meet "
            "in the object's medium. Improve the orientations (`multimedia resect`), or check "
            "that these image points belong together."
        )
    filled = points.copy()
    filled[wanted] = found
    return filled


def start_poses(
    project: Project, plates: Sequence[str], ids: Sequence[str], plate_of: IntArray,
    local: FloatArray,
) -> tuple[Pose, ...]:  # fmt: skip
    """Return the pose of each plate that fits its intersected points best.

    Raises
    ------
    GeometryError
        If fewer than three points of a plate can be intersected.
    """
    poses = []
    for plate, label in enumerate(plates):
        on = np.flatnonzero(plate_of == plate)
        found = _intersected(project, [ids[int(j)] for j in on])
        good = np.isfinite(found).all(axis=1)
        if good.sum() < 3:
            raise GeometryError(
                f"adjust: plate {label}: only {int(good.sum())} of its points are seen by two "
                "cameras; at least 3 are needed for a start."
            )
        poses.append(rigid_motion(local[on][good], found[good]))
    return tuple(poses)


def rigid_motion(source: FloatArray, target: FloatArray) -> Pose:
    """Return rotation and shift that carry source onto target best (Kabsch), no scale.

    Examples
    --------
    >>> corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> rotation, shift = rigid_motion(corner, corner + [0, 0, 2])
    >>> shift.round(12).tolist()
    [0.0, 0.0, 2.0]
    """
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    left, _, right = np.linalg.svd((target - middle_target).T @ (source - middle_source))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ flip @ right
    return rotation, middle_target - rotation @ middle_source


def _intersected(project: Project, ids: Sequence[str]) -> FloatArray:
    """Return points intersected from the start orientations; NaN where that fails."""
    from multimedia.orientation.intersection import intersect

    image, _ = project.image_points.grid(project.camera_names, ids)
    return intersect(project.cameras, image, project.interfaces).xyz
