"""What a message tells to do about a table is what its command can do."""

import click
import pytest
from click.testing import CliRunner

from bifocal.cli.main import main as bifocal
from multimedia.cli.main import main as multimedia
from photocore.tables.advice import advice

COMMANDS = [(group, name) for group in (bifocal, multimedia) for name in group.summaries]


@pytest.mark.parametrize(("group", "name"), COMMANDS)
def test_an_option_is_offered_by_the_commands_that_have_it_alone(group, name):
    command = group.get_command(click.Context(group), name)
    options = {name for param in command.params for name in param.opts}
    with click.Context(command):
        words = {
            "--columns": advice("rename", first="X"),
            "--control-order": advice("order", "--control-order", keys="id, X"),
            "--decimal": advice("mixed", "--decimal", better="1.5", other="comma"),
        }
    assert {option for option, text in words.items() if option in text} == words.keys() & options


@pytest.mark.parametrize(
    ("text", "advised"),
    [
        ("P1 1.5 2.5 0.25\nP2 2.5 3.5 0.5\n", "Write headings above its columns: id, X, Y, Z"),
        ("id;X;Y;Z\nP1;1,250;2,500;3,750\n", "Write 1.25 or 1250."),
    ],
)
def test_a_command_without_options_for_tables_offers_none(tmp_path, text, advised):
    (tmp_path / "points.csv").write_text(text)
    words = ["export", str(tmp_path / "points.csv"), "--out", str(tmp_path / "points.dxf")]
    done = CliRunner().invoke(bifocal, words)
    assert done.exit_code == 1
    assert advised in done.stderr
    assert " --" not in done.stderr
