"""A survey open on the page: its state, its journal, its pictures."""

from __future__ import annotations

import copy
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.collimation.commands import changes_of
from bifocal.collimation.journal import Journal
from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.measures import measure
from bifocal.collimation.project import SurveyFiles
from bifocal.collimation.pyramids import Pyramid, RectifiedPhoto, wall_grid
from bifocal.collimation.records import Change, PickedPoint, Pixel, SurveyState
from bifocal.collimation.snapping import snap
from bifocal.collimation.suggestions import radial_line, suggest
from bifocal.collimation.tile_store import TileStore
from bifocal.collimation.workbook_rows import PointRow, row_of
from bifocal.collimation.workbook_sync import WorkbookSync
from bifocal.files.images import ImageInfo, image_info, read_image
from bifocal.model.flags import FlagLimits
from bifocal.model.grid import Grid
from bifocal.model.pair import Pair
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import InputError
from photocore.jsonfile import plain
from photocore.output import relative_name

#: Commands that were answered already, by their ids.
MOST_ANSWERS = 10_000
#: Records of the journal that are notes, not commands.
_NO_COMMANDS = ("files", "workbook.saved", "workbook.read")


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
        self.listeners: set[queue.SimpleQueue[dict[str, Any] | None]] = set()
        self.revision = 0
        self.answered: dict[str, Any] = {}
        self.pair: Pair | None = None
        self.grid: Grid | None = None
        self.infos: list[ImageInfo] = []
        self.pyramids: list[Pyramid] = []
        self.results: LiveResults | None = None
        self.tiles = TileStore(files.folder / f".{files.stem}.tiles")
        self.sync = WorkbookSync(self)
        self._open_files()
        self.state = SurveyState()
        self.journal = Journal(files.journal)
        try:
            self._replay_all()
            self._remember_files()
            self.sync.step()
        except BaseException:
            self.journal.close()
            raise

    # ---- the survey's files

    def _open_files(self) -> None:
        """Read the pair and the headers of the photos, and offer their pictures."""
        self.pair = Pair.read(self.files.pair) if self.files.pair is not None else None
        photos = self.files.photos
        if self.pair is not None:
            photos = (self.pair.photo_file(1), self.pair.photo_file(2))
        self.infos = [image_info(path) for path in photos]
        self.pyramids = [
            Pyramid(info.size, lambda path=info.path: read_image(path))  # type: ignore[misc]
            for info in self.infos
        ]
        for number, (info, pyramid) in enumerate(
            zip(self.infos, self.pyramids, strict=True), start=1
        ):
            self.tiles.register(f"photo-{number}", pyramid, *_facts(info.path))
        self.grid = self.results = None
        if self.pair is not None:
            self._open_pair(self.pair)

    def _open_pair(self, pair: Pair) -> None:
        sizes = (self.infos[0].size, self.infos[1].size)
        self.grid = wall_grid(pair, sizes)
        for number, pyramid in enumerate(self.pyramids, start=1):
            photo = pair.photo(number)
            picture = RectifiedPhoto.of(photo, number, pyramid, self.grid)
            lens = photo.lens and (photo.lens.camera_matrix.tolist(), photo.lens.model,
                                   photo.lens.coefficients.tolist())  # fmt: skip
            facts = (*_facts(pyramid_path(self.infos, number)), photo.plane_from_pixel.tolist(),
                     lens, self.grid)  # fmt: skip
            self.tiles.register(f"wall-{number}", picture, *facts)
        self.results = LiveResults(pair)

    def _remember_files(self) -> None:
        """Say in the journal which files belong to the survey, where that is new."""
        folder, pair = self.files.folder, self.files.pair
        record = {
            "op": "files",
            "stem": self.files.stem,
            "pair": relative_name(pair, folder) if pair else None,
            "photos": [relative_name(info.path, folder) for info in self.infos],
        }
        known = [old for old in self.journal.records if old["op"] == "files"]
        if not known or {key: known[-1].get(key) for key in record} != record:
            self._write(record)

    # ---- commands

    def command(self, command: Mapping[str, Any]) -> Any:
        """Carry out a command of the page and return its result.

        A command whose ``id`` was answered already is not done twice.

        Raises
        ------
        InputError
            If it is impossible, or could not be written to the journal; nothing changed then.
        """
        with self.lock:
            known = command.get("id")
            if isinstance(known, str) and known in self.answered:
                return self.answered[known]
            self._check_pick(command)
            result = self._carry_out(dict(command), write=True)
            if isinstance(known, str):
                self._remember_answer(known, result)
            self.changed()
            return result

    def _remember_answer(self, known: str, result: Any) -> None:
        self.answered[known] = result
        if len(self.answered) > MOST_ANSWERS:
            del self.answered[next(iter(self.answered))]

    def _carry_out(self, command: dict[str, Any], *, write: bool) -> Any:
        """Change the state by a command, after it stands in the journal."""
        op = command.get("op")
        if op in ("undo", "redo"):
            return self._undo(command, back=op == "undo", write=write)
        trial = copy.copy(self.state)
        trial.setup = dict(trial.setup)
        trial.lenses = {image: dict(lens) for image, lens in trial.lenses.items()}
        changes = changes_of(trial, command)
        if op == "point.pick" and not command.get("name"):
            command["name"] = changes[0].key
        if write:
            self._write(command)
        self.state = trial
        self._apply(changes)
        return changes[-1].key if changes else None

    def _apply(self, changes: list[Change]) -> None:
        self.state.apply(changes)
        self.state.revision += 1
        if changes:
            self.state.done.append(changes)
            self.state.undone.clear()

    def _undo(self, command: dict[str, Any], *, back: bool, write: bool) -> Any:
        """Take the last changes back, or make them again."""
        source, target = self.state.done, self.state.undone
        if not back:
            source, target = target, source
        if not source:
            raise InputError("there is nothing to undo." if back else "there is nothing to redo.")
        if write:
            self._write(command)
        changes = [change.reversed for change in reversed(source.pop())]
        self.state.apply(changes)
        self.state.revision += 1
        target.append(changes)
        return changes[-1].key

    def _replay_all(self) -> None:
        """Carry out the journal, and find out what of it stands in the workbook."""
        saved = [record for record in self.journal.records if record["op"] == "workbook.saved"]
        at = saved[-1].get("at") if saved else None
        for record in self.journal.records:
            if record["op"] == "workbook.read":
                rows, gone = _rows_of(record)
                self._apply_rows(rows, gone)
                self.sync.take(rows, gone)
            elif record["op"] == "workbook.saved":
                self.sync.digest = record.get("sha256", "")
            elif record["op"] not in _NO_COMMANDS:
                self._carry_out(record, write=False)
                if isinstance(record.get("id"), str):
                    self._remember_answer(record["id"], record.get("name"))
            if self.state.revision == at:
                self.sync.synced = {n: row_of(p) for n, p in self.state.points.items()}

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
        points = self.state.points
        for name, row in rows.items():
            before = points.get(name)
            order = before.order if before is not None else self.state.next_order()
            points[name] = PickedPoint(
                name=name, order=order, picks=row.picks, code=row.code, note=row.note,
                # What is picked in one photo only was left out for that alone.
                use=row.use or None in row.picks, reference=row.reference,
            )  # fmt: skip
        for name in gone:
            points.pop(name, None)
        self.state.revision += 1

    def note_saved(self, digest: str, revision: int) -> None:
        """Say in the journal that the workbook holds the survey as of a revision."""
        with self.lock:
            self._write({"op": "workbook.saved", "sha256": digest, "at": revision})

    def set_precision(self, sigma_px: float | None, limits: FlagLimits) -> None:
        """Let the results follow the precision and limits of the workbook."""
        known = self.results
        if known is not None and (known.sigma_px, known.limits) != (sigma_px, limits):
            self.results = LiveResults(known.pair, sigma_px, limits)

    def _write(self, record: Mapping[str, Any]) -> None:
        stamp = datetime.now(UTC).isoformat(timespec="milliseconds")
        self.journal.append({**record, "time": stamp})

    def _check_pick(self, command: Mapping[str, Any]) -> None:
        """Refuse a pick outside its photo."""
        if command.get("op") not in ("point.pick", "control.pick"):
            return
        image, column, row = (command.get(key) for key in ("image", "column", "row"))
        if image not in (1, 2) or not isinstance(column, int | float):
            return  # the command itself says what is wrong
        if len(self.infos) < 2:
            raise InputError("there are no photos yet; give two.")
        width, height = self.infos[image - 1].size
        inside = -0.5 <= column <= width - 0.5
        if isinstance(row, int | float) and not (inside and -0.5 <= row <= height - 0.5):
            raise InputError(f"the pick lies outside photo {image} ({width} x {height} px).")

    # ---- listeners

    def changed(self) -> None:
        """Tell all listeners that the state is another, and the workbook's writer."""
        self.sync.touch()
        with self.lock:
            self.revision += 1
            self.tell({"revision": self.revision})

    def tell(self, event: dict[str, Any] | None) -> None:
        """Tell all listeners something; None ends them."""
        for listener in list(self.listeners):
            listener.put(event)

    def listen(self) -> tuple[queue.SimpleQueue[dict[str, Any] | None], Callable[[], None]]:
        """Return a queue of events, and how to leave it."""
        events: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self.listeners.add(events)
        return events, lambda: self.listeners.discard(events)

    def close(self) -> None:
        """End the session."""
        self.tell(None)
        self.sync.stop()
        self.journal.close()

    # ---- measuring

    def photos(self) -> tuple[ByteArray, ByteArray]:
        """Return both photos, 8 bit; they are read once.

        Raises
        ------
        InputError
            If there are no two photos yet.
        """
        if len(self.pyramids) < 2:
            raise InputError("there are no photos yet; give two.")
        return self.pyramids[0].halved(0), self.pyramids[1].halved(0)

    def suggest(self, image: int, pixel: Pixel) -> dict[str, Any]:
        """Return where the other photo shows a pick, with the line on which it must lie."""
        pair = self.needed_pair()
        found = suggest(pair, self.photos(), image, np.array(pixel))
        return plain(
            {
                "column": found.pixel[0],
                "row": found.pixel[1],
                "quality": found.quality,
                "score": found.score,
                "sigma_px": found.sigma_px,
                "misfit_px": found.misfit_px,
                "kept": found.kept,
                "line": self.line(image, pixel),
            }
        )

    def line(self, image: int, pixel: Pixel) -> list[list[float]]:
        """Return the line in the other photo on which a pick must lie. [px]"""
        pair, size = self.needed_pair(), self.infos[2 - image].size
        return radial_line(pair, image, np.array(pixel), size).tolist()

    def snap(self, image: int, pixel: Pixel, radius: float) -> dict[str, Any]:
        """Return the target's centre or the corner next to a pick."""
        return snap(self.photos()[image - 1], pixel, radius)._asdict()

    def measure(self, names: Sequence[str]) -> dict[str, float | None]:
        """Return distances and angles between points."""
        self.needed_pair()
        places = []
        for name in names:
            point = self.state.points.get(name)
            if point is None:
                raise InputError(f"there is no point {name}.")
            place = None if self.results is None else self.results.place(point)
            if place is None:
                raise InputError(f"point {name} is not picked in both photos yet.")
            places.append(place)
        return measure(places)

    def convert(self, image: int, pixels: FloatArray, source: str) -> FloatArray:
        """Return pixels of a photo as pixels of the wall or back, shape (n, 2); any lens model."""
        photo, grid = self.needed_pair().photo(image), self.grid
        assert grid is not None
        if source == "photo":
            return grid.pixel_of(photo.plane_from_pixels(pixels))
        plane = np.column_stack(
            [grid.x0 + grid.gsd * pixels[:, 0], grid.y0 - grid.gsd * pixels[:, 1]]
        )
        return photo.pixels_from_plane(plane)

    # ---- geometry

    def needed_pair(self) -> Pair:
        """Return the pair.

        Raises
        ------
        InputError
            If the photos are not oriented yet.
        """
        if self.pair is None:
            raise InputError("the photos are not oriented yet; align them first.")
        return self.pair

    def photo_from_wall(self, number: int) -> FloatArray:
        """Return the homography from wall pixels to ideal pixels of a photo, shape (3, 3)."""
        pair, grid = self.needed_pair(), self.grid
        assert grid is not None
        matrix = np.linalg.inv(pair.photo(number).plane_from_pixel) @ grid.plane_from_pixel
        return np.asarray(matrix / matrix[2, 2])


def _rows_of(record: Mapping[str, Any]) -> tuple[dict[str, PointRow], list[str]]:
    """Return the rows that a record of the journal holds."""
    rows = {}
    for name, row in record["rows"].items():
        first, second = (None if pick is None else tuple(pick) for pick in row["picks"])
        known = None if row["reference"] is None else tuple(row["reference"])
        rows[name] = PointRow((first, second), row["code"], row["note"], row["use"], known)
    return rows, list(record["gone"])


def _facts(path: Path) -> tuple[str, int, int]:
    """Return what tells whether a photo is still the same."""
    known = path.stat()
    return path.name, known.st_size, known.st_mtime_ns


def pyramid_path(infos: list[ImageInfo], number: int) -> Path:
    """Return the file of photo 1 or 2."""
    return infos[number - 1].path
