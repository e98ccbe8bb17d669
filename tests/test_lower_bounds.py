"""Libraries that read what strangers send are never older than their known memory holes."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]

#: First version without a published hole, and the advisory.
MENDED = {
    "opencv-python-headless": ("4.12", "CVE-2025-53644"),
    "pillow": ("12.3", "CVE-2026-25990, CVE-2026-54058"),
    "pillow-heif": ("1.7", "libheif: write out of bounds"),
    "python-multipart": ("0.0.31", "CVE-2026-40347, CVE-2026-42561, CVE-2026-53540"),
    "rawpy": ("0.27", "LibRaw 0.22.1: CVE-2026-21413"),
}


@pytest.mark.parametrize("name", MENDED)
def test_no_lower_bound_allows_a_version_with_a_known_hole(name: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    groups = (project["dependencies"], *project["optional-dependencies"].values())
    listed = [Requirement(text) for group in groups for text in group]
    requirements = [one for one in listed if one.name == name]
    version, advisory = MENDED[name]
    assert requirements
    for requirement in requirements:
        (lower,) = [Version(s.version) for s in requirement.specifier if s.operator == ">="]
        assert lower >= Version(version), f"{requirement}: {advisory}"
