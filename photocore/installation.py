"""What is installed beside the program: its own name, what is too old, what is not ours."""

from __future__ import annotations

import math
import os
import re
import sys
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec
from pathlib import Path

#: Our name on the package indexes, where ``bifocal`` and ``multimedia`` are other people's.
DISTRIBUTION = "bifocal-relief"
_STRANGERS = ("bifocal", "multimedia")
_OURS = (*_STRANGERS, "photocore")
#: Numbers cannot be calculated in less: numpy's own library ends in a fault then. [MB]
LEAST_MEMORY = 480
_BOUND = re.compile(r"([\w.-]+)(?:\[.*\])?>=([\d.]+)$")


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra; no index has our program by its own name."""
    return f'pip install ".[{extra}]" in the program\'s folder, or its wheel: "NAME.whl[{extra}]"'


#: What is asked for late, and the extra that brings it to those who left dependencies out.
_LATE = {
    "laspy": "cloud", "lazrs": "cloud", "starlette": "page", "uvicorn": "page",
    "python_multipart": "page", "matplotlib": "plots", "contourpy": "plots",
}  # fmt: skip


def left_out(error: Exception) -> str:
    """Return which library is not installed and what brings it; empty where that is no matter."""
    name = (getattr(error, "name", None) or "").partition(".")[0]
    if not isinstance(error, ModuleNotFoundError) or name in ("", *_OURS):
        return ""
    if name in _LATE:
        return f"{name} was left out: {how_to_install(_LATE[name])}"
    return (
        f"{name} is not installed, or damaged. Mend it: "
        f'"{sys.executable}" -m pip install --force-reinstall {DISTRIBUTION}, or its wheel'
    )


def allowed_memory() -> float:
    """Return what memory this process may take, in MB; infinite where nothing limits it."""
    try:
        import resource
    except ImportError:  # Windows
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else limit / 2**20


def is_of_memory(error: BaseException) -> bool:
    """Whether a library could not be loaded because no memory was left for it."""
    return isinstance(error, ImportError) and (
        "failed to map" in str(error) or "allocate memory" in str(error)
    )


def installed() -> dict[str, str]:
    """Return what is installed and its version; names of folders alone, for every start asks."""
    return {name: version for folder in reversed(sys.path) for name, version in _held_by(folder)}


@cache
def _held_by(folder: str) -> list[tuple[str, str]]:
    """Return what a folder of ``sys.path`` holds: names and versions of distributions."""
    parts: list[tuple[str, str, str]] = []
    with suppress(OSError):
        parts = [
            name.removesuffix(".dist-info").partition("-")
            for name in os.listdir(folder or ".")  # noqa: PTH208
            if name.endswith(".dist-info")
        ]
    return [(package.lower().replace("_", "-"), version) for package, _, version in parts]


@cache
def _bounds() -> list[tuple[str, str]]:
    """Return the libraries that the program needs, each with the oldest version that will do."""
    try:
        lines = [line.replace(" ", "") for line in requires(DISTRIBUTION) or ()]
    except PackageNotFoundError:
        return []
    return [(bound[1], bound[2]) for bound in map(_BOUND.match, lines) if bound]


def too_old() -> list[str]:
    """Return which libraries are older than the program needs, and the command that mends each."""
    here, said = installed(), []
    # Four distributions bring OpenCV, each into the same folder.
    twins = [key for key in here if key.startswith("opencv-")]
    for name, bound in _bounds():
        for twin in (twins if name.startswith("opencv") else []) or [name]:
            if twin in here and _numbers(here[twin]) < _numbers(bound):
                away = "" if twin == name else f'"{sys.executable}" -m pip uninstall -y {twin}; '
                said.append(
                    f"{twin} {here[twin]} is too old, {bound} is needed. Mend it: {away}"
                    f'"{sys.executable}" -m pip install --force-reinstall "{name}>={bound}"'
                )
    return said


def not_ours() -> list[str]:
    """Return what stands where a package of ours should, or writes over it."""
    ours, here = Path(__file__).parents[1], installed()
    said = []
    for name in _STRANGERS:
        found = find_spec(name)
        away = found is None or found.origin is None or Path(found.origin).parents[1] != ours
        if away or name in here:
            version = f" {here[name]}" if name in here else ""
            said.append(
                f"{name}{version} is another program, or an old version of this one, over files "
                f'of ours. Mend it: "{sys.executable}" -m pip uninstall -y {name}, then install '
                f"{DISTRIBUTION} again with --force-reinstall --no-deps"
            )
    return said


def _numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version.partition("+")[0])]
