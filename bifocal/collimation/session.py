"""A survey open on the page: its state, its journal, its pictures."""

from __future__ import annotations

import copy
import threading
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

from bifocal.collimation.commands import changes_of
from bifocal.collimation.drawn_faces import DrawnFaces
from bifocal.collimation.exchange import (
    fields_of_exchange,
    follow_exchange,
    proposal_kept,
    proposal_noted,
)
from bifocal.collimation.fields import NOTES, fields_of
from bifocal.collimation.jobs import JobRunner
from bifocal.collimation.journal import Journal
from bifocal.collimation.listeners import Listeners
from bifocal.collimation.live_orientation import LiveOrientation
from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.pictures import Pictures
from bifocal.collimation.product_graph import causes_again, causes_hold
from bifocal.collimation.products import Products
from bifocal.collimation.project import JoinedSet, SurveyFiles
from bifocal.collimation.proposals import Proposal, Report, accept_pair, discard_pair
from bifocal.collimation.records import Change, SurveyState
from bifocal.collimation.scale import follow_scale, is_unscaled
from bifocal.collimation.shapes import outlines_of
from bifocal.collimation.workbook.rows import PointRow, put_rows, row_of
from bifocal.collimation.workbook.setup import ideal_setup, pair_of, typed_of
from bifocal.collimation.workbook.sync import WorkbookSync
from bifocal.model import FlagLimits, Pair, PhotoSet
from bifocal.remarks import remark
from bifocal.survey import WallPrecision
from photocore.errors import InputError, PhotogrammetryError
from photocore.jsonfile import plain
from photocore.output import relative_name

#: Commands that were answered already, by their ids.
MOST_ANSWERS = 10_000
#: Commands that bring picks of the photos.
_PICKING = ("point.pick", "points.add", "control.pick", "control.paste")
#: Commands that name what they make, where they are not told.
_NAMING = ("point.pick", "control.set", "control.pick", "shape.set", "length.check")


class Session:
    """A survey open on the page.

    Parameters
    ----------
    files : SurveyFiles
        Where its files lie.
    language : str
        Of the page, unless the journal says otherwise.

    Raises
    ------
    InputError
        If the journal cannot be opened, or pair file or photos are unusable.
    """

    def __init__(self, files: SurveyFiles, *, language: str = "en") -> None:
        self.files = files
        self.language = language
        self.lock = threading.RLock()
        listeners = Listeners()
        self.tell, self.listen = listeners.tell, listeners.listen
        #: Tells this run of the server from the one before it, whose revisions mean nothing now.
        self.serving = uuid.uuid4().hex
        self.revision = 0
        self.answered: dict[str, object] = {}
        self.results: LiveResults | None = None
        self.orientation: tuple[object, LiveOrientation] | None = None
        self.proposal: Proposal | None = None
        self.pick_doubt = ""
        self.good: tuple[LiveResults, WallPrecision | None] | None = None
        self._joined = JoinedSet()
        self._faces = DrawnFaces(lambda: self.state, lambda one: self._carry_out(one, write=True))
        #: Faces that the program would draw.
        self.suggested: list[dict[str, object]] = []
        #: From each corner of the rectangle of one photo alone to where it fits. [px]
        self.misfits: list[list[float]] = []
        self.state = SurveyState()
        self.journal = Journal(files.journal)
        try:
            pair = pair_of(files)
            both = files.photos[:2] if pair is None else (pair.photo_file(1), pair.photo_file(2))
            # What a journal says beside another pair is of no use.
            same = {path.resolve() for path in both} == {p.resolve() for p in files.photos[:2]}
            photos = (*both, *(files.photos[2:] if same else ()))
            self.pictures = Pictures(files.folder / f".{files.stem}.tiles", photos, pair)
            self.results = None if pair is None else self._results(pair)
            self.products = Products(files)
            self.jobs = JobRunner(
                self.lock, self.tell, self.changed, lambda: self.spoken,
                lambda: self.state.revision,
            )  # fmt: skip
            self.sync = WorkbookSync(self)
            self._replay_all()
            self.journal.cut()
            self._remember_files()
            self._show_proposal()
            self.show_products()
            self._faces.take(self.pictures.pair, self.files.pair)
            self.sync.step()
        except BaseException:
            self.journal.close()
            raise

    # ---- the survey's files

    def give_photos(self, photos: Sequence[Path]) -> None:
        """Begin with photos, far and near first; what was picked in others is of no use any more.

        Raises
        ------
        InputError
            If they are none, or picks were made already.
        """
        with self.lock:
            self.check_new_photos()
            self.pictures.show_photos(photos[:2])
            self.pictures.show_others(photos[2:])
            self.files = replace(self.files, photos=self.all_photos, pair=None)
            self.results, self.proposal = None, None
            self._remember_files()
            self.changed()

    def give_others(self, photos: Sequence[Path]) -> None:
        """Let these be the photos beside far and near: they join an orientation, which stays."""
        with self.lock:
            self.pictures.show_others(photos)
            self.files = replace(self.files, photos=self.all_photos)
            self._remember_files()
            self.changed()

    @property
    def all_photos(self) -> tuple[Path, ...]:
        """Far and near photo, then the others."""
        return tuple(info.path for info in (*self.pictures.infos, *self.pictures.others))

    @property
    def photo_set(self) -> Path | None:
        """File of the set that holds the accepted pair and all further photos, if there is one."""
        pair = self.accepted_pair
        candidates = self.products.current("set"), self.files.photo_set
        return None if pair is None else self._joined.of(candidates, pair, self.all_photos)

    def join(self, path: Path) -> None:
        """Let the pair be that of a set that a job adjusted."""
        with self.lock:
            target = self.products.place("pair", ".pair.json")
            PhotoSet.read(path).pair(0, 1).write(target, overwrite=True)
            self.note_made("pair", [target.name])
            self.use_pair(target)
            self._faces.keep(self.pictures.pair, self.files.pair)
            self.changed()

    def check_new_photos(self) -> None:
        """Refuse other photos, by an InputError, where points were picked already."""
        if self.state.points or self.state.control:
            raise InputError(remark("page.begun_before"))

    def propose(self, path: Path, report: Report) -> None:
        """Show the orientation that a job found; `align.accept` makes it the survey's own."""
        with self.lock:
            first = Pair.read(path).photo_file(1)
            if not first.samefile(self.pictures.infos[0].path):
                current = causes_hold(self, report)
                self.command({"op": "photos.exchange", "found": True})
                if current:  # the same, the other way round
                    report = {**report, "causes": causes_again(self, report)}
            self.note_proposed(path, report)
            follow_scale(self)
            self.changed()

    def note_proposed(self, path: Path, report: Report) -> None:
        """Let a pair file be the orientation that waits to be accepted."""
        if (before := self.proposed_path) not in (None, path):
            discard_pair(before)
        self.proposal = Proposal(op="proposed", pair=path.name, report=report)
        self._write(self.proposal)
        self._show_proposal()

    def _show_proposal(self) -> None:
        path = self.proposed_path
        if path is not None:
            self._show_pair(Pair.read(path))

    @property
    def spoken(self) -> str:
        """Language of the page."""
        return self.state.language or self.language

    @property
    def proposed_path(self) -> Path | None:
        """The pair file that waits to be accepted."""
        if self.proposal is None:
            return None
        path = self.files.folder / self.proposal["pair"]
        return path if path.is_file() else None

    @property
    def accepted_pair(self) -> Pair | None:
        """The orientation that the workbook is written for; None before one is accepted."""
        return None if self.proposed_path is not None else self.pictures.pair

    def _results(self, pair: Pair) -> LiveResults:
        """Return results of points with a pair, as `bifocal solve` will find them."""
        return LiveResults(pair, setup=ideal_setup(self.files, pair))

    def _show_pair(self, pair: Pair) -> None:
        self.pictures.show_pair(pair)
        self.results = self._results(pair)

    def follow_workbook(self) -> None:
        """Take over the orientation of a workbook that is the pair itself, where it changed.

        Raises
        ------
        InputError, GeometryError
            If its set-up cannot be used any more.
        """
        if not self.files.pair_is_workbook or self.proposal is not None:
            return
        pair = pair_of(self.files)
        pair_shown = self.pictures.pair
        if pair is None or (pair_shown is not None and typed_of(pair) == typed_of(pair_shown)):
            return
        photos = [pair.photo_file(1), pair.photo_file(2)]
        if photos != [info.path for info in self.pictures.infos]:
            self.pictures.show_photos(photos)
        self._show_pair(pair)

    def _accept(self) -> None:
        """Make the proposed orientation the survey's own pair file."""
        path = self.proposed_path
        if path is None:
            raise InputError(remark("page.no_orientation"))
        if is_unscaled(self):
            raise InputError(remark("page.no_size"))
        target = self.products.place("pair", ".pair.json")
        if path != target:
            accept_pair(path, target)
        self.note_made("pair", [target.name])
        self._write({"op": "accepted", "pair": target.name})
        self._note_accepted(target.name)
        self.use_pair(target)
        if self.sync.read is not None:
            self.set_precision(self.sync.read.sigma_px, self.sync.read.limits)

    def use_pair(self, path: Path) -> None:
        """Let a pair file be the survey's orientation."""
        self.files = replace(self.files, pair=path)
        self._remember_files()
        self._show_pair(Pair.read(path))

    def _note_accepted(self, name: str) -> None:
        """Let the last proposal be the survey's orientation, as a step that can be taken back."""
        after: Any = {"report": {}, **(self.proposal or {}), "pair": name}
        self.state.forget_orientation()
        self._apply([Change("orientation", "pair", None, after)])
        self.proposal = None

    def _follow_orientation(self, change: Change, *, live: bool) -> None:
        """Propose an orientation whose acceptance was taken back, or accept it again."""
        gone, came = cast("Proposal | None", change.before), cast("Any", change.after)
        self.proposal = gone
        if live:
            path = self.files.folder / (gone or came)["pair"]
            self.files = replace(self.files, pair=path if gone is None else None)
            self._remember_files()
            self._show_pair(Pair.read(path))

    def take_files(self, pair: Path | None, proposal: Proposal | None) -> None:
        """Let this be the pair file of the photos shown, or what is proposed instead."""
        if proposal is not None or self.proposal is not None:
            self._write({"op": "unaligned"} if proposal is None else proposal)
        self.results, self.proposal = None, proposal
        self.files = replace(self.files, photos=self.all_photos, pair=pair)
        self._remember_files()
        if pair is not None:
            self._show_pair(Pair.read(pair))
        self._show_proposal()

    def note_made(
        self, kind: str, names: Sequence[str], causes: Mapping[str, str] | None = None
    ) -> None:
        """Say in the journal which files the page made, and from what: these it may replace."""
        with self.lock:
            record = {"op": "made", "kind": kind, "names": list(names)}
            self._write({**record, "causes": dict(causes)} if causes else record)
            self.products.note(kind, names, causes)

    def show_products(self) -> None:
        """Show the orthophoto, where there is one."""
        ortho = self.products.current("ortho")
        if ortho is not None:
            self.pictures.show_ortho(ortho)

    def _remember_files(self) -> None:
        """Say in the journal which files belong to the survey, where that is new."""
        folder, pair = self.files.folder, self.files.pair
        record = {
            "op": "files",
            "stem": self.files.stem,
            "pair": relative_name(pair, folder) if pair else None,
            "photos": [relative_name(path, folder) for path in self.all_photos],
        }
        earlier = [old for old in self.journal.records if old["op"] == "files"]
        if not earlier or {key: earlier[-1].get(key) for key in record} != record:
            self._write(record)
            self.journal.records.append(record)

    # ---- commands

    def command(self, command: Mapping[str, object]) -> Any:
        """Carry out a command of the page and return its result.

        A command whose ``id`` was answered already is not done twice.

        Raises
        ------
        InputError
            If it is impossible, or could not be written to the journal; nothing changed then.
        """
        with self.lock:
            command_id = command.get("id")
            if isinstance(command_id, str) and command_id in self.answered:
                return self.answered[command_id]
            result = self._checked(fields_of(command))
            follow_scale(self)
            self._faces.keep(self.pictures.pair, self.files.pair)
            if isinstance(command_id, str):
                self._remember_answer(command_id, result)
            self.changed()
            return result

    def _checked(self, command: dict[str, object]) -> Any:
        """Carry out a command where the survey's files allow it."""
        op = command["op"]
        if op == "align.accept":
            return self._accept()
        if op == "photos.exchange":
            command |= fields_of_exchange(self)
        return self._carry_out(command, write=True)

    def _remember_answer(self, known: str, result: Any) -> None:
        self.answered[known] = result
        if len(self.answered) > MOST_ANSWERS:
            del self.answered[next(iter(self.answered))]

    def _carry_out(self, command: dict[str, object], *, write: bool) -> Any:
        """Change the state by a command, after it stands in the journal."""
        op = command["op"]
        if op in ("undo", "redo"):
            return self._undo(command, back=op == "undo", write=write)
        trial = copy.copy(self.state)
        trial.setup = dict(trial.setup)
        trial.lenses = {image: dict(lens) for image, lens in trial.lenses.items()}
        changes = changes_of(trial, command)
        if op in _NAMING and not command.get("name"):
            command["name"] = changes[0].key
        if write:
            if op in _PICKING:
                self.pictures.check_picks(op, changes)
            self._write(command)
        self.state = trial
        self._apply(changes)
        if write and any(one.kind == "settings" for one in changes):
            follow_exchange(self, changes)
        return {"name": changes[-1].key} if changes else None

    def _apply(self, changes: list[Change]) -> None:
        self.state.apply(changes)
        self.state.revision += 1
        if changes:
            self.state.done.append(changes)
            self.state.undone.clear()

    def _undo(self, command: dict[str, object], *, back: bool, write: bool) -> Any:
        """Take the last changes back, or make them again."""
        source, target = self.state.done, self.state.undone
        if not back:
            source, target = target, source
        if not source:
            raise InputError(remark(f"page.nothing_to_{'undo' if back else 'redo'}"))
        changes = [change.reversed for change in reversed(source[-1])]
        if write:
            self._write(command := proposal_noted(self, command, changes))
        changes = proposal_kept(command, changes)
        source.pop()
        self.state.apply(changes)
        self.state.revision += 1
        if any(one.kind == "settings" for one in changes):
            if write:
                follow_exchange(self, changes)
        elif changes[0].kind == "orientation":
            self._follow_orientation(changes[0], live=write)
        target.append(changes)
        return {"name": changes[-1].key}

    def _replay_all(self) -> None:
        """Carry out the journal, and find out what of it stands in the workbook."""
        records = self.journal.records
        saved = [record for record in records if record["op"] == "workbook.saved"]
        at = saved[-1].get("at") if saved else None
        for number, record in enumerate(records, start=1):
            try:
                self._replay(record)
            except PhotogrammetryError as error:
                raise self.journal.refusal(number, str(error)) from None
            if self.state.revision == at:
                self.sync.synced = {n: row_of(p) for n, p in self.state.points.items()}
                if self.pictures.pair is not None:
                    self.sync.outlines = plain(outlines_of(self.state, self.pictures.pair))

    def _replay(self, record: Mapping[str, object]) -> None:
        """Carry out a record of the journal."""
        op = record["op"]
        fields = fields_of(record)
        if op == "workbook.read":
            rows = {name: PointRow(**row) for name, row in fields["rows"].items()}
            gone = fields["gone"]
            self._apply_rows(rows, gone)
            self.sync.take(rows, gone)
        elif op == "workbook.saved":
            self.sync.digest = fields["sha256"]
        elif op == "made":
            self.products.note(fields["kind"], fields["names"], fields.get("causes"))
        elif op == "accepted" and "pair" in fields:
            self._note_accepted(fields["pair"])
        elif op in ("proposed", "accepted", "unaligned"):
            self.proposal = cast("Proposal", fields) if op == "proposed" else None
        elif op not in NOTES:
            self._carry_out(fields, write=False)
            if "id" in fields:
                self._remember_answer(fields["id"], {"name": fields.get("name")})

    # ---- the workbook

    def take_rows(self, rows: Mapping[str, PointRow], gone: Sequence[str]) -> None:
        """Take over points that were changed in the workbook by others."""
        record = {
            "op": "workbook.read",
            "rows": {name: asdict(row) for name, row in rows.items()},
            "gone": list(gone),
        }
        self._write(record)
        self._apply_rows(rows, gone)

    def _apply_rows(self, rows: Mapping[str, PointRow], gone: Sequence[str]) -> None:
        put_rows(self.state, rows, gone)
        self.state.revision += 1

    def note_saved(self, digest: str, revision: int) -> None:
        """Say in the journal that the workbook holds the survey as of a revision."""
        with self.lock:
            self._write({"op": "workbook.saved", "sha256": digest, "at": revision})

    def set_precision(self, sigma_px: float | None, limits: FlagLimits) -> None:
        """Let the results follow the precision and limits of the workbook."""
        results = self.results
        if results is not None and (results.sigma_px, results.limits) != (sigma_px, limits):
            self.results = replace(results, sigma_px=sigma_px, limits=limits)

    def _write(self, record: Mapping[str, object]) -> None:
        stamp = datetime.now(UTC).isoformat(timespec="milliseconds")
        self.journal.append({**record, "time": stamp})

    # ---- listeners

    def changed(self) -> None:
        """Tell all listeners that the state is another, and the workbook's writer."""
        self.sync.touch()
        with self.lock:
            self.revision += 1
            self.tell({"revision": self.revision})

    def close(self) -> None:
        """End the session."""
        self.tell(None)
        self.jobs.stop()
        self.sync.stop()
        self.journal.close()
