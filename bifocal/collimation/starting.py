"""What an empty page offers: the sample, a project's walls, surveys that were open before."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2

from bifocal.collimation.project import SurveyFiles
from bifocal.collimation.session import Session
from bifocal.collimation.wording import without_options
from bifocal.demo import SAMPLE
from bifocal.files import photo_infos
from bifocal.model import NO_UNIT
from bifocal.model.doubts import unit_of
from bifocal.projects import ProjectOptions, photos_from_project, project_walls
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


def walls_at_hand(session: Session) -> list[dict[str, object]]:
    """Return the walls of another program's project in the survey's folder: words and picture.

    None where it holds no project, or one without walls.
    """
    try:
        walls = project_walls(session.files.folder)
    except PhotogrammetryError:
        return []
    return [
        {
            "number": number,
            "words": without_options(words, session.spoken),
            "picture": "data:image/jpeg;base64,"
            + base64.b64encode(cv2.imencode(".jpg", picture)[1].tobytes()).decode(),
        }
        for number, (words, picture) in enumerate(walls, start=1)
    ]


def open_wall(session: Session, number: int) -> None:
    """Begin with the photos of one of these walls, oriented as the project has them.

    The best pair of them is shown, the others lie beside it as a set. Where the project has no
    scale the pair waits for one, as after two photos alone.

    Raises
    ------
    InputError, GeometryError
        If picks were made already, there is no such wall, or its photos are not there.
    """
    with session.lock:
        session.check_new_photos()
        folder, products = session.files.folder, session.products
        file = products.place("set", "-set.photos.json")
        project = photos_from_project(
            folder, file, ProjectOptions(wall=(str(max(number, 1)),)),
            overwrite=products.is_own(file),
        )  # fmt: skip
        photo_infos(project.photos)
        pair = project.photos.best_pair()
        two = [pair.photo_file(1), pair.photo_file(2)]
        session.give_photos([*two, *(p.path for p in project.photos.photos if p.path not in two)])
        if unit_of(pair.extra) != NO_UNIT:
            path = products.place("pair", ".pair.json")
            pair.write(path, overwrite=products.is_own(path))
            session.note_made("pair", [path.name])
            session.note_made("set", [file.name])
            session.use_pair(path)
        else:
            path = free_path(folder.resolve(), f"{products.stem}.proposed", ".pair.json")
            doubts = pair.extra["setup"]["doubts"][1:]  # the first is of the scale: it is asked for
            replace(pair, extra={"setup": {"doubts": doubts}}).write(path)
            session.propose(path, {"free_scale": True, "remarks": doubts, "planes": []})
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
    answer: dict[str, object] = json.loads(page.stdout.readline() or "{}")
    if "url" not in answer:
        raise InputError(remark("page.no_recent"))
    return str(answer["url"])
