"""The faults of `tests/planted_faults.toml` still fit the code they are to be planted in."""

from __future__ import annotations

import ast
import tomllib

from tests.planted_faults import FAULTS, ROOT
from tests.tables import each


def test_there_are_sixty_faults_and_none_is_named_twice():
    assert len({(fault.file, fault.right, fault.wrong) for fault in FAULTS}) == len(FAULTS) >= 60


@each("fault", FAULTS, ids=lambda fault: f"{fault.file}: {fault.right}")
def test_a_fault_fits_the_code_once_and_leaves_what_can_be_read(fault):
    text = (ROOT / fault.file).read_text(encoding="utf-8")
    read = tomllib.loads if fault.file.endswith(".toml") else lambda code: ast.dump(ast.parse(code))
    assert read(fault.planted(text)) != read(text)
    for test in fault.tests.split():
        assert (ROOT / test).exists()
