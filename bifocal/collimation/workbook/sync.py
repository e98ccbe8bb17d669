"""The workbook kept in step with the page, in the background."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Protocol

from bifocal.collimation.background import in_background
from bifocal.collimation.project import SurveyFiles
from bifocal.collimation.records import SurveyState
from bifocal.collimation.shapes import outlines_of
from bifocal.collimation.workbook.process import FROM as LARGE
from bifocal.collimation.workbook.process import change_in_process
from bifocal.collimation.workbook.rows import (
    PointRow,
    ReadBook,
    change_rows,
    digest_of,
    read_rows,
    row_of,
    write_new,
)
from bifocal.model import FlagLimits, Pair
from bifocal.remarks import remark
from photocore.errors import InputError, PhotogrammetryError
from photocore.jsonfile import plain
from photocore.output import check_not_open

#: Quiet seconds after a pick before the workbook is written, and between looks at the file.
QUIET, LOOK = 0.7, 2.0


class Survey(Protocol):
    """What is kept in step with a workbook: of the session no more than this."""

    lock: threading.RLock
    files: SurveyFiles
    state: SurveyState

    @property
    def spoken(self) -> str:
        """Language of the page."""

    @property
    def accepted_pair(self) -> Pair | None:
        """The orientation that the workbook is written for; None before one is accepted."""

    def set_precision(self, sigma_px: float | None, limits: FlagLimits) -> None:
        """Let the results follow the precision and limits of the workbook."""

    def take_rows(self, rows: Mapping[str, PointRow], gone: Sequence[str]) -> None:
        """Take over points that were changed in the workbook by others."""

    def follow_workbook(self) -> None:
        """Take over the orientation of a workbook that is the pair itself, where it changed."""

    def note_saved(self, digest: str, revision: int) -> None:
        """Remember that the workbook holds the survey as of a revision."""

    def changed(self) -> None:
        """Tell that the state is another."""


class WorkbookSync:
    """Keeps workbook and survey in step.

    Parameters
    ----------
    survey : Survey

    Attributes
    ----------
    waiting : str or None
        Why picks wait in the journal: the workbook is open elsewhere, a cell in it is wrong ...
    synced : dict of str to PointRow
        The workbook's points as they stood after the last save or reading.
    digest, seen : str
        Of the file as the page wrote it last, and as it was read last.
    """

    def __init__(self, survey: Survey) -> None:
        self.survey = survey
        self.waiting: str | None = None
        self.synced: dict[str, PointRow] = {}
        self.outlines: dict[str, object] = {}
        self.digest = ""
        self.seen = ""
        self.read: ReadBook | None = None
        self._busy = threading.Lock()
        self._wake = threading.Event()
        self._stopping = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to write in the background."""
        self._thread = in_background("the page's workbook", self._run, self._fault)
        self._thread.start()

    def touch(self) -> None:
        """Say that something was picked."""
        self._wake.set()

    def stop(self) -> None:
        """Write what is left and end."""
        self._stopping = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join(timeout=60)
            self._thread = None
        self.step()

    def _run(self) -> None:
        while not self._stopping:
            touched = self._wake.wait(LOOK)
            while touched and not self._stopping:  # until nothing is picked for a moment
                self._wake.clear()
                touched = self._wake.wait(QUIET)
            if not self._stopping:
                self.step()

    def _fault(self, message: str) -> None:
        self.waiting = message
        self.survey.changed()

    def step(self) -> None:
        """Bring in what others changed in the workbook, then write what changed on the page."""
        with self._busy:
            before = self.waiting
            try:
                self._merge()
                self._write()
                self.waiting = None
            except (PhotogrammetryError, OSError) as error:
                self.waiting = str(error)
            if self.waiting != before:
                self.survey.changed()

    def _merge(self) -> None:
        """Take over rows that others changed, unless the page changed the same ones since."""
        survey, path = self.survey, self.survey.files.workbook
        digest = digest_of(path)
        if not digest or digest == self.seen:
            return
        read = read_rows(path)
        with survey.lock:
            rows, gone = self._foreign(read.rows)
            survey.follow_workbook()
            self.read, self.seen = read, digest
            survey.set_precision(read.sigma_px, read.limits)
            if rows or gone:
                survey.take_rows(rows, gone)
                self.take(rows, gone)
            survey.changed()

    def take(self, rows: Mapping[str, PointRow], gone: Sequence[str]) -> None:
        """Count rows that others changed as in step."""
        self.synced.update(rows)
        for name in gone:
            self.synced.pop(name, None)

    def _foreign(self, rows: Mapping[str, PointRow]) -> tuple[dict[str, PointRow], list[str]]:
        """Return rows that others changed, and names that others took out."""
        points = self.survey.state.points
        now = {name: row_of(point) for name, point in points.items()}

        def page_changed(name: str) -> bool:
            return now.get(name) != self.synced.get(name)

        changed = {
            name: row
            for name, row in rows.items()
            if row not in (self.synced.get(name), now.get(name)) and not page_changed(name)
        }
        gone = [
            name
            for name in self.synced
            if name not in rows and name in points and not page_changed(name)
        ]
        return changed, gone

    def _write(self) -> None:
        """Write the page's points where they are others than the workbook's."""
        survey, path = self.survey, self.survey.files.workbook
        with survey.lock:
            points = survey.state.sorted_points()
            pair, pair_path = survey.accepted_pair, survey.files.pair
            revision = survey.state.revision
            outlines = {} if pair is None else plain(outlines_of(survey.state, pair))
        wanted = {point.name: row_of(point) for point in points}
        if pair is None or pair_path is None:
            return
        exists = bool(path.exists() and path.stat().st_size)
        if exists and self.read is not None:
            written = wanted == self.synced and self.seen == self.digest
            same = (written or wanted == self.read.rows) and outlines == self.outlines
            if same and not self._oriented_anew(pair):
                return
            keep, language = self.seen != self.digest, survey.spoken
            if len(points) < LARGE:
                change_rows(
                    path, self.read, points, pair, pair_path,
                    keep=keep, outlines=outlines, language=language,
                )  # fmt: skip
            else:
                change_in_process(
                    path, points, pair_path, keep=keep, outlines=outlines, language=language
                )
        elif survey.files.pair_is_workbook:
            raise InputError(remark("page.book_gone", name=path.name))
        else:
            if not outlines and not any(point.is_complete for point in points):
                return
            check_not_open(path)
            write_new(path, points, pair, pair_path, survey.spoken, outlines)
        read = read_rows(path)
        if lost := wanted.keys() - read.rows.keys():
            raise InputError(f"{path.name}: did not take {len(lost)} points, {min(lost)} first.")
        self.synced, self.outlines = wanted, outlines
        self.digest = self.seen = digest_of(path)
        self.read = read
        survey.note_saved(self.digest, revision)

    def _oriented_anew(self, pair: Pair) -> bool:
        """Whether the workbook's homographies, nadirs or distances are not the pair's."""
        if self.read is None or self.read.survey.setup.matrices is None:
            return False
        setup = self.read.survey.setup
        stated, heights = setup.media and setup.media.layers, setup.media and setup.media.z0
        if stated != pair.layers or (stated and heights != (pair.image1.z0, pair.image2.z0)):
            return True
        distances = (setup.taking.d1, setup.taking.d2)
        known = zip(setup.matrices or (), setup.nadirs, distances, strict=True)
        return any(
            (matrix != photo.plane_from_pixel).any()
            or (nadir != photo.nadir).any()
            or distance != photo.distance
            for (matrix, nadir, distance), photo in zip(
                known, (pair.image1, pair.image2), strict=True
            )
        )
