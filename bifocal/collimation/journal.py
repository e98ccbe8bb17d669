"""The journal: one line of JSON for every command, on the disk before the page is answered."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bifocal.remarks import remark
from photocore.errors import InputError


class Journal:
    """An append-only file of commands.

    Parameters
    ----------
    path : Path
        Made where there is none.

    Attributes
    ----------
    records : list of dict
        What it held when opened; without a last line that a crash cut off.

    Raises
    ------
    InputError
        If it cannot be written, another server has it open, or a line is no command.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("a+b", buffering=0)
        except OSError as error:
            raise InputError(
                remark("page.journal_unwritten", of=path, strerror=error.strerror)
            ) from error
        try:
            self._lock()
            self.records = self._read()
        except BaseException:
            self._file.close()
            raise

    def _lock(self) -> None:
        try:
            lock(self._file.fileno())
            if not os.fstat(self._file.fileno()).st_nlink:
                raise OSError
        except OSError:
            raise InputError(remark("page.open_already", of=self.path)) from None

    def _read(self) -> list[dict[str, Any]]:
        self._file.seek(0)
        data = self._file.read()
        self._whole = data.rfind(b"\n") + 1
        records = []
        for number, line in enumerate(data[: self._whole].splitlines(), start=1):
            try:
                record = json.loads(line)
            except (ValueError, RecursionError):
                record = None
            if not isinstance(record, dict) or "op" not in record:
                raise self.refusal(number, "is no command of a survey's journal.")
            records.append(record)
        return records

    def refusal(self, number: int, why: str) -> InputError:
        """Return what is wrong with a line, and how to mend it."""
        return InputError(remark("page.journal_line", path=self.path, number=number, why=why))

    def cut(self) -> None:
        """Take a last line that a crash cut off from the file, once all others are understood."""
        self._file.truncate(self._whole)

    def append(self, record: Mapping[str, object]) -> None:
        """Add a command; on return it is on the disk.

        Raises
        ------
        InputError
            If it could not be written; the journal is then as it was before.
        """
        text = json.dumps(record, ensure_ascii=False, allow_nan=False)
        # What is no character, as in names of files that are not UTF-8, becomes JSON's own \\udcXX.
        line = text.encode("utf-8", "backslashreplace") + b"\n"
        end = os.fstat(self._file.fileno()).st_size
        try:
            written = 0
            while written < len(line):
                written += self._file.write(line[written:])
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(end)
            raise InputError(
                remark("page.not_taken", path=self.path, why=error.strerror or error)
            ) from error

    def close(self) -> None:
        """Close the file; one that holds nothing is not left behind."""
        if not self._file.closed and not os.fstat(self._file.fileno()).st_size:
            with contextlib.suppress(OSError):  # Windows deletes no open file: it is skipped later
                self.path.unlink()
        self._file.close()


def lock(handle: int) -> None:
    """Lock a file for this process; the system frees it even when the process is killed.

    Raises
    ------
    OSError
        If another process has locked it.
    """
    if os.name == "nt":  # a byte far behind the end, for Windows locks reading too
        windows: Any = importlib.import_module("msvcrt")
        os.lseek(handle, 1 << 30, os.SEEK_SET)
        windows.locking(handle, windows.LK_NBLCK, 1)
        return
    unix: Any = importlib.import_module("fcntl")
    unix.flock(handle, unix.LOCK_EX | unix.LOCK_NB)
