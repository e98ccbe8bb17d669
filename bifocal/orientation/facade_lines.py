"""The façade's own lines: its uprights and levels turn the frame, and feed the cameras' tilt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model import Cameras, Images, Interior, Interiors, apply_homography
from bifocal.orientation.tuning import LINES
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray
from photocore.camera import (
    Pinhole,
    RadialDivision,
    nearest_rotation,
    plane_from_pixel,
    rotation_from_vector,
)
from photocore.errors import GeometryError

#: How far the lines of a façade as a whole come out of its wall. On two real pairs (church_1,
#: church_2) eight directions came out 0.03 to 0.27 degrees off, 0.2 in the root mean square, where
#: their own scatter says 0.05: sills and cornices are not level, and some belong to other faces.
#: Not used to find it: 0.27 on a third church (semireal_church), 0.06 on six renderings. [rad]
BUILT = np.deg2rad(0.2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FacadeDirection:
    """The common direction of upright or level lines in one photo.

    Attributes
    ----------
    camera : int
        1 or 2.
    name : str
        ``upright`` or ``level``.
    direction : ndarray, shape (3,)
        Unit vector in the camera's axes, x right, y down, z along the view.
    sigma : float
        Precision of its angle to the wall: its lines' scatter from part to part of the photo, and
        what façades are built to. Both photos show the same lines and most of it is common: each
        counts for less, by a root of 2. [rad]
    count : int
        Lines that agree on it.
    """

    camera: int
    name: str
    direction: FloatArray
    sigma: float
    count: int

    def in_frame(self, camera: Pinhole) -> FloatArray:
        """Return the direction in the plane frame; its Z is zero where it lies along the wall."""
        return np.asarray(camera.rotation.T @ self.direction)


def line_segments(image: ByteArray) -> FloatArray:
    """Return both ends of straight edges of a grey photo, shape (n, 2, 2). [px]"""
    reduction = max(1.0, float(np.sqrt(image.size / LINES.searched)))
    size = (round(image.shape[1] / reduction), round(image.shape[0] / reduction))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    lines = cv2.createLineSegmentDetector().detect(small)[0]
    if lines is None:
        return np.zeros((0, 2, 2))
    ends = np.asarray(lines, dtype=np.float64).reshape(-1, 2, 2)
    return np.asarray((ends + 0.5) * reduction - 0.5)


def facade_rotation(image: ByteArray, camera: Pinhole, interior: Interior) -> tuple[float, float]:
    """Return the turn that makes the façade's lines upright and level, and their agreement.

    Parameters
    ----------
    image : ndarray, shape (h, w)
    camera : Pinhole
    interior : Interior

    Returns
    -------
    turn : float
        Counter-clockwise turn to apply to the plane frame's axes. [rad]
    share : float
        Share of line length within 1° of it or of its perpendicular; below `least_in_line`
        trust nothing.
    """
    ends_ideal = interior.ideal(line_segments(image).reshape(-1, 2))
    ends: FloatArray = apply_homography(plane_from_pixel(camera), ends_ideal).reshape(-1, 2, 2)
    reach = 6 * camera.centre[2]
    ends = ends[(np.linalg.norm(ends - camera.centre[:2], axis=2) < reach).all(axis=1)]
    along = ends[:, 1] - ends[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    degrees = (np.rad2deg(np.arctan2(along[:, 1], along[:, 0])) + 45.0) % 90.0 - 45.0
    near = (np.abs(degrees) < LINES.widest) & (length > 0.01 * camera.centre[2])
    degrees, weight = degrees[near], length[near] ** 1.5
    if len(degrees) < 20:
        return 0.0, 0.0
    trial = np.arange(-LINES.widest, LINES.widest, 0.05)
    votes = np.exp(-0.5 * ((trial[:, None] - degrees) / 0.4) ** 2) @ weight
    best = trial[votes.argmax()]
    for _ in range(3):
        close = np.abs(degrees - best) < 1.0
        best = float(np.average(degrees[close], weights=weight[close]))
    return float(np.deg2rad(best)), float(weight[close].sum() / weight.sum())


def lines_of_photos(
    images: Images, cameras: Cameras, interiors: Interiors, radial: Sequence[RadialDivision]
) -> list[FacadeDirection]:
    """Return the directions of upright and level lines of both photos; none if it is no façade.

    Parameters
    ----------
    images, cameras, interiors : pairs
    radial : pair of RadialDivision
        Distortions on top of the lenses'.
    """
    turn, share = facade_rotation(images[0], cameras[0], interiors[0])
    if share < LINES.least_in_line:
        return []
    ends = map(line_segments, images)
    parts = zip(ends, cameras, interiors, radial, (turn, turn), (1, 2), strict=True)
    return [line for part in parts for line in facade_directions(*part)]


def facing_wall(image: ByteArray, interior: Interior) -> tuple[FloatArray, list[FacadeDirection]]:
    """Return which way a camera looks that sees a façade's upright and level lines, and these.

    Parameters
    ----------
    image : ndarray, shape (h, w)
    interior : Interior

    Returns
    -------
    rotation : ndarray, shape (3, 3)
        Camera from plane frame, X along the level lines, Y along the upright ones.
    lines : list of FacadeDirection
        One of each.

    Raises
    ------
    GeometryError
        If there are too few of either.
    """
    ends, straight = line_segments(image), interior.radial(0.0)
    turn = np.diag([1.0, -1.0, -1.0])  # facing the wall, the photo's rows downwards

    def seen(turn: FloatArray) -> dict[str, FacadeDirection]:
        camera = Pinhole(interior.matrix, turn, np.array([0.0, 0.0, 1.0]))
        return {line.name: line for line in facade_directions(ends, camera, interior, straight)}

    # What is upright tells how far the camera looks up; then what is level, how far to the side.
    for name, axis in (("upright", 0), ("level", 1)):
        tried = [
            turn @ rotation_from_vector(np.deg2rad(angle) * np.eye(3)[axis])
            for angle in np.arange(-LINES.turned, LINES.turned + 0.1, LINES.tried)
        ]
        counts = [line.count if (line := seen(one).get(name)) else 0 for one in tried]
        turn = tried[int(np.argmax(counts))]
    for _ in range(3):
        lines = seen(turn)
        if len(lines) < 2:
            raise GeometryError(remark("rectify.few_lines", fewest=LINES.fewest))
        across, up = lines["level"].direction, lines["upright"].direction
        turn = nearest_rotation(np.column_stack([across, up, np.cross(across, up)]))
    return turn, list(lines.values())


def contradiction_in_words(line: FacadeDirection, cameras: Cameras, test: float) -> str:
    """Return what to say of lines that come out of the wall by so many standard deviations."""
    away = np.rad2deg(np.arcsin(abs(line.in_frame(cameras[line.camera - 1])[2])))
    about = {"lines": line.name, "photo": "far" if line.camera == 1 else "near"}
    return remark("orientation.lines_contradict", angle=away, sigmas=test, **about)


def family_in_words(lines: Sequence[FacadeDirection], cameras: Cameras) -> str:
    """Return what to say of lines of one direction that are not used: the ties know better."""
    away = [abs(line.in_frame(cameras[line.camera - 1])[2]) for line in lines]
    angle = np.rad2deg(np.arcsin(np.mean(away)))
    return remark("orientation.lines_dropped", lines=lines[0].name, angle=angle)


def facade_directions(
    ends: FloatArray,
    camera: Pinhole,
    interior: Interior,
    radial: RadialDivision,
    turn: float = 0.0,
    number: int = 1,
) -> list[FacadeDirection]:
    """Return the directions of a photo's upright and level lines, those that can be told.

    Parameters
    ----------
    ends : ndarray, shape (n, 2, 2)
        Of its `line_segments`. [px]
    camera : Pinhole
        In a frame on the wall, tilted against it by a few degrees at most.
    interior : Interior
    radial : RadialDivision
        Distortion on top of the lens's.
    turn : float
        From `facade_rotation`: how far the façade's axes are turned against the frame's. [rad]
    number : int
        1 or 2, of the camera.

    Notes
    -----
    A line and the projection centre span a plane of normal m; all lines of one direction v satisfy
    m . v = 0. Of ``v = (0, 1, 0) + (u, 0, w)`` (uprights; levels alike) u and w are found by a vote
    and then by least squares in which lines that do not agree count nothing.
    """
    size = interior.image_size
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > LINES.shortest * size[0]]
    part = np.floor(ends.mean(axis=1) / size * LINES.parts) @ [LINES.parts, 1]
    straight = radial.undistort(interior.ideal(ends.reshape(-1, 2)))
    flat = np.column_stack([straight, np.ones(len(straight))])
    cosine, sine = np.cos(turn), np.sin(turn)
    axes = (
        np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]) @ camera.rotation.T
    )
    rays = (flat @ np.linalg.inv(camera.matrix).T @ axes.T).reshape(-1, 2, 3)
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    normals = np.cross(rays[:, 0], rays[:, 1])
    length = np.linalg.norm(normals, axis=1)
    some = length > 0
    normals, part, length = normals[some] / length[some, None], part[some], length[some]
    out = []
    for name, axis in (("upright", 1), ("level", 0)):
        near = np.abs(normals[:, axis]) < np.sin(np.deg2rad(LINES.astray))
        direction, scatter, count = _common_direction(normals[near], length[near], part[near], axis)
        if count >= LINES.fewest:
            sigma = float(np.sqrt(2.0) * np.hypot(BUILT, scatter))
            out.append(
                FacadeDirection(
                    camera=number, name=name, direction=axes.T @ direction, sigma=sigma, count=count
                )
            )
    return out


def _common_direction(
    normals: FloatArray, length: FloatArray, part: FloatArray, axis: int
) -> tuple[FloatArray, float, int]:
    """Return the unit direction near an axis on which most lines agree, and how many do.

    Parameters
    ----------
    normals : ndarray, shape (n, 3)
    length : ndarray, shape (n,)
        Weights.
    part : ndarray, shape (n,)
        Which part of the photo each lies in.
    axis : int

    Returns
    -------
    direction : ndarray, shape (3,)
    scatter : float
        Standard deviation of its angle to the wall, from the parts' contributions to the normal
        equations (the cluster-robust covariance of Liang and Zeger, 1986). [rad]
    count : int
    """
    direction = np.eye(3)[axis]
    if len(normals) < LINES.fewest:
        return direction, np.inf, 0
    fixed, free = normals[:, axis], normals[:, [1 - axis, 2]]
    steps = np.deg2rad(np.arange(-LINES.tried, LINES.tried + 0.01, 0.5))
    trials = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    away = fixed[:, None] + free @ trials.T
    votes = length @ np.exp(-0.5 * (away / np.deg2rad(0.4)) ** 2)
    angles = trials[int(votes.argmax())]
    for width in np.deg2rad(
        [2.4 * LINES.agree, 1.6 * LINES.agree, LINES.agree, LINES.agree, LINES.agree]
    ):
        rest = fixed + free @ angles
        weight = length / (1.0 + (rest / width) ** 2) ** 2 * (np.abs(rest) < 3 * width)
        normal = (free * weight[:, None]).T @ free + 1e-12 * np.eye(2)
        angles = angles - np.linalg.solve(normal, (free * weight[:, None]).T @ rest)
    which = np.unique(part[weight > 0], return_inverse=True)[1]
    pulls = (free * (weight * rest)[:, None])[weight > 0]
    parts = np.stack([np.bincount(which, pull) for pull in pulls.T], axis=1)
    count = len(parts)
    inverse = np.linalg.inv(normal)
    spread = inverse @ (parts.T @ parts) @ inverse * count / max(count - 1, 1)
    direction = direction.copy()
    direction[[1 - axis, 2]] = angles
    agree = np.abs(fixed + free @ angles) < np.deg2rad(2 * LINES.agree)
    unit = direction / np.linalg.norm(direction)
    return unit, float(np.sqrt(spread[1, 1])), int(agree.sum())
