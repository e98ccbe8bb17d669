"""What this machine has: cores, memory, programs and libraries."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from photocore.installation import how_to_install, not_ours, too_old
from photocore.provenance import program

#: What the program is built on, and the extras with what each brings.
LIBRARIES = (
    "numpy", "scipy", "opencv-python-headless", "scikit-image", "rasterio", "openpyxl", "pillow",
    "matplotlib", "ezdxf", "laspy", "click",
)  # fmt: skip
EXTRAS = {
    "lens": ("lensfunpy",), "fast": ("pyarrow", "numba"), "hdf": ("h5py",),
    "shapes": ("shapefile",), "cluster": ("dask", "distributed"),
}  # fmt: skip
OFFICE = ("soffice", "libreoffice")


def free_memory() -> int:
    """Return the memory that programs may still take; 4 GiB where the system does not tell.

    In bytes.
    """
    with suppress(OSError, ValueError, StopIteration):
        with open("/proc/meminfo", encoding="ascii") as file:  # noqa: PTH123
            line = next(line for line in file if line.startswith("MemAvailable"))
        return int(line.split()[1]) * 1024
    with suppress(AttributeError, ValueError, OSError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
    return 4 << 30


def cores() -> int:
    """Return the processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def office() -> str | None:
    """Return where LibreOffice is, None where it is not."""
    return next((found for name in OFFICE if (found := shutil.which(name))), None)


def diagnosis() -> dict[str, object]:
    """Return what a report of a fault needs: versions, extras, LibreOffice, memory, disk.

    Memory and disk in bytes; None for what is absent.
    """
    import rasterio

    return {
        "program": program(),
        "python": sys.version.split()[0],
        "system": platform.platform(),
        "libraries": {name: _version(name) for name in LIBRARIES},
        "gdal": rasterio.__gdal_version__,
        "extras": {
            extra: {name: _version(name) for name in names} for extra, names in EXTRAS.items()
        },
        "problems": [*too_old(), *not_ours()],
        "libreoffice": office(),
        "cores": cores(),
        "free_memory": free_memory(),
        "free_disk": shutil.disk_usage(Path.cwd()).free,
        "folder": str(Path.cwd()),
    }


def diagnosis_lines(found: dict[str, Any]) -> list[str]:
    """Return a diagnosis for people, with what to install for what is absent."""
    lines = [f"{found['program']}, Python {found['python']}, {found['system']}"]
    lines += [f"{name:24} {number or 'MISSING'}" for name, number in found["libraries"].items()]
    lines.append(f"{'GDAL':24} {found['gdal']}")
    for extra, packages in found["extras"].items():
        said = ", ".join(f"{name} {number or 'absent'}" for name, number in packages.items())
        hint = "" if all(packages.values()) else f"   ({how_to_install(extra)})"
        lines.append(f"{'extra ' + extra:24} {said}{hint}")
    lines += [f"TO MEND: {problem}." for problem in found["problems"]]
    place = found["libreoffice"] or "absent (only needed to recalculate workbooks without Excel)"
    lines.append(f"{'LibreOffice':24} {place}")
    lines.append(f"{'cores':24} {found['cores']}")
    lines.append(f"{'free memory':24} {found['free_memory'] / (1 << 30):.1f} GiB")
    lines.append(f"{'free disk here':24} {found['free_disk'] / (1 << 30):.1f} GiB")
    return lines


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
