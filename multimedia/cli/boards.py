"""``multimedia boards``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from photocore.cli import print_result, progress_bar, text_table
from photocore.options import declared

if TYPE_CHECKING:
    from multimedia.boards.workflow import DetectedBoards


@declared
def command(
    project: Path, photos: tuple[Path, ...], out: Path, as_json: bool, **options: Any
) -> None:
    """Find a flat board in PHOTOS taken through the media and add its points to PROJECT (.toml).

    Each pose of the board becomes a group of object points in the board's own frame, which
    `multimedia adjust --plate all` takes as a rigid body of unknown pose. Photos without a board
    are named with the reason; fewer than three boards before a camera are refused.
    """
    from multimedia.boards.workflow import find_boards

    with progress_bar("Boards", quiet=as_json) as progress:
        found = find_boards(project, photos, out, progress=progress, **options)
    counts = _counts(found)
    data = {
        "file": out, "photos": len(photos), "found": len(found.views), "cameras": counts,
        "left_out": list(found.without), "adjust": found.next_command,
    }  # fmt: skip
    rows = [(name, boards, points) for name, (boards, points) in counts.items()]
    lines = [
        text_table(("camera", "boards", "points"), rows),
        f"Written: {out}\nNext: multimedia adjust {out} {found.next_command}",
    ]
    notes = [f"Left out: {line}" for line in found.without]
    print_result(data, lines, as_json=as_json, remarks=notes)


def _counts(found: DetectedBoards) -> dict[str, tuple[int, int]]:
    """Return boards and points of each camera."""
    return {
        name: (
            sum(each.camera == name for each in found.views),
            sum(len(each.view.pixels) for each in found.views if each.camera == name),
        )
        for name in found.project.camera_names
    }
