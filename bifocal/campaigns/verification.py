"""A delivery held against its own records: is every file what it was when it was made?"""

from __future__ import annotations

import hashlib
import os
import shutil
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import cast

from bifocal.campaigns.step_store import FORMAT, RECORD, WholeRecord, read_record, record_key
from bifocal.campaigns.surveyed_pair import FIRST_STEP, PRODUCTS, PairJob
from bifocal.campaigns.workflow import facade
from bifocal.files import SUMS, read_survey_points
from bifocal.model import Pair
from bifocal.options import FILES
from bifocal.remarks import remark
from bifocal.reports import WorkedPoint, recomputed
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.jsonfile import read_object
from photocore.output import temporary_folder
from photocore.provenance import file_hash, program
from photocore.textfile import check_name, read_text
from photocore.workbook import UNPACKING, check_names

#: A file of an archive that grows more when unpacked, and is larger, is no product of ours.
_RATIO, _LARGE = 250, 64 << 20
_PAIR = ".pair.json"
#: State of what is not made anew.
_LEFT = "not remade"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileState:
    """What became of a file since the delivery was made.

    Attributes
    ----------
    file : str
        As seen from the delivery's folder.
    state : str
        ``unchanged``, ``changed``, ``missing`` or ``not listed``.
    why : str
        What else is known of it.
    """

    file: str
    state: str
    why: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """A delivery held against its records.

    Attributes
    ----------
    files : tuple of FileState
    worked : tuple of WorkedPoint
        The worked point of each report, computed anew.
    remade : tuple of FileState
        The products made anew, held against those recorded.
    digest : str
        SHA-256 of the list of all hashes: one number that tells this delivery from any other.
    """

    files: tuple[FileState, ...]
    worked: tuple[WorkedPoint, ...]
    remade: tuple[FileState, ...]
    digest: str

    @property
    def same(self) -> bool:
        """Whether nothing differs."""
        states = {one.state for one in (*self.files, *self.remade)}
        return states <= {"unchanged", _LEFT} and all(point.holds for point in self.worked)

    def summary(self) -> str:
        """Return how many files are in which state."""
        counts = Counter(one.state for one in self.files)
        counts["made anew otherwise"] = sum(one.state == "changed" for one in self.remade)
        counts["worked point wrong"] = sum(not point.holds for point in self.worked)
        return ", ".join(f"{n} {state}" for state, n in counts.items() if n)

    def lines(self) -> list[str]:
        """Return one line a file, and what else was checked."""
        files = (*self.files, *self.remade)
        sentences = [
            f"{one.state:11} {one.file}{f' ({one.why})' if one.why else ''}" for one in files
        ]
        sentences += [point.sentence() for point in self.worked]
        return [*sentences, f"Digest of the delivery: {self.digest}"]

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        return {"same": self.same, **asdict(self)}


def verify(
    delivery: Path | str,
    *,
    remake: bool = False,
    sources: Path | None = None,
    progress: Progress = no_progress,
) -> Verification:
    """Hold a delivery against its records; nothing is written into it.

    Parameters
    ----------
    delivery : path
        Folder of `bifocal facade` or `bifocal survey`, or a zip archive of it or of the page.
    remake : bool
        Make the products of each pair anew in a folder that only passes, and compare their bytes.
    sources : path, optional
        Folder with the photos and tables, where they are neither in the delivery nor where they
        were; they are known by their hashes.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        If it is no delivery, or an archive that is damaged, not ordinary, or too large; for
        ``remake`` if a photo or table is not found or a step fails.
    """
    path = Path(delivery)
    if sources is not None and not sources.is_dir():
        raise InputError(f"{sources}: no such folder; name that of the photos and tables.")
    with _opened(path) as folder:
        records = _records(folder)
        hashes = {name: file_hash(folder / name) for name in sorted(_visible(folder))}
        listed = dict(_listed(folder, records, hashes))
        if not listed:
            raise InputError(remark("campaign.no_record", of=path, record=RECORD, sums=SUMS))
        sums = "".join(f"{digest}  {name}\n" for name, digest in hashes.items())
        files = [*_judged(hashes, listed), *_broken(records), *_no_files(folder, hashes)]
        return Verification(
            files=tuple(sorted(files, key=lambda one: one.file)),
            worked=tuple(_worked(folder, hashes, listed, path)),
            remade=tuple(_remade(folder, records, sources, progress)) if remake else (),
            digest=hashlib.sha256(os.fsencode(sums)).hexdigest(),
        )


@contextmanager
def _opened(path: Path) -> Iterator[Path]:
    """Yield the folder, of an archive one that only passes."""
    check_name(path)
    if path.is_dir():
        yield path
        return
    if not path.is_file():
        raise InputError(f"{path}: no such folder or archive; name what was delivered.")
    with temporary_folder() as place:
        try:
            with zipfile.ZipFile(path) as package:
                _check_members(path, package.infolist(), place)
                package.extractall(place)
        except UNPACKING as error:
            raise InputError(remark("campaign.no_archive", of=path, error=error)) from None
        # An archive of the folder holds that folder.
        while len(inside := list(place.iterdir())) == 1 and inside[0].is_dir():
            (place,) = inside
        yield place


def _check_members(path: Path, members: list[zipfile.ZipInfo], place: Path) -> None:
    """Refuse what would leave the folder, or grow beyond all measure."""
    refuse = f"{path}: refused, this is not an ordinary archive: "
    check_names(refuse, members)
    packed = sum(member.compress_size for member in members)
    total = sum(member.file_size for member in members)
    for member in members:
        if member.file_size > max(_LARGE, _RATIO * member.compress_size):
            raise InputError(f"{refuse}the part {member.filename!r:.80} would be too large.")
    if packed > path.stat().st_size:
        raise InputError(f"{refuse}its parts lie over each other; they may not.")
    if total > shutil.disk_usage(place).free:
        raise InputError(
            remark("campaign.too_large", of=path, size=total / 1e9, folder=place.parent)
        )


def _visible(folder: Path) -> set[str]:
    """Return the files of a delivery: records, and all that is not hidden or leads out of it."""
    root, names = folder.resolve(), set()
    for path in folder.rglob("*"):
        name = path.relative_to(folder)
        hidden = any(part[0] == "." for part in name.parts) and (
            name.name != RECORD or any(part[0] == "." for part in name.parts[:-1])
        )
        if not hidden and path.is_file() and path.resolve().is_relative_to(root):
            names.add(name.as_posix())
    return names


def _no_files(folder: Path, hashes: Mapping[str, str]) -> Iterator[FileState]:
    """Yield links that lead out of the delivery, to folders or nowhere, and what is no file."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        hidden = any(part[0] == "." for part in path.relative_to(folder).parts)
        plain = path.is_file() or path.is_dir()
        if name not in hashes and not hidden and (path.is_symlink() or not plain):
            yield FileState(file=name, state="not listed", why="a link or pipe, not a file")


def _records(folder: Path) -> dict[str, WholeRecord]:
    """Return the records of steps by their place; an empty one where it cannot be read."""
    places = (path.relative_to(folder) for path in sorted(folder.rglob(RECORD)))
    return {
        place.as_posix(): _record(folder / place)
        for place in places
        if not any(part[0] == "." for part in place.parts[:-1])
    }


def _record(path: Path) -> WholeRecord:
    with suppress(InputError, KeyError, TypeError, ValueError, AttributeError):
        data = read_object(path, what="record")
        texts = [data["program"], data["date"], data["step"], data["key"], *data["after"]]
        texts += [*data["outputs"].values(), *chain(*_inputs(cast("WholeRecord", data)).values())]
        whole = all(isinstance(text, str) for text in texts) and isinstance(data["options"], dict)
        if whole and data["format"] == FORMAT:
            return cast("WholeRecord", data)
    return {}


def _listed(
    folder: Path, records: Mapping[str, WholeRecord], hashes: Mapping[str, str]
) -> Iterator[tuple[str, str]]:
    """Yield the files that should be there with their hashes; a list has none of its own."""
    # What went in may lie beside what came out; photos of two folders may have one name.
    sources = [file for data in records.values() for file in _inputs(data).values()]
    for name, digest in hashes.items():
        digests = [one for source, one in sources if source == PurePosixPath(name).name]
        if digests:
            yield name, digest if digest in digests else digests[0]
        if PurePosixPath(name).name == SUMS:
            yield name, ""
            for line in filter(None, read_text(folder / name, "list of hashes").splitlines()):
                stated, _, file = line.partition(" ")
                yield _inside(name, file[1:]), stated.lower()
    for name, data in records.items():
        yield name, ""
        for file, digest in data.get("outputs", {}).items():
            yield _inside(name, file), digest


def _inputs(record: WholeRecord) -> dict[str, tuple[str, str]]:
    return {role: (name, digest) for role, (name, digest) in record.get("inputs", {}).items()}


def _inside(record: str, file: str) -> str:
    """Return a file named in a record as seen from the delivery's folder."""
    parts = PurePosixPath(file).parts
    if not parts or ".." in parts or file[0] in "/\\" or ":" in parts[0]:
        raise InputError(f"{record}: names {file!r:.80}, outside its folder; it may not.")
    return (PurePosixPath(record).parent / file).as_posix()


def _judged(hashes: Mapping[str, str], listed: Mapping[str, str]) -> Iterator[FileState]:
    for name in {**listed, **hashes}:
        if name not in hashes:
            yield FileState(file=name, state="missing")
        elif name not in listed:
            yield FileState(file=name, state="not listed")
        elif PurePosixPath(name).name == SUMS:
            yield FileState(file=name, state="unchanged")
        elif listed[name]:
            same = hashes[name] == listed[name]
            yield FileState(file=name, state="unchanged" if same else "changed")


def _broken(records: Mapping[str, WholeRecord]) -> Iterator[FileState]:
    """Yield each record: does what it tells follow from the records before it?"""
    for name, data in records.items():
        if not data:
            yield FileState(file=name, state="changed", why="cannot be read")
            continue
        parent = PurePosixPath(name).parent.parent
        places = {step: (parent / step / RECORD).as_posix() for step in data["after"]}
        lost = [place for place in places.values() if place not in records]
        yield from (FileState(file=place, state="missing") for place in lost)
        earlier = {step: records[place].get("outputs", {}) for step, place in places.items()
                   if place not in lost}  # fmt: skip
        if lost or record_key(data, earlier) == data["key"]:
            yield FileState(file=name, state="unchanged")
        else:
            why = "does not follow from the steps before it"
            yield FileState(file=name, state="changed", why=why)


def _is_pair_of(title: str, name: str) -> bool:
    return PurePosixPath(name).name == f"{title}{_PAIR}"


def _worked(
    folder: Path, hashes: Mapping[str, str], listed: Mapping[str, str], path: Path
) -> Iterator[WorkedPoint]:
    """Yield the worked point of each report, computed from the pair file beside it."""
    for name in (one for one in hashes if one.endswith("_report.html")):
        title = PurePosixPath(name).name.removesuffix("_report.html")
        pairs, points = [], []
        for file in hashes:
            # Damaged ones are told of as changed files; the point then fails.
            with suppress(InputError):
                if _is_pair_of(title, file):
                    pairs.append(Pair.read(folder / file))
                if PurePosixPath(file).name in (f"{title}_points.xlsx", f"{title}_points.csv"):
                    points.append(read_survey_points(folder / file)[0].xyz)
        point = None
        with suppress(InputError, UnicodeDecodeError):
            page = (folder / name).read_text(encoding="utf-8")
            point = recomputed(page, pairs, points, name)
        if (
            point is not None
            and "/" not in name
            and not any(_is_pair_of(title, file) for file in listed)
        ):
            raise InputError(remark("campaign.part_of_delivery", of=path, report=name))
        if point is not None:
            yield point


def _remade(
    folder: Path, records: Mapping[str, WholeRecord], sources: Path | None, progress: Progress
) -> Iterator[FileState]:
    """Yield every product of every pair, made anew."""
    for parent in dict.fromkeys(PurePosixPath(name).parent.parent for name in records):
        steps = {
            PurePosixPath(name).parent.name: data
            for name, data in records.items()
            if PurePosixPath(name).parent.parent == parent and data
        }
        if FIRST_STEP not in steps or any("pair" in data["inputs"] for data in steps.values()):
            why = "made of several pairs"
            yield from (
                FileState(file=(parent / step).as_posix(), state=_LEFT, why=why) for step in steps
            )
            continue
        with temporary_folder() as place:
            job = _job(folder, folder / parent, steps, sources, place)
            facade(job, progress=progress)
            for step, data in steps.items():
                anew = read_record(job.folder / step)
                for file, digest in data["outputs"].items():
                    same = anew is not None and anew.outputs.get(file) == digest
                    by = "" if same else f" by {program()}, was by {data['program']}"
                    yield FileState(
                        file=(parent / step / file).as_posix(),
                        state="unchanged" if same else "changed", why=f"made anew{by}",
                    )  # fmt: skip


def _job(
    root: Path, folder: Path, steps: Mapping[str, WholeRecord], sources: Path | None, place: Path
) -> PairJob:
    """Return the work that the records of a pair tell of, with copies of all that went in."""
    pair = next((name for name in steps[FIRST_STEP]["outputs"] if name.endswith(_PAIR)), "")
    options = {key: value for data in steps.values() for key, value in data["options"].items()}
    inputs = {role: file for data in steps.values() for role, file in _inputs(data).items()}
    photos = Pair.read(folder / FIRST_STEP / pair)
    if not {"far", "near"} <= set(inputs):
        raise InputError(f"{folder / FIRST_STEP / RECORD}: lacks the photos; it may not.")
    # The pair file names the photos as seen from its folder: they must lie there again.
    ways = [photos.image1.file, photos.image2.file]
    up = min(max(way.count("..") for way in ways), 32)
    home = place.joinpath(*["up"] * up, "delivery")
    files: dict[str, Path] = {}
    for role, (name, digest) in inputs.items():
        way = next((way for way in ways if PurePosixPath(way).name == name), "")
        target = Path(os.path.normpath(home / FIRST_STEP / way))
        if role not in ("far", "near") or not way or not target.is_relative_to(place):
            target = place / "inputs" / role / name
        source = _source(name, digest, [folder / FIRST_STEP / way], folder, [root, sources])
        target.parent.mkdir(parents=True, exist_ok=True)
        files[role] = Path(shutil.copyfile(source, target))
    return PairJob(
        name=str(options.get("title", pair.removesuffix(_PAIR))), folder=home,
        far=files.pop("far"), near=files.pop("near"), date=steps[FIRST_STEP]["date"],
        files={role: path for role, path in files.items() if role in FILES},
        options={key: value for key, value in options.items() if key != "title"},
        told={step: record for step in steps if (record := read_record(folder / step))},
        products=tuple(product for product in PRODUCTS if product in steps),
    )  # fmt: skip


def _source(
    name: str, digest: str, near: list[Path], folder: Path, within: list[Path | None]
) -> Path:
    """Return the file of this name and hash that went in."""
    with suppress(InputError):
        near += map(Path, read_object(folder / ".hashes.json", what="list of hashes"))
    for path in chain(near, *(place.rglob(name) for place in within if place is not None)):
        if path.name == name and path.is_file() and file_hash(path) == digest:
            return path
    raise InputError(remark("campaign.input_lost", of=name, digest=digest[:12]))
