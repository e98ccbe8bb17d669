"""What an empty page offers: the sample, and surveys that were open before."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from bifocal.collimation.project import SurveyFiles
from bifocal.collimation.session import Session
from bifocal.demo import SAMPLE
from bifocal.remarks import remark
from photocore.errors import InputError, PhotogrammetryError
from photocore.jsonfile import read_object, write_object
from photocore.output import free_path

#: Surveys that are remembered.
MOST = 8
#: Where, in the user's own folder.
RECENT = Path(".bifocal") / "recent.json"


def open_sample(session: Session) -> None:
    """Begin with the sample pair that ships with the program, oriented.

    Raises
    ------
    InputError
        If picks were made already.
    """
    with session.lock:
        session.check_new_photos()
        folder = session.files.folder
        copies = []
        for name in ("far.jpg", "near.jpg"):
            target = free_path(folder, Path(name).stem, Path(name).suffix)
            target.write_bytes((SAMPLE / name).read_bytes())
            copies.append(target)
        data = read_object(SAMPLE / "facade.pair.json", what="pair file")
        for number, copy in enumerate(copies, start=1):
            data[f"image{number}"]["file"] = copy.name
        pair = session.products.place("pair", ".pair.json")
        write_object(pair, data, overwrite=session.products.is_own(pair), as_is=True)
        session.give_photos(copies)
        session.note_made("pair", [pair.name])
        session.use_pair(pair)
        session.changed()


def remember(files: SurveyFiles, home: Path | None = None) -> None:
    """Remember a survey among those that were open; that it cannot be is no fault of the survey."""
    path = (home or Path.home()) / RECENT
    place = str(files.workbook.resolve())
    names = [place, *(name for name in recent(home) if name != place)][:MOST]
    try:
        path.parent.mkdir(exist_ok=True)
        write_object(path, {"surveys": names}, overwrite=True)
    except (OSError, PhotogrammetryError):
        return


def recent(home: Path | None = None) -> list[str]:
    """Return the workbooks of surveys that were open and whose journals are still there."""
    path = (home or Path.home()) / RECENT
    try:
        names = read_object(path, what="list of surveys").get("surveys", [])
    except PhotogrammetryError:
        return []
    kept = [Path(name) for name in names if isinstance(name, str)]
    return [str(p) for p in kept if p.with_name(f"{p.stem}.journal.jsonl").is_file()][:MOST]


def reopen(number: int, home: Path | None = None) -> str:
    """Open a page of a remembered survey beside this one, and return its address.

    Raises
    ------
    InputError
        If there is none of this number, or it cannot be opened.
    """
    names = recent(home)
    if not 0 <= number < len(names):
        raise InputError(remark("page.no_recent"))
    book = Path(names[number])
    command = [sys.executable, "-m", "bifocal", "pick", str(book.parent), "--workbook", str(book)]
    page = subprocess.Popen(
        [*command, "--no-browser", "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True, start_new_session=True,
    )  # fmt: skip
    assert page.stdout is not None
    answer: dict[str, Any] = json.loads(page.stdout.readline() or "{}")
    if "url" not in answer:
        raise InputError(remark("page.no_recent"))
    return str(answer["url"])
