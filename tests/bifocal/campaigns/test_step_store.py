"""Steps are made once, anew when what went in changed, and never over what is the user's."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from bifocal import InputError
from bifocal.campaigns import step_store
from bifocal.campaigns.folder_locks import LOCK, locked
from bifocal.campaigns.step_store import (
    MARK,
    RECORD,
    Step,
    clean,
    is_current,
    read_record,
    run_step,
)
from photocore.cli import no_progress
from photocore.provenance import FileHashes
from tests.full_disk import full_after


class Kitchen:
    """A step that copies its input, counts its runs, and may be told to break."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.runs, self.fault, self.name = folder, 0, None, "out.txt"
        self.source = folder / "source.txt"
        self.source.write_text("one")

    def step(self, **options: object) -> Step:
        def make(place: Path, progress: object) -> tuple[str, ...]:  # noqa: ARG001
            self.runs += 1
            (place / self.name).write_text(f"{self.source.read_text()} {options}")
            if self.fault:
                raise self.fault
            return ("done",)

        return Step(name="cook", files={"source": self.source}, options=options, make=make)

    def run(self, *, overwrite: bool = False, **options: object) -> bool:
        """Return whether it was made anew."""
        hashes = FileHashes(self.folder / ".hashes.json")
        step, before = self.step(**options), self.runs
        key = step_store.step_key(step, {}, hashes)
        home = self.folder / "out"
        if not is_current(home / "cook", read_record(home / "cook"), key, hashes):
            run_step(home, step, key, hashes, progress=no_progress, overwrite=overwrite)
        hashes.save()
        return self.runs > before


@pytest.fixture
def kitchen(tmp_path):
    return Kitchen(tmp_path)


def test_a_step_runs_again_only_when_content_or_options_change(kitchen):
    assert kitchen.run()
    assert not kitchen.run()
    os.utime(kitchen.source, (1e9, 1e9))  # another time, the same content
    assert not kitchen.run()
    kitchen.source.write_text("two")
    assert kitchen.run()
    assert kitchen.run(scale=50)
    assert not kitchen.run(scale=50)
    (kitchen.folder / "out/cook/out.txt").unlink()
    assert kitchen.run(scale=50)


def test_a_file_the_user_changed_is_not_replaced_unless_told_to(kitchen):
    kitchen.run()
    result = kitchen.folder / "out/cook/out.txt"
    result.write_text("mine, and longer")
    with pytest.raises(InputError, match=r"out\.txt: was changed after it was made.*--overwrite"):
        kitchen.run()
    assert result.read_text() == "mine, and longer"
    assert kitchen.run(overwrite=True)


def test_files_the_user_added_move_along(kitchen):
    kitchen.run()
    (kitchen.folder / "out/cook/notes.txt").write_text("mine")
    kitchen.source.write_text("two")
    assert kitchen.run()
    assert (kitchen.folder / "out/cook/notes.txt").read_text() == "mine"


def test_a_folder_of_somebody_else_is_left_alone(kitchen):
    (kitchen.folder / "out/cook").mkdir(parents=True)
    (kitchen.folder / "out/cook/thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="files that this survey did not make"):
        kitchen.run()
    assert [p.name for p in (kitchen.folder / "out/cook").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("fault", [InputError("no"), KeyboardInterrupt(), MemoryError()])
def test_whatever_breaks_a_step_leaves_the_old_result(kitchen, fault):
    kitchen.run()
    kitchen.source.write_text("two")
    kitchen.fault = fault
    with pytest.raises(type(fault)):
        kitchen.run()
    assert (kitchen.folder / "out/cook/out.txt").read_text().startswith("one")
    assert [p.name for p in (kitchen.folder / "out").iterdir()] == ["cook"]


class Killed(BaseException):
    """What no `finally` of a killed process sees."""


@pytest.mark.parametrize("renames", [0, 1, 2])
def test_a_killed_run_is_cleaned_up_at_whatever_moment(kitchen, monkeypatch, renames):
    kitchen.run()
    home = kitchen.folder / "out"
    kitchen.source.write_text("two")
    left = iter(range(renames))
    rename = Path.rename

    def until_killed(path, target):
        if next(left, None) is None:
            raise Killed
        return rename(path, target)

    def killed(*_, **__):
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", until_killed)
        patch.setattr(step_store.shutil, "rmtree", lambda *_, **__: None)
        patch.setattr(Path, "unlink", killed)
        with pytest.raises(Killed):
            kitchen.run()
    assert len(list(home.iterdir())) == 2
    clean(home)
    assert [p.name for p in home.iterdir()] == ["cook"]
    text = (home / "cook/out.txt").read_text()
    assert text.startswith("two" if renames == 2 else "one")
    clean(home)
    assert kitchen.run() == (renames < 2)


@pytest.mark.parametrize(
    "name", [".cook.old", ".diary.old", ".thesis-writing-x1", ".thesis-old-x1", ".cook-old-x1"]
)
def test_hidden_folders_of_the_user_stay_as_they_are(kitchen, name):
    kitchen.run()
    home = kitchen.folder / "out"
    # Even a copy of what is ours, marks and all, is the user's.
    shutil.copytree(home / "cook", home / name)
    (home / name / MARK).write_text('{"format": "bifocal-step/1", "passing": ".cook-old-x2"}')
    (home / name / "thesis.txt").write_text("mine")
    clean(home)
    kitchen.source.write_text("two")
    assert kitchen.run()
    assert (home / name / "thesis.txt").read_text() == "mine"
    assert {p.name for p in home.iterdir()} == {"cook", name}


def test_empty_folders_and_links_of_the_user_move_along(kitchen):
    kitchen.run()
    (kitchen.folder / "out/cook/for later").mkdir()
    (kitchen.folder / "out/cook/link").symlink_to("nowhere")
    kitchen.source.write_text("two")
    assert kitchen.run()
    assert (kitchen.folder / "out/cook/for later").is_dir()
    assert (kitchen.folder / "out/cook/link").is_symlink()


def test_a_file_the_user_added_under_a_name_of_ours_is_not_lost(kitchen):
    kitchen.run()
    (kitchen.folder / "out/cook/two.txt").write_text("mine")
    kitchen.name = "two.txt"
    with pytest.raises(InputError, match=r"two\.txt: is not this survey's.*--overwrite"):
        kitchen.run(scale=50)
    assert (kitchen.folder / "out/cook/two.txt").read_text() == "mine"
    assert kitchen.run(scale=50, overwrite=True)


def test_the_record_says_what_was_made_from_what(kitchen):
    kitchen.run(scale=50)
    record = json.loads((kitchen.folder / "out/cook" / RECORD).read_text())
    assert record["options"] == {"scale": 50}
    # sha256 of "one": `printf one | sha256sum`.
    digest = "7692c3ad3540bb803c020b3aee66cd8887123234ea0c6e7143c0add73ff431ed"
    assert record["inputs"] == {"source": ["source.txt", digest]}
    assert list(record["outputs"]) == ["out.txt"]
    assert record["program"].startswith("bifocal ")


def test_hashes_that_the_disk_does_not_take_leave_nothing(tmp_path):
    path = tmp_path / "photo.jpg"
    path.write_bytes(b"photo")
    os.utime(path, (1e9, 1e9))
    hashes = FileHashes(tmp_path / ".hashes.json")
    hashes(path)
    with full_after(0):
        hashes.save()
    assert list(tmp_path.iterdir()) == [path]


def test_what_breaks_a_step_is_told_of_the_folder_that_the_user_knows(kitchen):
    def make(place, progress):  # noqa: ARG001
        raise InputError(f"{place / 'out.tif'}: could not be written.")

    step = Step(name="cook", files={}, make=make)
    with pytest.raises(InputError) as refusal:
        run_step(
            kitchen.folder, step, "key", FileHashes(kitchen.folder / "h"), progress=no_progress
        )
    assert str(refusal.value) == f"{kitchen.folder / 'cook' / 'out.tif'}: could not be written."


@pytest.mark.parametrize("lock", ["~$points.xlsx", ".~lock.points.xlsx#"])
def test_a_workbook_that_is_open_is_not_replaced(kitchen, lock):
    kitchen.run()
    folder = kitchen.folder / "out" / "cook"
    (folder / "points.xlsx").write_text("open")
    (folder / lock).touch()
    kitchen.source.write_text("two")
    with pytest.raises(InputError, match=r"points\.xlsx: is open in"):
        kitchen.run(overwrite=True)
    assert kitchen.runs == 1
    (folder / lock).unlink()
    assert kitchen.run()


def test_a_lock_of_somebody_else_is_left_alone(tmp_path):
    (tmp_path / LOCK).write_text("my own notes")
    with pytest.raises(InputError, match="is not this program's"), locked([tmp_path]):
        pass
    assert (tmp_path / LOCK).read_text() == "my own notes"
    (tmp_path / LOCK).write_text("")  # killed before it said whose
    with locked([tmp_path]):
        assert (tmp_path / LOCK).read_text()
    assert not (tmp_path / LOCK).exists()
