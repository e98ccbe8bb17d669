"""A little of the fuzz of `tests/fuzz_readers.py`, and what it found before."""

from __future__ import annotations

from pathlib import Path

import pytest

from bifocal import InputError
from photocore.output import check_writable
from tests.attack.site import make_site
from tests.fuzz_readers import READERS, attack
from tests.tables import each

#: Seeds that ended in a traceback, or ended Python, once.
FOUND = {
    "dem": (1,), "relief": (3, 20, 1004, 5015), "opencv": (8,), "ods": (1005,),
    "openptv control": (5054,), "laz": tuple(range(20, 40)),
}  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    make_site(folder)
    return folder


@pytest.mark.parametrize("reader", READERS)
def test_a_damaged_file_ends_in_an_error_of_the_family(site: Path, reader: str) -> None:
    for seed in (*range(12), *FOUND.get(reader, ())):
        assert attack(reader, site, seed) is None


@each("name", ["n" * 300, "a\0b"], ids=["long", "NUL"])
@pytest.mark.parametrize("reader", READERS)
def test_a_name_no_file_can_have_is_refused_in_the_library_too(
    tmp_path: Path, reader: str, name: str
) -> None:
    kind = READERS[reader]
    if reader in ("toml points", "meshroom") or reader.startswith("openptv"):
        pytest.skip("reads what lies beside it")
    with pytest.raises(InputError):
        kind.read(tmp_path / (name + Path(kind.valid).suffix))
    with pytest.raises(InputError):
        check_writable(tmp_path / (name + Path(kind.valid).suffix), overwrite=False)
