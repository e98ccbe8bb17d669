"""What the commands say when something goes wrong that nobody foresaw."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner, Result

from bifocal import InputError
from photocore import cli
from tests.builders.commands import bifocal_command, multimedia_command
from tests.cases import few_by_default

pytest_plugins = ["pytester"]

PROGRAMS = {"bifocal": bifocal_command, "multimedia": multimedia_command}


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch):
    """Return a function that runs ``work`` as a command of a program."""

    def run_command(error: BaseException, *words: str) -> Result:
        @click.command()
        def command() -> None:
            raise error

        module = SimpleNamespace(command=command)
        monkeypatch.setattr(cli, "import_module", lambda name: module)  # noqa: ARG005
        group = cli.LazyGroup(
            name="main", commands_package="multimedia.cli", summaries={"work": "Work."}
        )
        return CliRunner().invoke(group, words or ["work"])

    return run_command


FAULTS = [
    KeyError("depth"),
    ZeroDivisionError("division by zero"),
    AssertionError(),
    RecursionError("maximum recursion depth exceeded"),
    RuntimeError("first line\nsecond line"),
    UserWarning("w"),
]


@pytest.mark.parametrize("error", FAULTS, ids=lambda e: type(e).__name__)
def test_a_fault_of_the_program_is_one_line_that_owns_it(run, unforeseen, error) -> None:
    result = run(error)
    assert result.exit_code == 70
    assert isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"Error: multimedia work failed on something nobody foresaw ("
                           f"{type(error).__name__}")  # fmt: skip
    assert "The fault is the program's, not yours" in line
    assert "--debug" in line
    assert " ".join(str(error).split()) in line
    assert len(unforeseen.taken()) == 1


@pytest.mark.parametrize("words", [("--debug", "work"), ("work", "--debug")])
def test_debug_shows_where_it_happened(run, unforeseen, words: tuple[str, str]) -> None:
    result = run(KeyError("depth"), *words)
    assert result.exit_code == 70
    assert result.stderr.startswith("Traceback (most recent call last):")
    assert "in command" in result.stderr
    assert result.stderr.splitlines()[-1].startswith("Error: multimedia work failed")
    assert unforeseen.taken()


def test_a_very_long_error_stays_one_readable_line(run, unforeseen) -> None:
    result = run(ValueError("x" * 100_000))
    assert len(result.stderr) < 600
    assert unforeseen.taken()


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (InputError("a.csv: no."), 1, "Error: a.csv: no."),
        (FileNotFoundError(2, "No such file", "b.csv"), 1, "Error: b.csv: No such file."),
        (KeyboardInterrupt(), 1, "Stopped by the user"),
        (MemoryError(), 1, "not enough memory"),
        (ImportError("a.so: failed to map segment from shared object"), 1, "not enough memory"),
        (click.UsageError("no such thing"), 2, "no such thing"),
        (click.Abort(), 1, "Aborted"),
        (click.exceptions.Exit(0), 0, ""),
    ],
    ids=lambda v: type(v).__name__ if isinstance(v, BaseException) else "",
)
def test_what_was_foreseen_keeps_its_message_and_status(run, error, status, message) -> None:
    result = run(error)
    assert result.exit_code == status
    assert message in result.stderr
    assert "nobody foresaw" not in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows limits no process so")
def test_too_little_memory_is_said_before_a_library_dies_of_it() -> None:
    words = "index --wavelength 520 --temperature 20 --salinity 0 --depth 1"
    line = f'ulimit -v 350000; exec "{sys.executable}" -m multimedia {words}'
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "Error: only 342 MB of memory are allowed here" in done.stderr


def test_debug_shows_where_bad_input_was_met_too(run) -> None:
    result = run(InputError("a.csv: no."), "work", "--debug")
    assert result.exit_code == 1
    assert "Traceback" in result.stderr
    assert result.stderr.endswith("Error: a.csv: no.\n")


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_command_has_the_option_once(program: str) -> None:
    group = PROGRAMS[program]
    for _ in range(2):
        for name in group.summaries:
            command = group.get_command(click.Context(group), name)
            assert sum("--debug" in p.opts for p in command.params) == 1, name
    assert "--debug" in CliRunner().invoke(group, ["--help"]).stdout


FAULTY = """
import sys
from types import SimpleNamespace
import click
from photocore import cli

@click.command()
def command():
    raise KeyError("depth")

cli.import_module = lambda name: SimpleNamespace(command=command)
cli.LazyGroup(name="main", commands_package="bifocal.cli", summaries={"work": "."})(["work"])
"""


def test_a_process_that_ends_so_is_noticed_by_every_test(unforeseen) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FAULTY], capture_output=True, text=True, check=False
    )
    assert done.returncode == 70
    assert done.stderr.startswith("Error: bifocal work failed")
    (met,) = unforeseen.taken()
    assert met.startswith("exit status 70")


@pytest.mark.acceptance
def test_a_test_fails_that_ends_in_the_handler(
    pytester: pytest.Pytester, request, monkeypatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(request.config.rootpath))  # what conftest.py imports
    conftest = request.config.rootpath / "tests" / "conftest.py"
    pytester.makeconftest(conftest.read_text(encoding="utf-8"))
    pytester.makepyfile(
        f"""
        import subprocess, sys
        from click.testing import CliRunner

        FAULTY = {FAULTY!r}

        def test_in_this_process():
            names = {{"__name__": "faulty"}}
            exec(FAULTY.rpartition("cli.LazyGroup")[0], names)
            group = names["cli"].LazyGroup(
                name="main", commands_package="bifocal.cli", summaries={{"work": "."}}
            )
            assert CliRunner().invoke(group, ["work"]).exit_code

        def test_in_another_process():
            assert subprocess.run([sys.executable, "-c", FAULTY]).returncode

        def test_that_has_nothing_to_do_with_it():
            pass
        """
    )
    result = pytester.runpytest_subprocess("-p", "no:randomly", "-n", "0")
    result.assert_outcomes(passed=3, errors=2)


def test_a_name_that_the_terminal_cannot_show_is_shown_in_code(tmp_path) -> None:
    picks = tmp_path / "p.csv"
    picks.write_text("id,x1,y1,x2,y2\n\u6771,3,2,3.2,2.13\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "bifocal", "solve", str(picks), "--d1", "17.5", "--d2", "9.5"],
        capture_output=True, check=False, env={**os.environ, "PYTHONIOENCODING": "latin-1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert rb"\u6771" in done.stdout


PIPES = [
    "bifocal solve p.csv --d1 17.5 --d2 9.5",
    "bifocal solve p.xlsx",
    "bifocal solve p.ods",
    "bifocal relief p.pair.json --out r.tif",
    "multimedia project p.toml --out o.csv",
    "multimedia shift p.csv --json",
    "multimedia bathymetry p.las --water-level 1 --index 1.34 --out o.las",
]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("line", few_by_default(PIPES, PIPES[0], PIPES[4]))
def test_a_pipe_that_nobody_writes_to_does_not_hang(tmp_path, line: str) -> None:
    program, command, name, *options = line.split()
    os.mkfifo(tmp_path / name)  # without a process: `tests/attack`, with every command
    done = subprocess.run(
        [sys.executable, "-m", program, command, name, *options],
        capture_output=True, text=True, check=False, cwd=tmp_path, timeout=60,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert name in done.stderr
