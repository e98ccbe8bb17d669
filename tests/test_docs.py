"""Documentation is a contract: commands, options, examples and links."""

from __future__ import annotations

import doctest
import io
import re
import shlex
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from tests.page_commands import IN_PART, command_maker, shown_commands
from tests.tables import each

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([ROOT / "README.md", *DOCS.glob("*.md")])


GROUPS = command_maker().groups()
COMMANDS = [
    pytest.param(program, name, command, id=f"{program} {name}")
    for program, group in GROUPS.items()
    for name, command in command_maker().commands(group).items()
]


def test_the_page_of_commands_is_up_to_date():
    written = (DOCS / "cli.md").read_text(encoding="utf-8")
    assert written == command_maker().page(), "run: python docs/make_cli.py"


@each(("program", "name", "command"), COMMANDS)
def test_every_command_has_a_summary_an_example_and_described_options(program, name, command):
    assert command.short_help == GROUPS[program].summaries[name]
    assert f"{program} {name}" in (command.epilog or ""), "the epilog needs an example"
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.help, f"{program} {name} {parameter.opts[0]} has no help"


@each(("program", "name", "command"), COMMANDS)
def test_every_command_explains_itself_outside_its_own_page(program, name, command):  # noqa: ARG001
    text = "".join(p.read_text(encoding="utf-8") for p in PAGES if p.name != "cli.md")
    assert f"{program} {name}" in text, f"no page but cli.md mentions {program} {name}"


@pytest.mark.parametrize(("program", "name", "command"), COMMANDS)
def test_help_is_printed_without_an_error(program, name, command):  # noqa: ARG001
    result = CliRunner().invoke(GROUPS[program], [name, "--help"])
    assert result.exit_code == 0
    assert "Usage:" in result.stdout


def lines_shown():
    """Return every command line in the pages and in the help: (program, name, words)."""
    found = []
    for shown in (shown for shown in shown_commands() if shown.line not in IN_PART):
        for line in shown.line.split(" | "):
            program, name, *words = shlex.split(line)
            if program in GROUPS and name in GROUPS[program].summaries:
                # What the shell makes of redirections is no word of the program.
                ends = [k for k, word in enumerate(words) if word[0] in "<>"]
                words = words[: min(ends, default=len(words))]
                label = f"{shown.page}: {line[:60]}"
                found.append(pytest.param(program, name, words, id=label))
    return found


@each(("program", "name", "words"), lines_shown())
def test_command_lines_in_the_docs_are_understood(program, name, words, monkeypatch):
    """The program's own parser takes them: names, values and number of what is given."""
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"id\n1\n")))
    group = GROUPS[program]
    command = group.get_command(click.Context(group), name)
    if words == ["--help"]:
        return
    # Click keeps the help option as it is first asked for, and docs/make_cli.py shows it.
    called = {"help_option_names": ["-h", "--help"]}
    with command.make_context(f"{program} {name}", list(words), **called) as context:
        assert context.params


@each("page", PAGES, ids=lambda p: p.name)
def test_links_between_pages_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if not target.startswith(("http", "mailto")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


#: Pages whose examples take more than a moment.
HEAVY = {"dense-relief.md", "underwater-cameras.md"}
PAGES_WITH_PYTHON = [
    pytest.param(page, marks=[pytest.mark.acceptance] if page.name in HEAVY else [])
    for page in PAGES if "```python" in page.read_text(encoding="utf-8")
]  # fmt: skip


@pytest.mark.parametrize("page", PAGES_WITH_PYTHON, ids=lambda p: p.name)
def test_python_examples_run(page, tmp_path, monkeypatch):
    """Examples of a page run in order in an empty folder, its JSON examples written as files."""
    text = page.read_text(encoding="utf-8")
    for number, block in enumerate(re.findall(r"```json\n(.*?)```", text, re.S)):
        kind = re.search(r'"bifocal-(pair|photos)/', block)
        name = f"wall.{kind[1]}.json" if kind else f"example{number}.json"
        (tmp_path / name).write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "example"}
    for code in re.findall(r"```python\n(.*?)```", text, re.S):
        if ">>>" in code:
            example = doctest.DocTestParser().get_doctest(code, names, page.name, str(page), 0)
            runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
            assert runner.run(example, clear_globs=False).failed == 0
            names |= example.globs
        else:
            exec(compile(code, str(page), "exec"), names)


def test_the_page_on_the_architecture_names_only_what_exists() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    paths = re.findall(r"`((?:bifocal|multimedia|photocore|tests|docs|benchmarks)/[\w./]+)`", text)
    assert len(paths) > 20
    missing = [path for path in paths if "NAME" not in path and not (ROOT / path).exists()]
    assert not missing
