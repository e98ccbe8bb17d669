"""Which process works in a folder: one at a time, told by a file of our own."""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from bifocal.remarks import remark
from photocore.errors import InputError

#: File that says which process works in a folder.
LOCK = ".survey.lock"
#: What it says: machine and process; nothing where the process was killed at that moment.
_OURS = re.compile(r"(\S+ \d+)?")


@contextmanager
def locked(folders: Sequence[Path]) -> Iterator[None]:
    """Keep other processes out of folders; a lock whose process is gone counts for nothing."""
    mine = f"{socket.gethostname()} {os.getpid()}"
    locks: list[Path] = []
    try:
        for folder in folders:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                path = folder / LOCK
                if path.exists() and _is_alive(path):
                    who = path.read_text("utf-8").strip()
                    raise InputError(remark("campaign.other_run", of=folder, who=who, file=path))
                if path.exists() and not _OURS.fullmatch(path.read_text("utf-8", "replace")):
                    raise InputError(f"{path}: is not this program's; move it away.")
                locks.append(path)
                path.write_text(mine, encoding="utf-8")
            except OSError as error:
                raise InputError(
                    remark("campaign.no_writing", of=folder, error=error.strerror or error)
                ) from error
        yield
    finally:
        for path in locks:
            with suppress(OSError):
                path.unlink()


def _is_alive(lock: Path) -> bool:
    """Tell whether the process that wrote a lock may still run."""
    try:
        host, number = lock.read_text(encoding="utf-8").split()
        if host != socket.gethostname():
            return True  # who knows
        # Windows has no way to ask without harm: there a lock of this machine counts for nothing.
        if int(number) == os.getpid() or os.name == "nt":
            return False
        os.kill(int(number), 0)
    except (ValueError, ProcessLookupError):
        return False
    except OSError:
        return True
    return True
