"""Tuned numbers: every row says what it is and what fixed it, is used, and every use has a row."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = sorted(path.parent for path in ROOT.glob("bifocal/**/tuning.toml"))


def rows(room: Path) -> dict[str, dict[str, object]]:
    stages = tomllib.loads((room / "tuning.toml").read_text("utf-8"))
    return {f"{stage}.{name}": row for stage, of in stages.items() for name, row in of.items()}


def uses(room: Path) -> set[str]:
    """Return all that the package asks of a room's tuning, as `stage.name`."""
    module = ".".join((room / "tuning").relative_to(ROOT).parts)
    asked = set()
    for path in ROOT.glob("bifocal/**/*.py"):
        text = path.read_text("utf-8")
        for names in re.findall(rf"from {module} import (\([^)]*\)|.*)", text):
            for stage in re.findall(r"[A-Z]\w+", names):
                found = re.findall(rf"\b{stage}\.(\w+)", text)
                assert found, f"{path} imports {stage} and asks nothing of it"
                asked |= {f"{stage.lower()}.{name}" for name in found}
    return asked


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_every_tuned_number_says_what_it_is_and_what_fixed_it(room):
    for name, row in rows(room).items():
        assert set(row) == {"value", "unit", "words", "fixed_by"}, name
        words = (row["unit"], row["words"], row["fixed_by"])
        assert all(isinstance(text, str) and text.strip() for text in words), name
        assert not isinstance(row["value"], str | bool), name


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_every_tuned_number_is_used_and_every_use_has_its_row(room):
    assert uses(room) == set(rows(room))
