"""What is too old, or another program of our name, is named with the command that mends it."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal import SAMPLE, MissingExtraError
from photocore import installation, machine
from tests.builders.commands import bifocal_command as main
from tests.builders.commands import multimedia_command as multimedia

ROOT = Path(__file__).parents[1]


@pytest.fixture
def site(tmp_path, monkeypatch):
    """An environment with nothing but what a test says."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    here = {"numpy": "2.0.0", "opencv-python-headless": "5.0.0.93"}
    monkeypatch.setattr(installation, "installed", lambda: here)
    return here


def test_the_distribution_bears_a_name_of_its_own_and_the_packages_theirs():
    own = distribution(installation.DISTRIBUTION)
    assert own.name == "bifocal-relief"
    assert {script.name for script in own.entry_points} == {"bifocal", "multimedia"}
    assert f"{own.name}[" in (ROOT / "pyproject.toml").read_text("utf-8")


def test_nobody_is_told_to_install_what_is_not_ours():
    told = re.compile(r"pip install[^\n]{0,12}\b(bifocal|multimedia)(?!-relief)\b(?!/)")
    texts = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md")]
    texts += [path for name in ("bifocal", "multimedia", "photocore", "examples")
              for path in (ROOT / name).rglob("*.py")]  # fmt: skip
    assert [path.name for path in texts if told.search(path.read_text("utf-8"))] == []
    assert 'pip install ".[lens]"' in str(MissingExtraError("The lens database", "lens"))


@pytest.mark.parametrize(
    ("name", "version", "said"),
    [
        ("opencv-python-headless", "4.9.0.80", "opencv-python-headless 4.9.0.80 is too old, 4.12"),
        ("opencv-python", "4.9.0", "pip uninstall -y opencv-python; "),
        ("numpy", "1.25.2", '-m pip install --force-reinstall "numpy>=2.0"'),
    ],
)
@pytest.mark.parametrize("program", [main, multimedia])
def test_what_is_too_old_is_said_at_every_start_and_by_the_doctor(
    site, name, version, said, program
):
    command = ["doctor"] if program is main else ["index"]
    assert "too old" not in CliRunner().invoke(program, command).output
    site[name] = version
    done = CliRunner().invoke(program, command)
    assert done.exit_code == 0
    assert said in done.stderr
    if program is main:
        assert f"TO MEND: {name}" in done.stdout


def test_a_command_that_breaks_on_an_old_library_blames_that(site, monkeypatch):
    site["opencv-python-headless"] = "4.9.0.80"

    def broken(*_, **__):
        raise AttributeError("module 'cv2' has no attribute 'DISOpticalFlow'")

    monkeypatch.setattr(machine, "diagnosis", broken)
    done = CliRunner().invoke(main, ["doctor"])
    assert done.exit_code == 1
    assert "doctor cannot be done with what is installed: opencv-python-headless" in done.stderr
    assert "nobody foresaw" not in done.stderr


@pytest.mark.parametrize("name", ["bifocal", "multimedia"])
def test_the_doctor_notices_other_peoples_programs_of_our_names(site, name):
    assert installation.not_ours() == []
    site[name] = "9.1"
    found = CliRunner().invoke(main, ["doctor"]).stdout
    assert f"TO MEND: {name} 9.1 is another program" in found
    assert f"pip uninstall -y {name}" in found


def test_the_doctor_notices_a_package_that_is_not_where_ours_is(tmp_path):
    (tmp_path / "multimedia").mkdir()
    (tmp_path / "multimedia/__init__.py").touch()
    ask = "from photocore.installation import not_ours; print(not_ours())"
    told = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = ['.', {str(ROOT)!r}]; {ask}"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "multimedia is another program" in told.stdout


def test_versions_are_read_from_the_names_of_folders(tmp_path, monkeypatch):
    (tmp_path / "Scikit_Image-0.9.3.dist-info").mkdir()
    monkeypatch.setattr(sys, "path", [str(tmp_path), str(tmp_path / "none"), *sys.path])
    assert installation.installed()["scikit-image"] == "0.9.3"
    assert installation.too_old()[0].startswith("scikit-image 0.9.3 is too old, 0.24 is needed")


def test_a_library_that_was_left_out_is_named_with_the_extra_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "starlette", None)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    for name in [name for name in sys.modules if name.startswith("bifocal.collimation.")]:
        monkeypatch.delitem(sys.modules, name)
    done = CliRunner().invoke(main, ["pick", str(SAMPLE / "facade.pair.json"), "--no-browser"])
    assert done.exit_code == 1
    assert re.search(r"(starlette|uvicorn) was left out: pip install .*\[page\]", done.output)
