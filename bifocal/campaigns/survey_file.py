"""The survey file: pairs, lens files, control, products and scales in one readable TOML file."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import TypedDict, TypeGuard

from bifocal.campaigns.surveyed_pair import PRODUCTS, PairJob, tables_of
from bifocal.options import FILES, JOINT, OF_PAIR
from bifocal.options.commands import MosaicCommand
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.names import on_disk
from photocore.options import options_of
from photocore.textfile import file_name, read_toml

FORMAT = "bifocal-survey/1"


#: An option of the command line with its value.
_VALUE = r"(?:[a-z]+\d?=[\d.e+-]*\d|[A-Z]+|\d[\d.]*\d|\d)"
_OPTION = re.compile(rf"(?<![\w-])--([a-z][a-z0-9-]*)(?: ({_VALUE}(?:,{_VALUE})*)\b)?")
#: What names a pair and its photos.
OF_PHOTOS = ("name", "far", "near", "photos")
#: What may be said of the mosaic of all pairs, as on the command line of `bifocal mosaic`.
OF_MOSAIC = ("gsd", "bounds", "priority", "gain", "blend", "overviews")
#: What is made of all pairs together, each in a folder of its own: keys above the pairs.
WHOLE = ("joint", "mosaic")


def mosaic_wanted(path: Path) -> dict[str, object] | None:
    """Return the options of the mosaic that a checked survey file asks for; None: it wants none."""
    mosaic = _parsed(path).get("mosaic")
    return _options_of_mosaic(mosaic, []) if isinstance(mosaic, dict) else {} if mosaic else None


def _options_of_mosaic(table: Mapping[str, object], faults: list[str]) -> dict[str, object]:
    """Return what is said of the mosaic, noting what is wrong."""
    options, values = options_of(MosaicCommand), dict[str, object]()
    for key, value in table.items():
        try:
            if key not in OF_MOSAIC:
                raise ValueError(f"no such key there, but {', '.join(OF_MOSAIC)}")
            values[key] = options[key].read(value)
        except ValueError as error:
            faults.append(f"above the pairs: mosaic, {key} = {value!r}: expected {error}.")
    return values


def read_survey_file(
    path: Path, *, out: Path | None = None, overwrite: bool = False
) -> list[PairJob]:
    """Return the pairs of a survey file, everything in it checked.

    Parameters
    ----------
    path : Path
        TOML; files in it are relative to it. What stands above the first ``[[pair]]`` holds for
        every pair that does not say otherwise.
    out : Path, optional
        Folder of the results; default ``out`` of the file, else ``results`` beside it.
    overwrite : bool
        Of every job.

    Raises
    ------
    InputError
        Naming everything that is wrong at once.
    """
    data = _parsed(path)
    faults: list[str] = []
    pairs = data.pop("pair", None)
    for key in ("format", "name"):
        data.pop(key, None)
    folder = out or path.parent / str(data.pop("out", "results"))
    data.pop("out", None)
    whole = {key: data.pop(key, False) for key in WHOLE}
    if isinstance(whole["mosaic"], dict):
        _options_of_mosaic(whole["mosaic"], faults)
        whole["mosaic"] = True
    faults += [
        f"above the pairs: {key} = {value!r}: expected true or false."
        for key, value in whole.items()
        if not isinstance(value, bool)
    ]
    if not isinstance(pairs, list) or not pairs:
        raise InputError(f"{path}: has no [[pair]]; add one with name, far and near.")
    common = _entries(data, path.parent, "above the pairs", faults)
    jobs = []
    for number, entry in enumerate(pairs, start=1):
        where = f"pair {entry.get('name', number)}" if isinstance(entry, dict) else f"pair {number}"
        if not isinstance(entry, dict):
            faults.append(f"{where}: is no table; write [[pair]].")
            continue
        job = _job(entry, number, common, (path.parent, folder), where, faults)
        if job is not None:
            joint = folder / "joint" if whole["joint"] else None
            jobs.append(replace(job, overwrite=overwrite, joint=joint))
    folders = [job.folder.name.casefold() for job in jobs]
    faults += _faults_of_whole(jobs, whole)
    for job in jobs:
        if folders.count(job.folder.name.casefold()) > 1:
            faults.append(f"pair {job.name}: another pair has the same name; give each its own.")
    if faults:
        raise InputError("\n".join(f"{path}: {fault}" for fault in dict.fromkeys(faults)))
    return jobs


def in_survey_words(text: str) -> str:
    """Return advice to use options of the command line as keys of the survey file.

    Examples
    --------
    >>> in_survey_words("give --control FILE, or --focal1 35 and --sensor-width 23.5; --jobs 2.")
    'give control = "FILE", or focal1 = 35 and sensor_width = 23.5; --jobs 2.'
    >>> in_survey_words("(--prior index3=0.005)")
    '(prior = ["index3=0.005"])'
    >>> in_survey_words("name a spot with --wall COL,ROW, or --auto with one of --distance1.")
    'name a spot with wall = [COL, ROW], or auto = true with one of distance1.'
    """
    flags = {option.flag[2:]: option for option in OF_PAIR.values()}

    def key_of(match: re.Match[str]) -> str:
        option, value = flags.get(match[1]), match[2]
        if option is None:
            return match[0]
        key = option.name
        if option.is_switch:
            return f"{key} = true" + (f" {value}" if value else "")
        if value is None:
            return key
        if option.attributes.get("multiple") and "," not in value:
            return f'{key} = ["{value}"]'
        listed = f"[{value.replace(',', ', ')}]" if "," in value else value
        return f'{key} = "{value}"' if key in FILES else f"{key} = {listed}"

    return _OPTION.sub(key_of, text)


def _faults_of_whole(jobs: Sequence[PairJob], whole: Mapping[str, object]) -> list[str]:
    """Return what stands against making something of all pairs together."""
    if not any(whole.values()):
        return []
    faults = [
        f"pair {job.name}: joint and mosaic are folders of the whole survey; give it another name."
        for job in jobs
        if job.folder.name.casefold() in WHOLE
    ]
    faults += [
        f"pair {job.name}: is a set, and joint = true adjusts pairs; leave one of them out."
        for job in jobs
        if job.more and whole["joint"]
    ]
    for key in JOINT if whole["joint"] else ():
        if len({job.options.get(key) for job in jobs if tables_of(job)}) > 1:
            faults.append(remark("campaign.tables_differ", of=key))
    return faults


def _parsed(path: Path) -> dict[str, object]:
    data = read_toml(path, "survey file")
    if data.get("format", FORMAT) != FORMAT:
        raise InputError(
            remark("campaign.unknown_format", of=path, format=repr(data["format"]), known=FORMAT)
        )
    return data


def _is_name(value: object) -> TypeGuard[str]:
    """Whether a value may be the name of a file."""
    return isinstance(value, str) and bool(value) and value.isprintable()


class _Entries(TypedDict):
    """What a table says of a pair, or of all."""

    files: dict[str, Path]
    options: dict[str, object]
    products: tuple[str, ...]


def _entries(data: Mapping[str, object], base: Path, where: str, faults: list[str]) -> _Entries:
    """Return files, options and products of a table, noting what is wrong."""
    entries = _Entries(files={}, options={}, products=())
    for key, value in data.items():
        if key in FILES:
            if _is_name(value):
                entries["files"][key] = on_disk(base / value)
            elif value != "":
                faults.append(f"{where}: {key} = {value!r}: expected the name of a file.")
        elif key == "products":
            if not isinstance(value, list) or set(map(str, value)) - set(PRODUCTS):
                faults.append(f"{where}: products: expected some of {', '.join(PRODUCTS)}.")
            else:
                entries["products"] = tuple(name for name in PRODUCTS if name in value)
        elif key in OF_PAIR:
            try:
                entries["options"][key] = OF_PAIR[key].read(value)
            except ValueError as error:
                faults.append(f"{where}: {key} = {value!r}: expected {error}.")
        else:
            near = get_close_matches(key, [*OF_PAIR, "products"], n=1)
            hint = f" Did you mean {near[0]}?" if near else ""
            faults.append(f"{where}: there is no key {key!r}.{hint}")
    return entries


def _job(
    entry: Mapping[str, object],
    number: int,
    common: _Entries,
    folders: tuple[Path, Path],
    where: str,
    faults: list[str],
) -> PairJob | None:
    base, out = folders
    rest = {key: value for key, value in entry.items() if key not in OF_PHOTOS}
    entries = _entries(rest, base, where, faults)
    photos = entry.get("photos", [entry.get(key) for key in ("far", "near")])
    if not isinstance(photos, list) or len(photos) < 2 or not all(map(_is_name, photos)):
        faults.append(f"{where}: far and near, or a list photos, must name its photos.")
        return None
    files = [on_disk(base / photo) for photo in photos]
    places = [os.path.realpath(file) for file in files]
    if len(set(places)) < len(places):
        faults.append(f"{where}: one photo is named twice; name another.")
    if "photos" in entry and {"far", "near"} & entry.keys():
        faults.append(f"{where}: name its photos by far and near or by a list photos, not both.")
    name = str(entry.get("name") or f"pair {number}")
    if not name.strip() or not name.isprintable():
        faults.append(f"{where}: name = {name!r}: expected a name that can be read.")
    far, near, *more = files
    job = PairJob(
        name=name, folder=out / file_name(name), far=far, near=near, more=tuple(more),
        files={**common["files"], **entries["files"]},
        options={**common["options"], **entries["options"]},
    )  # fmt: skip
    products = entries["products"] or common["products"]
    return replace(job, products=products) if products else job
