"""What an earlier delivery left in a pair's folder and does not belong to what is made now."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress

from bifocal.campaigns.pair_steps import photo_roles, steps_of
from bifocal.campaigns.step_store import WholeRecord, read_whole_record, record_key, remove_made
from bifocal.campaigns.surveyed_pair import FIRST_STEP, PRODUCTS, PairJob
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.provenance import FileHashes


def refuse_other_delivery(job: PairJob) -> None:
    """Refuse a folder that holds what was made from other photos, unless it may be overwritten.

    Photos are known by their contents. One more in a set, or one less, makes no other delivery.

    Raises
    ------
    InputError
        Naming the photos that it is of.
    """
    if job.overwrite:
        return
    hashes = FileHashes(job.folder / ".hashes.json")
    now = {hashes(path) for path in job.photos}
    for record in _records(job).values():
        inputs = [tuple(record["inputs"][role]) for role in photo_roles(record["inputs"])]
        then = {digest for _, digest in inputs}
        if not (then <= now or now <= then):
            photos = ", ".join(name for name, _ in inputs)
            raise InputError(remark("campaign.other_delivery", of=job.folder, photos=photos))


def remove_leftovers(job: PairJob, made: Collection[str]) -> tuple[str, ...]:
    """Remove the products of steps that do not follow from what a pair holds now.

    A step that was not asked for this time stays while it follows from the steps before it and
    from the files that went into them; one that was asked for and cannot be made, as points
    without a table, does not. Files that were changed, or are not ours, stay.

    Parameters
    ----------
    job : PairJob
    made : collection of str
        Steps that were made now, or kept.

    Returns
    -------
    tuple of str
        What was removed and what stays, each with its step.
    """
    in_vain = set(job.products) - {step.name for step in steps_of(job)}
    records = _records(job)
    inputs: dict[str, list[str]] = {}
    for name in records.keys() & set(made):
        inputs |= records[name]["inputs"]
    standing: dict[str, Mapping[str, str]] = {}
    sentences = []
    for name, record in records.items():
        current = {role: inputs.get(role, recorded) for role, recorded in record["inputs"].items()}
        if name in made or (
            name not in in_vain and current == record["inputs"] and _follows(record, standing)
        ):
            standing[name] = record["outputs"]
            continue
        hashes = FileHashes(job.folder / ".hashes.json")
        staying = remove_made(job.folder / name, record["outputs"], hashes)
        removed = [one for one in record["outputs"] if one not in staying]
        if removed:
            sentences.append(f"{name}: {remark('campaign.removed', files=', '.join(removed))}")
        if staying:
            sentences.append(f"{name}: {remark('campaign.stays', files=', '.join(staying))}")
    return tuple(sentences)


def _records(job: PairJob) -> dict[str, WholeRecord]:
    """Return the records of the steps in a pair's folder, in the order of work."""
    records = {}
    for name in (FIRST_STEP, *PRODUCTS):
        record = read_whole_record(job.folder / name)
        if {"program", "step", "key", "inputs", "after", "options", "outputs"} <= record.keys():
            records[name] = record
    return records


def _follows(record: WholeRecord, standing: Mapping[str, Mapping[str, str]]) -> bool:
    with suppress(KeyError):  # a step before it is not there
        key = record_key(record, {name: standing[name] for name in record["after"]})
        return bool(key == record["key"])
    return False
