"""A marker, and nothing else, decides what a bare machine skips."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tests import equipment


class Item:
    """A test with markers and fixtures."""

    def __init__(self, *marks: str, fixtures: tuple[str, ...] = ()) -> None:
        self.marks = list(marks)
        self.fixturenames = fixtures

    def add_marker(self, name: str) -> None:
        self.marks.append(name)

    def get_closest_marker(self, name: str) -> Any:
        return SimpleNamespace(name=name) if name in self.marks else None


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take LibreOffice, Chromium and data away."""
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("BIFOCAL_DATA", raising=False)
    monkeypatch.delenv("CI_FULL", raising=False)


@pytest.mark.usefixtures("bare")
def test_what_is_marked_is_skipped_on_a_bare_machine_and_fails_where_all_must_be_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    items = [
        Item("office"),
        Item(fixtures=("browser", "server")),
        Item(fixtures=("data_dir",)),
        Item("acceptance"),
    ]
    equipment.mark(items)
    reasons = []
    for item in items[:3]:
        with pytest.raises(pytest.skip.Exception) as skipped:
            equipment.check(item)
        reasons.append(str(skipped.value))
    assert reasons == ["wants LibreOffice", "wants Chromium", "wants data"]
    equipment.check(items[3])
    monkeypatch.setenv("CI_FULL", "1")
    with pytest.raises(pytest.fail.Exception, match="CI_FULL is set, and there is no Chromium"):
        equipment.check(items[1])


@pytest.mark.usefixtures("bare")
def test_a_test_that_wants_without_a_marker_is_at_fault_not_skipped() -> None:
    with pytest.raises(pytest.fail.Exception, match="mark this test 'office'"):
        equipment.place("office")


def test_skips_are_told_in_one_line() -> None:
    reasons = ["wants Chromium"] * 30 + ["root may write anywhere"] + ["wants LibreOffice"] * 17
    assert equipment.summary(reasons) == (
        "skipped: 17 want LibreOffice, 30 want Chromium, 1 root may write anywhere"
    )
    assert equipment.summary([]) == ""
