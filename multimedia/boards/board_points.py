"""Boards found in photos as rigid plates of a project: object points, image points, numbering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from multimedia.orientation import plate_pose
from multimedia.projects import ImagePoints, ObjectPoints, Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import BoardView
from photocore.errors import ConvergenceError, GeometryError, InputError


class PosedView(NamedTuple):
    """The board in one photo: camera, which pose of the board, and its points."""

    camera: str
    pose: str
    view: BoardView


def with_boards(
    project: Project, views: Sequence[PosedView], *, square: float, numbered: bool
) -> Project:
    """Return the project with the points of boards, one group of object points for each pose.

    Parameters
    ----------
    project : Project
        Its own points are kept.
    views : sequence of PosedView
        Each camera and pose once.
    square : float
        Side of a square, or distance of neighbouring circles. [object unit]
    numbered : bool
        Whether every point tells which it is (ChArUco). Otherwise the numbering of a board that
        several cameras see is turned until they agree where it lies.

    Raises
    ------
    InputError
        If points of these names exist.
    """
    cameras: list[str] = []
    ids: list[str] = []
    groups: list[str] = []
    image: list[FloatArray] = []
    objects: dict[str, tuple[str, FloatArray]] = {}
    for pose in dict.fromkeys(each.pose for each in views):
        same = [each for each in views if each.pose == pose]
        if len(same) > 1 and not numbered:
            same = _agreeing(project, same, square)
        for each in same:
            sensor = project.cameras[project.camera_index(each.camera)].sensor
            assert sensor is not None  # the workflow has looked
            names = [f"{pose} {x:g}-{y:g}" for x, y, _ in each.view.board.tolist()]
            objects |= {
                name: (pose, point * square)
                for name, point in zip(names, each.view.board, strict=True)
            }
            ids += names
            cameras += [each.camera] * len(names)
            groups += [pose] * len(names)
            image.append(sensor.image_from_pixel(each.view.pixels))
    points, picks = project.object_points, project.image_points
    repeated = {name.rpartition(" ")[0] for name in set(points.ids) & objects.keys()}
    if repeated:
        raise InputError(remark("boards.points_already", names=", ".join(sorted(repeated)[:8])))
    sigma = np.concatenate([points.sigma, np.full((len(objects), 3), np.nan)])
    places = np.array([point for _, point in objects.values()]).reshape(-1, 3)
    return replace(
        project,
        object_points=ObjectPoints(
            ids=(*points.ids, *objects), xyz=np.concatenate([points.xyz, places]), sigma=sigma,
            groups=(*points.groups, *(pose for pose, _ in objects.values())),
        ),
        image_points=ImagePoints(
            cameras=(*picks.cameras, *cameras), ids=(*picks.ids, *ids),
            image=np.concatenate([picks.image, *image]),
            sigma=np.concatenate([picks.sigma, np.full((len(ids), 2), np.nan)]),
            groups=(*picks.groups, *groups),
        ),
    )  # fmt: skip


def _agreeing(project: Project, views: list[PosedView], square: float) -> list[PosedView]:
    """Return the views of one pose with numberings that put the board in one place.

    A chessboard or a grid of circles looks the same when it is turned; half a turn, and on a square
    board a quarter too, changes only which corner is called the first.
    """
    first = _world(project, views[0], square)
    agreed = views[:1]
    for each in views[1:]:
        choices = _turned(each)
        misses = [
            float(np.linalg.norm(_by_place(_world(project, c, square), c, views[0]) - first))
            for c in choices
        ]
        agreed.append(choices[int(np.argmin(misses))])
    return agreed


def _turned(each: PosedView) -> list[PosedView]:
    """Return the view with its points numbered from every corner that might be the first.

    Turned, an asymmetric grid of an odd number of rows is another one, and has but one first.
    """
    board = each.view.board
    size = board.max(axis=0)
    choices = [board, size - board]
    if size[0] == size[1]:
        quarter = np.column_stack([size[0] - board[:, 1], board[:, 0], board[:, 2]])
        choices += [quarter, size - quarter]
    places = set(map(tuple, board.tolist()))
    alike = [choice for choice in choices if set(map(tuple, choice.tolist())) == places]
    return [each._replace(view=replace(each.view, board=choice)) for choice in alike]


def _by_place(world: FloatArray, each: PosedView, like: PosedView) -> FloatArray:
    """Return points of a view in the order in which another has them."""
    place = {tuple(point): k for k, point in enumerate(each.view.board.tolist())}
    return world[[place[tuple(point)] for point in like.view.board.tolist()]]


def _world(project: Project, each: PosedView, square: float) -> FloatArray:
    """Return where the board of a view lies in the world.

    Raises
    ------
    InputError
        If the photo gives no pose.
    """
    k = project.camera_index(each.camera)
    camera, local = project.cameras[k], each.view.board * square
    assert camera.sensor is not None  # the workflow has looked
    image = camera.sensor.image_from_pixel(each.view.pixels)
    try:
        rotation, shift = plate_pose(camera, local, image, project.interface_of(k))
    except (GeometryError, ConvergenceError) as error:
        raise InputError(f"{each.view.name}: the board gives no pose: {error}") from None
    return local @ rotation.T + shift
