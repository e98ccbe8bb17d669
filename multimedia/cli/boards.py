"""``multimedia boards``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, progress_bar, text_table
from photocore.option_types import POSITIVE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import BoardOption, JsonOption, OverwriteOption, PatternOption

if TYPE_CHECKING:
    from multimedia.boards import DetectedBoards


@dataclass(frozen=True, kw_only=True)
class BoardsCommand:
    """The options of ``multimedia boards``, and examples.

    multimedia boards housing.toml dive*.png --board 9x6 --square 24 --out boards.toml
    multimedia adjust boards.toml --plate all --fix-camera cam1 --interior c,xh,yh,k1
               --media index3,offset --out calibrated.toml --report calibrated.html

    The photos of several cameras are told apart by their names (left_003.png) or folders
    (left/003.png); 003 is then the pose of the board that they share.
    """

    project: ProjectOption
    photos: Annotated[tuple[Path, ...], Argument()]
    pattern: PatternOption = "chessboard"
    board: BoardOption
    square: Annotated[float, Typed(POSITIVE, "L")]
    """Side of a square, or distance of neighbouring circles [object unit]."""
    out: Path
    """Project with the points (.toml)."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(BoardsCommand)
def command(options: BoardsCommand) -> None:
    """Find a flat board in PHOTOS taken through the media and add its points to PROJECT (.toml).

    Each pose of the board becomes a group of object points in the board's own frame, which
    `multimedia adjust --plate all` takes as a rigid body of unknown pose. Photos without a board
    are named with the reason; fewer than three boards before a camera are refused.
    """
    from multimedia.boards import find_boards

    with progress_bar("Boards", quiet=options.as_json) as progress:
        found = find_boards(
            options.project,
            options.photos,
            options.out,
            progress=progress,
            pattern=options.pattern,
            board=options.board,
            square=options.square,
            overwrite=options.overwrite,
        )
    counts = _counts(found)
    data = {
        "file": options.out, "photos": len(options.photos), "found": len(found.views),
        "cameras": counts, "layouts": found.layouts, "left_out": list(found.without),
        "adjust": found.next_command,
    }  # fmt: skip
    rows = [(name, boards, points) for name, (boards, points) in counts.items()]
    lines = [
        text_table(("camera", "boards", "points"), rows),
        *(f"{count} photos show ChArUco {name}" for name, count in found.layouts.items()),
        f"Written: {options.out}\nNext: multimedia adjust {options.out} {found.next_command}",
    ]
    notes = [f"Left out: {line}" for line in found.without]
    print_result(data, lines, as_json=options.as_json, remarks=notes)


def _counts(boards: DetectedBoards) -> dict[str, tuple[int, int]]:
    """Return boards and points of each camera."""
    return {
        name: (
            sum(each.camera == name for each in boards.views),
            sum(len(each.view.pixels) for each in boards.views if each.camera == name),
        )
        for name in boards.project.camera_names
    }
