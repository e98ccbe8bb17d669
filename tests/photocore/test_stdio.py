"""`-` for one table on stdin or stdout: what a file would have given, and nothing else there."""

from __future__ import annotations

import csv
import io
import json
import zipfile

import pytest
from click.testing import CliRunner

from bifocal import SAMPLE
from tests.attack.site import ODS, ods_cell
from tests.builders.commands import bifocal_command as main
from tests.builders.commands import multimedia_command as multimedia

TARGETS, PAIR = SAMPLE / "targets.csv", SAMPLE / "facade.pair.json"


def run(words, stdin=None, group=main, status=0):
    result = CliRunner().invoke(group, [str(word) for word in words], input=stdin)
    assert result.exit_code == status, result.stderr
    return result


def test_a_table_goes_through_solve_and_export_without_a_file(tmp_path):
    out = tmp_path / "r.csv"
    run(["solve", TARGETS, "--pair", PAIR, "--out", out])
    piped = run(["solve", "-", "--pair", PAIR, "--out", "-"], stdin=TARGETS.read_bytes())
    assert piped.stdout_bytes == out.read_bytes()
    assert "stdout: 28 points written" in piped.stderr
    run(["export", out, "--out", tmp_path / "p.csv"])
    exported = run(["export", "-", "--out", "-"], stdin=piped.stdout_bytes)
    assert exported.stdout_bytes == (tmp_path / "p.csv").read_bytes()


def test_an_opendocument_table_on_stdin_is_known_by_its_parts(tmp_path):
    rows = (("id", "s1 [mm]", "s2 [mm]"), ("A", 1.0, 1.1))
    with zipfile.ZipFile(tmp_path / "t.ods", "w") as package:
        cells = "".join(f"<table:table-row>{''.join(map(ods_cell, row))}</table:table-row>"
                        for row in rows)  # fmt: skip
        package.writestr("content.xml", ODS.format(rows=cells))
    words = ["solve", "-", "--d1", 17.5, "--d2", 9.5, "--c1", 35, "--c2", 19, "--json"]
    said = run(words, stdin=(tmp_path / "t.ods").read_bytes())
    # Eq. (5): (1.1 - 1.0) / (1.1 / 9.5 - 1.0 / 17.5)
    assert json.loads(said.stdout)["points"][0]["r"] == pytest.approx(1.705128, abs=1e-6)


def test_a_workbook_on_stdin_is_known_by_its_first_bytes(tmp_path):
    book = tmp_path / "r.xlsx"
    run(["solve", TARGETS, "--pair", PAIR, "--out", book])
    said = run(["solve", "-", "--pair", PAIR, "--json"], stdin=book.read_bytes())
    assert len(json.loads(said.stdout)["points"]) == 28


def test_the_other_program_takes_and_gives_a_table():
    table = b"id,X,Y,Z\nP,0.1,0.0,-0.3\n"
    words = ["shift", "-", "--z0", 0.5, "--indices", "1,1.337", "--out", "-"]
    row = next(csv.DictReader(io.StringIO(run(words, table, multimedia).stdout)))
    said = json.loads(run([*words[:-2], "--json"], table, multimedia).stdout)
    # Snell: sin a = 1.337 sin b and 0.5 tan a + 0.3 tan b = 0.1 give tan a = 0.138228; times 0.8 m.
    assert said["points"][0]["Rbar"] == pytest.approx(0.110582, abs=1e-6)
    assert float(row["Rbar"]) == said["points"][0]["Rbar"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve", "-", "-", "--pair", PAIR], "one table"),
        (["solve", "-", "--pair", PAIR, "--out", "-", "--json"], "choose one"),
    ],
)
def test_two_things_on_one_stream_are_refused(words, message):
    result = run(words, stdin=TARGETS.read_bytes(), status=2)
    assert message in result.stderr
    assert result.stdout == ""


def test_a_failure_leaves_stdout_empty():
    result = run(["solve", "-", "--pair", PAIR, "--out", "-"], stdin=b"id,s1\nA,1\n", status=1)
    assert result.stdout == ""
    assert "stdin.csv" in result.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
@pytest.mark.parametrize("program", [main, multimedia], ids=["bifocal", "multimedia"])
def test_the_shell_is_told_how_to_complete_and_what(program, shell):
    name = program.commands_package.partition(".")[0]
    variable = f"_{name.upper()}_COMPLETE"
    source = CliRunner().invoke(program, prog_name=name, env={variable: f"{shell}_source"})
    assert variable in source.stdout
    env = {variable: "bash_complete", "COMP_WORDS": f"{name} s", "COMP_CWORD": "1"}
    said = CliRunner().invoke(program, prog_name=name, env=env).stdout
    assert ("plain,solve" if name == "bifocal" else "plain,shift") in said
    options = {**env, "COMP_WORDS": f"{name} template --ov", "COMP_CWORD": "2"}
    assert "plain,--overwrite" in CliRunner().invoke(program, prog_name=name, env=options).stdout
