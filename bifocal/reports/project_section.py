"""What a report says of the survey as a project, and of how its files were made."""

from __future__ import annotations

from collections.abc import Iterator

from bifocal.files import photo_infos
from bifocal.options import PROJECT
from bifocal.reports.content import PairContent
from photocore.reports import Block, Heading, Paragraph, TextTable, Words


def project_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield the data of the project; nothing where none were given."""
    entries = [
        (name, content.task.project[name]) for name in PROJECT if name in content.task.project
    ]
    rows = [[say(name), str(text)] for name, text in entries if name != "times"]
    if rows:
        yield TextTable(headings=[say("project"), ""], rows=rows)


def camera_rows(content: PairContent, say: Words) -> Iterator[list[str]]:
    """Yield what the photos say of the cameras that took them."""
    if not content.photos:
        return
    infos = photo_infos(content.of_set or content.pair)
    yield [say("image_size"), *("{} × {} px".format(*info.size) for info in infos)]
    cameras = [f"{info.make} {info.model}".strip() for info in infos]
    if any(cameras):
        yield [say("camera"), *(camera or "-" for camera in cameras)]
    if any(info.focal_length for info in infos):
        lenses = [f"{info.focal_length:g} mm" if info.focal_length else "-" for info in infos]
        yield [say("focal_exif"), *lenses]


def processing_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield each step with its settings, what held by default, and its time where that is told."""
    steps = content.task.steps
    if not steps:
        return
    yield Heading(text=say("processing"))
    timed = any(step.seconds is not None for step in steps)
    rows = []
    for step in steps:
        settings = ", ".join(step.settings) or "-"
        time = [] if not timed else [_seconds(step.seconds)]
        rows.append([say(f"made_{step.name}"), settings, ", ".join(step.defaults), *time])
    if timed:
        total = sum(step.seconds or 0.0 for step in steps)
        rows.append([say("total"), "", "", _seconds(total)])
    headings = [say("step"), say("settings"), say("defaults")] + ([say("time")] if timed else [])
    yield TextTable(headings=headings, rows=rows)
    for machine in dict.fromkeys(step.machine for step in steps if step.machine):
        yield Paragraph(text=say("machine", machine=machine), small=True)


def _seconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds:.1f} s"
