"""The site: every page is in it, its references are current, and what its tutorials say runs."""

from __future__ import annotations

import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal.cli.main import main as bifocal
from multimedia.cli.main import main as multimedia

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PROGRAMS = {"bifocal": bifocal, "multimedia": multimedia}
TUTORIALS = sorted([*DOCS.glob("tutorial-*.md"), DOCS / "choosing.md"])
#: Minutes of work rather than seconds.
LONG = ("tutorial-facade.md",)


def test_every_page_is_in_the_navigation_once():
    listed = re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.M)
    assert sorted(listed) == sorted(page.name for page in DOCS.glob("*.md"))


def test_the_page_of_python_names_is_up_to_date():
    spec = importlib.util.spec_from_file_location("make_api", DOCS / "make_api.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    written = (DOCS / "api.md").read_text(encoding="utf-8")
    assert written == maker.page(), "run: python docs/make_api.py"


def test_the_site_is_built_without_a_warning(tmp_path):
    pytest.importorskip("mkdocs")
    pytest.importorskip("material")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    home = (tmp_path / "index.html").read_text("utf-8")
    assert "fonts.googleapis" not in home
    assert not re.findall(r'<(?:script|link)[^>]+(?:src|href)="https?://', home)


def run_page(page: Path) -> None:
    """Run a page's command lines in order, its tables written as the files it names."""
    text = page.read_text(encoding="utf-8")
    for name, table in re.findall(
        r"`(\w+\.csv)`[^\n]*(?:\n[^\n`]+)*\n\n```text\n(.*?)```", text, re.S
    ):
        Path(name).write_text(table, encoding="utf-8")
    lines = [line for block in re.findall(r"```bash\n(.*?)```", text, re.S)
             for line in block.replace("\\\n", " ").splitlines() if line.strip()]  # fmt: skip
    assert lines or page.name == "tutorial-many-pairs.md"
    for line in lines:
        program, *words = shlex.split(line)
        result = CliRunner().invoke(PROGRAMS[program], words)
        assert result.exit_code == 0, f"{line}: {result.stderr}"


@pytest.mark.parametrize(
    "page", [page for page in TUTORIALS if page.name not in LONG], ids=lambda page: page.name
)
def test_the_commands_of_a_tutorial_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_page(page)


@pytest.mark.acceptance
@pytest.mark.parametrize("name", LONG)
def test_the_commands_of_a_long_tutorial_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_page(DOCS / name)
    assert Path("wall/report/wall_report.html").stat().st_size > 10_000
    assert Path("wall/drawing/wall.pdf").is_file()
