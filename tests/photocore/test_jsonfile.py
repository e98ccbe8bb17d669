"""JSON files that cannot be read are named, with the place."""

from __future__ import annotations

from pathlib import Path

import pytest

from bifocal import InputError
from photocore.jsonfile import read_object


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": ' + "9" * 5000 + "}", "holds a whole number of thousands of digits"),
        ('{"a": ' + "[" * 200_000 + "]" * 200_000 + "}", "nested too deeply for a pair file"),
        ('{"a": }', "not valid JSON at line 1, column 7"),
        ("[1]", "found list"),
    ],
    ids=["digits", "depth", "syntax", "list"],
)
def test_what_is_no_object_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "wall.pair.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as told:
        read_object(path, what="pair file")
    assert str(told.value).startswith(f"{path}: ")
