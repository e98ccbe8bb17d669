"""A survey open on the page, without a browser: for the tests of the page's server."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from bifocal import SAMPLE, Session
from bifocal.collimation.project import find_files
from bifocal.collimation.server.application import application
from photocore.jsonfile import read_object, write_object

TOKEN = "a-token-for-tests-that-is-long-enough"
BASE = "http://127.0.0.1:8765"


def sample_folder(folder: Path) -> Path:
    """Copy the sample pair into a folder and return it."""
    for name in ("facade.pair.json", "far.jpg", "near.jpg"):
        shutil.copyfile(SAMPLE / name, folder / name)
    return folder


def proposed(session: Session, folder: Path, **report: Any) -> None:
    """Propose the sample's orientation as if the photos alone had given it."""
    data = read_object(SAMPLE / "facade.pair.json", what="pair file")
    path = folder / "survey.proposed.pair.json"
    write_object(path, data, overwrite=True, as_is=True)
    session.propose(path, {"free_scale": True, "remarks": [], "planes": [], **report})


def two_photos(folder: Path) -> Path:
    """Copy the sample's photos alone into a folder and return it."""
    for name in ("far.jpg", "near.jpg"):
        shutil.copy(SAMPLE / name, folder)
    return folder


def sample_picks() -> dict[str, tuple[tuple[float, float], tuple[float, float]]]:
    """Return the sample's picks by name, with 0.2 px of noise."""
    with (SAMPLE / "targets.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))[1:]
    return {
        name: ((float(a), float(b)), (float(c), float(d))) for name, a, b, c, d, _ in rows
    }  # fmt: skip


def entries(folder: Path) -> list[str]:
    """Return all files of a folder but the kept tiles."""
    paths = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path.as_posix() for path in paths if ".tiles" not in path.as_posix())


@contextmanager
def opened(*sources: Path, **options: Any) -> Iterator[Session]:
    """Yield an open survey; nothing is written to its workbook unless asked for."""
    session = Session(find_files(list(sources), **options))
    try:
        yield session
    finally:
        session.jobs.stop()
        session.journal.close()
    alive = [thread.name for thread in session.jobs.threads if thread.is_alive()]
    assert not alive, f"threads outlive their survey: {alive}"


def client_of(session: Session, **headers: str) -> TestClient:
    """Return a client that knows the token."""
    known = {"x-bifocal-token": TOKEN} | {key.replace("_", "-"): v for key, v in headers.items()}
    return TestClient(application(session, TOKEN), base_url=BASE, headers=known)


def pick(session: Session, name: str, image: int, pixel: tuple[float, float]) -> None:
    """Pick a point."""
    session.command(
        {"op": "point.pick", "name": name, "image": image, "column": pixel[0], "row": pixel[1]}
    )


def pick_both(session: Session, name: str, picks: tuple[tuple[float, float], ...]) -> None:
    """Pick a point in both photos."""
    for image, pixel in enumerate(picks, start=1):
        pick(session, name, image, pixel)
