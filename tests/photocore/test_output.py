"""Outputs are whole or absent, alone and in sets; what stands in their place is kept as it was."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bifocal import InputError
from photocore import output
from photocore.output import all_or_none, atomic_folder, atomic_path, check_all_writable


def write(path, text, *, overwrite=True):
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text(text)


def write_all(paths):
    with all_or_none():
        for path in paths:
            write(path, "new")


def fill(folder, names, *, overwrite=True):
    with atomic_folder(folder, overwrite=overwrite) as place:
        for name in names:
            (place / name).write_text("new")


def hidden(folder):
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


def test_the_mode_of_a_replaced_file_stays(tmp_path):
    path = tmp_path / "secret.csv"
    path.touch()
    path.chmod(0o600)
    write(path, "new")
    assert path.stat().st_mode & 0o777 == 0o600
    with atomic_folder(tmp_path, overwrite=True) as folder:
        (folder / "secret.csv").write_text("newer")
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.read_text() == "newer"


def test_a_link_is_followed_and_stays_a_link(tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    real, link = folder / "real.csv", tmp_path / "link.csv"
    real.write_text("old")
    link.symlink_to(real)
    write(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_a_link_that_leads_nowhere_is_refused(tmp_path):
    link = tmp_path / "link.csv"
    link.symlink_to(tmp_path / "absent.csv")
    with pytest.raises(InputError, match=r"is a link to .*absent.csv, which does not exist"):
        write(link, "new", overwrite=False)
    assert not (tmp_path / "absent.csv").exists()


def test_the_lock_of_the_file_behind_a_link_counts(tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "real.csv").touch()
    (folder / ".~lock.real.csv#").touch()
    (tmp_path / "link.csv").symlink_to(folder / "real.csv")
    with pytest.raises(InputError, match="is open in LibreOffice"):
        write(tmp_path / "link.csv", "new")


def test_devices_and_pipes_are_refused(tmp_path):
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/null")):
        with pytest.raises(InputError, match="is a device or a pipe"):
            write(path, "new")
    assert pipe.is_fifo()


def test_a_set_appears_together_or_not_at_all(tmp_path):
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    one.write_text("old")
    with pytest.raises(InputError, match="does not exist"):
        write_all([one, tmp_path / "absent" / "two.csv"])
    assert one.read_text() == "old"
    assert sorted(tmp_path.iterdir()) == [one]
    with all_or_none():
        write(one, "new")
        write(two, "new")
        assert not two.exists()
    assert [path.read_text() for path in (one, two)] == ["new", "new"]
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_a_rename_that_fails_puts_the_whole_set_back(tmp_path, monkeypatch):
    names = [tmp_path / name for name in ("a.csv", "b.csv", "c.csv")]
    for path in names[:2]:
        path.write_text("old")
    rename = Path.replace

    def failing(self, target):
        if Path(target) == names[2] and self.read_text() == "new":
            raise OSError(errno.ENOSPC, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(InputError, match="No space left on device"):
        write_all(names)
    assert [path.read_text() for path in names[:2]] == ["old", "old"]
    assert sorted(tmp_path.iterdir()) == names[:2]
    with pytest.raises(InputError, match="No space left"):
        fill(tmp_path, [path.name for path in names])
    assert [path.read_text() for path in names[:2]] == ["old", "old"]
    assert sorted(tmp_path.iterdir()) == names[:2]


def test_two_outputs_of_one_name_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    (tmp_path / "link.csv").symlink_to(path)
    path.touch()
    with pytest.raises(InputError, match="is named for two outputs"):
        check_all_writable(path, None, tmp_path / "link.csv", overwrite=True)
    with pytest.raises(InputError, match="is named for two outputs"):
        write_all([path, tmp_path / "link.csv"])
    assert path.read_text() == ""


def test_what_fails_in_a_folder_is_told_of_the_users_folder(tmp_path):
    with (
        pytest.raises(InputError) as refusal,
        atomic_folder(tmp_path / "made", overwrite=True) as place,
    ):
        write(place / "no" / "a.csv", "new")
    assert f"the folder {tmp_path / 'made' / 'no'} does not exist" in str(refusal.value)
    assert "writing" not in str(refusal.value)


def test_a_folder_that_fails_leaves_no_folder(tmp_path):
    with pytest.raises(ZeroDivisionError), atomic_folder(tmp_path / "a" / "b", overwrite=False):
        1 / 0  # noqa: B018
    assert not list(tmp_path.iterdir())


def test_what_a_killed_run_left_goes_with_the_next(tmp_path):
    script = (
        "import os, signal, sys\n"
        "from photocore.output import atomic_folder, atomic_path\n"
        "with atomic_folder('.', overwrite=False), atomic_path('a.csv', overwrite=False) as path:\n"
        "    path.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=False)
    assert len(hidden(tmp_path)) == 2
    write(tmp_path / "b.csv", "another output")
    assert len(hidden(tmp_path)) == 2
    write(tmp_path / "a.csv", "new")
    assert len(hidden(tmp_path)) == 1
    with atomic_folder(tmp_path, overwrite=False) as folder:
        assert hidden(tmp_path) == [folder.name]
    assert not hidden(tmp_path)


def test_temporary_files_of_running_processes_stay(tmp_path):
    with atomic_path(tmp_path / "a.csv", overwrite=False) as temporary:
        temporary.write_text("mine")
        write(tmp_path / "a.csv", "another thread's")
        assert temporary.exists()
    other = tmp_path / f".a-{output._NODE}-{os.getppid()}-abcdefgh.csv"
    foreign = tmp_path / ".a-abcdef-12345-abcdefgh.csv"
    for path in (other, foreign):
        path.touch()
    write(tmp_path / "a.csv", "new")
    assert other.exists()
    assert foreign.exists()
    # Made by another thread a moment ago, or by an earlier process of the same number.
    own = tmp_path / f".a-{output._NODE}-{os.getpid()}-abcdefgh.csv"
    own.touch()
    write(tmp_path / "a.csv", "new")
    assert own.exists()
    for path in (own, foreign):
        os.utime(path, (0, 0))
    write(tmp_path / "a.csv", "new")
    assert not own.exists()
    assert not foreign.exists()
