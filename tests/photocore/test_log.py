"""-q, -v and --log: said once, kept in a file, never over a file that is no log."""

from __future__ import annotations

import logging

import pytest
from click.testing import CliRunner

from tests.builders.commands import bifocal_command as main
from tests.full_disk import full_after

SURVEY = "id,s1 [mm],s2 [mm],theta [deg]\nP1,4.24242424,4.47058824,90\n"


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text(SURVEY, encoding="utf-8")
    return path


def solve(table, *options: object, before: tuple[str, ...] = ()):
    words = [*before, "solve", str(table), "--d1", "17.5", "--d2", "9.5", *map(str, options)]
    return CliRunner().invoke(main, words)


def test_quiet_leaves_results_and_errors_only(table, tmp_path):
    assert "c_1 and c_2 are not given" in solve(table).stderr
    for result in (solve(table, "-q"), solve(table, before=("--quiet",))):
        assert result.exit_code == 0
        assert result.stderr == ""
        assert "P1" in result.stdout
    failed = solve(tmp_path / "absent.csv", "-q")
    assert failed.exit_code == 1
    assert failed.stderr.count("absent.csv") == 1


def test_verbose_tells_what_is_written_and_remarks_once(table, tmp_path):
    out = tmp_path / "r.csv"
    result = solve(table, "-v", "--out", out)
    assert f"written: {out}" in result.stderr
    assert result.stderr.count("c_1 and c_2 are not given") == 1
    assert f"written: {out}" not in solve(table, "--out", out, "--overwrite").stderr


def test_the_log_gathers_runs_with_their_remarks_and_errors(table, tmp_path):
    log = tmp_path / "work.log"
    assert solve(table, "--log", log, "--out", tmp_path / "r.csv").exit_code == 0
    assert solve(tmp_path / "absent.csv", "--log", log).exit_code == 1
    text = log.read_text(encoding="utf-8")
    assert text.count("# log of bifocal ") == 2
    for part in ("INFO", "r.csv", "c_1 and c_2 are not given", "ERROR", "absent.csv"):
        assert part in text
    assert not logging.getLogger("photocore").handlers


@pytest.mark.parametrize("before", [True, False])
def test_a_file_that_is_no_log_is_left_as_it_is(table, before):
    options = ("--log", str(table))
    result = solve(table, before=options) if before else solve(table, *options)
    assert result.exit_code == 2
    assert "is no log of this program" in result.stderr
    assert table.read_text(encoding="utf-8") == SURVEY


def test_a_log_in_a_folder_that_is_not_there_is_refused(table, tmp_path):
    result = solve(table, "--log", tmp_path / "no" / "work.log")
    assert result.exit_code == 2
    assert "cannot be written" in result.stderr


def test_a_log_is_no_output(table, tmp_path):
    for name in ("r.csv", "r.xlsx"):
        out = tmp_path / name
        result = solve(table, "--log", out, "--out", out, "--overwrite")
        assert result.exit_code == 1
        assert f"{out}: is the log of this command; name two files." in result.stderr
        assert out.read_text(encoding="utf-8").startswith("# log of bifocal ")


def test_a_log_that_cannot_go_on_says_so_once_and_the_work_is_done(table, tmp_path):
    """The disk is full after the first line of the log, which was no output of its own."""
    log = tmp_path / "work.log"
    options = ("--log", log, "--out", tmp_path / "r.csv", "--overwrite")
    solve(table, *options)
    room = log.stat().st_size + len(log.read_bytes().splitlines()[0]) + 20
    with full_after(room):
        result = solve(table, *options)
    assert result.exit_code == 0, result.stderr
    assert result.stderr.count("ends here") == 1
    assert str(log) in result.stderr
    assert "Traceback" not in result.stderr


def test_the_doctor_names_what_is_there_and_what_to_install(monkeypatch):
    from photocore import machine

    monkeypatch.setattr(machine, "EXTRAS", {"cluster": ("dask", "no-such-package")})
    result = CliRunner().invoke(main, ["doctor"])
    assert result.exit_code == 0
    for part in ("bifocal ", "Python", "numpy", "GDAL", "free memory", "no-such-package absent",
                 'pip install ".[cluster]"'):  # fmt: skip
        assert part in result.stdout
