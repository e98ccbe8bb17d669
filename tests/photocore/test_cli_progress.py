"""Progress where nobody looks at a terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from photocore import cli as console


def test_long_jobs_print_a_line_per_tenth(monkeypatch, capsys):
    monkeypatch.setattr(console, "SILENT_SECONDS", -1.0)
    with console.progress_bar("map") as progress:
        for part in range(101):
            progress(part, 100)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"map: {percent} %" for percent in range(10, 100, 10)]


@pytest.mark.parametrize(("silent", "quiet"), [(60.0, False), (-1.0, True)])
def test_short_and_quiet_jobs_print_nothing(monkeypatch, capsys, silent, quiet):
    monkeypatch.setattr(console, "SILENT_SECONDS", silent)
    with console.progress_bar("map", quiet=quiet) as progress:
        for part in range(101):
            progress(part, 100)
    assert capsys.readouterr().err == ""


def test_files_that_were_written_are_told_and_no_others(capsys):
    console.tell_written(None, Path("wall.xlsx"))
    assert capsys.readouterr().err == "Written: wall.xlsx\n"
