"""Project and photos of a board in, project with the board's points out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from multimedia.boards.board_points import PosedView, with_boards
from multimedia.media import Sensor
from multimedia.projects import Project, project_files, read_photo, read_project, write_project
from multimedia.remarks import remark
from photocore.arrays import ByteArray, positive
from photocore.camera import BoardView, checked_board, detect_board, find_board_size, seen_markers
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import check_ending, check_not_input, check_writable

#: Fewer boards before one camera say nothing of its lens and its window.
FEWEST = 3
#: Photos whose grey values spread less than this show nothing.
_FLAT = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectedBoards:
    """What was found.

    Attributes
    ----------
    project : Project
        With the points of the boards.
    views : tuple of PosedView
        The board as each photo shows it.
    without : tuple of str
        Photos left out, and why.
    """

    project: Project
    views: tuple[PosedView, ...]
    without: tuple[str, ...]

    @property
    def layouts(self) -> dict[str, int]:
        """How many photos show a ChArUco board of each dictionary and layout."""
        return dict(Counter(each.view.layout for each in self.views if each.view.layout))

    @property
    def next_command(self) -> str:
        """Options of `multimedia adjust` that suit: a fixed camera, or a free network."""
        project = self.project
        still = [m for m in project.interfaces if m is not None and not _moves(m)]
        datum = "--control free" if still else f"--fix-camera {project.camera_names[0]}"
        media = " --media index3,offset" if any(project.media_of) else ""
        return f"--plate all {datum} --interior c,xh,yh,k1{media}"


def find_boards(
    source: Path,
    photos: Sequence[Path],
    out: Path,
    *,
    pattern: str,
    board: tuple[int, int],
    square: float,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> DetectedBoards:
    """Find a board in photos and write the project with its points.

    Parameters
    ----------
    source : path
        Project file with cameras, their sensors, and the media.
    photos : sequence of path
        Of one camera: any names. Of several: the name of the camera begins the file's name
        (``left_003.png``) or is that of its folder (``left/003.png``); what remains names the pose
        of the board, which photos of other cameras at that moment share.
    out : path
        The project with the board's points: one group of object points for each pose.
    pattern : str
        One of `photocore.camera.boards.PATTERNS`.
    board : (int, int)
        Inner corners, circles, or squares (ChArUco) across and up.
    square : float
        Side of a square, distance of neighbouring circles; of an asymmetric grid half the
        distance of circles in a row, as in OpenCV. [object unit]

    Raises
    ------
    InputError
        If boards are found in fewer than three photos of a camera: each photo with its reason.
    """
    check_ending(out, "a project is written as .toml.", ".toml")
    check_not_input(out, *project_files(source), *photos)
    check_writable(out, overwrite=overwrite)
    checked_board(pattern, board)
    positive(square, "--square")
    project = read_project(source, posed=False)
    places = [_camera_and_pose(project, photo) for photo in photos]
    _refuse_repeated(places, photos)
    views: list[PosedView] = []
    without: list[str] = []
    for k, (photo, (camera, pose)) in enumerate(zip(photos, places, strict=True)):
        progress(k, len(photos), photo.name)
        sensor = project.cameras[project.camera_index(camera)].described_sensor()
        view = _view(photo, sensor, camera, pattern=pattern, board=board)
        if isinstance(view, str):
            without.append(f"{photo.name}: {view}")
        else:
            views.append(PosedView(camera, pose, view))
    progress(len(photos), len(photos))
    for camera in dict.fromkeys(camera for camera, _ in places):
        count = sum(each.camera == camera for each in views)
        if count < FEWEST:
            reasons = "".join(f"\n  {line}" for line in without)
            raise InputError(
                f"camera {camera}: the board was found in {count} photo(s), at least {FEWEST} are "
                f"needed, better ten, tilted differently and in every corner.{reasons}"
            )
    project = with_boards(project, views, square=square, numbered=pattern == "charuco")
    write_project(out, project, overwrite=overwrite)
    return DetectedBoards(project=project, views=tuple(views), without=tuple(without))


def _camera_and_pose(project: Project, photo: Path) -> tuple[str, str]:
    """Return the camera that took a photo, and the name of the board's pose in it.

    Raises
    ------
    InputError
        If no camera's name begins the file's name or is that of its folder.
    """
    names = project.camera_names
    if len(names) == 1:
        return names[0], photo.stem
    for name in sorted(names, key=len, reverse=True):  # cam10 before cam1
        rest = photo.stem[len(name) :]
        if photo.stem.startswith(name) and not (name[-1:].isdigit() and rest[:1].isdigit()):
            return name, rest.strip(" _-.") or "1"
    if photo.absolute().parent.name in names:
        return photo.absolute().parent.name, photo.stem
    raise InputError(remark("boards.which_camera", of=photo, names=", ".join(names)))


def _refuse_repeated(places: Sequence[tuple[str, str]], photos: Sequence[Path]) -> None:
    """Refuse two photos of one camera and pose."""
    first: dict[tuple[str, str], Path] = {}
    for place, photo in zip(places, photos, strict=True):
        if place in first:
            raise InputError(
                f"{photo} and {first[place]} are both of camera {place[0]}, pose {place[1]}; give "
                "each moment a name of its own."
            )
        first[place] = photo


def _view(
    photo: Path, sensor: Sensor, camera: str, *, pattern: str, board: tuple[int, int]
) -> BoardView | str:
    """Return the board in a photo, or why there is none."""
    grey = read_photo(photo)
    height, width = grey.shape
    if (width, height) != (sensor.width, sensor.height):
        return (
            f"is {width} x {height} px, the sensor of camera {camera} "
            f"{sensor.width} x {sensor.height} px"
        )
    view = detect_board(grey, photo.name, pattern=pattern, size=board)
    return view if view is not None else _why_not(grey, pattern, board)


def _why_not(grey: ByteArray, pattern: str, board: tuple[int, int]) -> str:
    """Return why no board was found, as far as the photo shows it."""
    if float(grey.std()) < _FLAT:
        return f"is of one grey ({grey.mean():.0f} of 255): too dark, too bright or too turbid"
    if pattern == "chessboard":
        try:
            columns, rows = find_board_size([grey])
        except InputError:
            columns = rows = 0
        if columns and {columns, rows} != set(board):
            return (
                f"shows {columns}x{rows} inner corners, not {board[0]}x{board[1]}: another board, "
                "or part of it is hidden"
            )
    if pattern == "charuco":
        most = max(seen_markers(grey, board[0] * board[1]), key=lambda m: len(m[2]), default=None)
        if most is not None:
            low, high = most.numbers.min(), most.numbers.max()
            return remark(
                "boards.other_charuco", count=len(most.numbers), dictionary=most.dictionary,
                low=low, high=high, columns=board[0], rows=board[1],
            )  # fmt: skip
    least = "at least six corners of it" if pattern == "charuco" else "all of it"
    return f"shows no {pattern} of {board[0]}x{board[1]}; {least} must be seen, sharp"


def _moves(media: object) -> bool:
    """Whether media move with the camera."""
    stated = getattr(media, "moves_with_camera", None)
    return bool(stated if stated is not None else all(getattr(media, "with_camera", ())))
