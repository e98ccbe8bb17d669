"""What a folder without Python is made of, for all systems: asked by the spec files beside it."""

from pathlib import Path
from typing import Any

from PyInstaller.utils.hooks import (
    collect_all,
    collect_data_files,
    collect_submodules,
    copy_metadata,
)

HERE = Path(__file__).parent
#: Loaded by name while the program runs.
OURS = ("bifocal", "multimedia", "photocore")
THEIRS = ("rasterio", "ezdxf", "laspy", "lazrs", "uvicorn", "skimage")
#: Never asked for; large.
LEFT_OUT = ("tkinter", "PyQt5", "PyQt6", "PySide6", "IPython", "pytest", "numba", "pyarrow", "dask")


def analysis() -> dict[str, Any]:
    """Return what PyInstaller's `Analysis` takes."""
    found: dict[str, list[Any]] = {"datas": [], "binaries": [], "hiddenimports": []}
    for name in OURS:
        found["datas"] += collect_data_files(name)
        found["hiddenimports"] += collect_submodules(name)
    for name in THEIRS:
        datas, binaries, hidden = collect_all(name, filter_submodules=_wanted)
        found["datas"] += datas
        found["binaries"] += binaries
        found["hiddenimports"] += hidden
    # The program asks which versions are installed.
    found["datas"] += copy_metadata("bifocal-relief", recursive=True)
    return {"scripts": [str(HERE / "entry.py")], "excludes": list(LEFT_OUT), **found}


def _wanted(name: str) -> bool:
    return ".tests" not in name and ".test_" not in name
