"""JSON files in and out, with messages that name file, line and key."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from photocore.errors import InputError
from photocore.output import atomic_path
from photocore.provenance import is_recorded, provenance
from photocore.remarks import learn, with_keys
from photocore.textfile import read_text


def read_object(path: Path | str, *, what: str) -> dict[str, Any]:
    """Return the object a JSON file holds.

    Parameters
    ----------
    path : path
        The file.
    what : str
        What it should be, for the message: ``"pair file"``.

    Raises
    ------
    InputError
        If the file is missing, is not text, not JSON, or not an object.
    """
    value = read_json(path, what=what)
    if not isinstance(value, dict):
        raise InputError(f"{path}: expected a {what}, a JSON object; found {type(value).__name__}.")
    return value


def read_json(path: Path | str, *, what: str) -> Any:
    """Return what a JSON file holds, whatever that is; raise as `read_object` does."""
    text = read_text(Path(path), what, form=" (JSON)")
    try:
        value = json.loads(text)
        learn(value)
        return value
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}: not valid JSON at line {error.lineno}, column {error.colno}: {error.msg}."
        ) from None
    except ValueError:  # Python reads no whole number of more than 4300 digits
        raise InputError(f"{path}: holds a whole number of thousands of digits.") from None
    except RecursionError:
        raise InputError(f"{path}: nested too deeply for a {what}.") from None


def write_object(
    path: Path | str, value: dict[str, object], *, overwrite: bool = False, as_is: bool = False
) -> None:
    """Write an object as indented JSON, whole or not at all; NaN and infinity become null.

    While something is recorded (`photocore.provenance.recording`), it gets a key ``provenance`` in
    place of the one it has, unless it is written as it is.
    """
    if is_recorded() and not as_is:
        value = {**value, "provenance": provenance().to_dict()}
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text(to_text(value, indent=2) + "\n", encoding="utf-8")


def to_text(value: Any, *, indent: int | None = None) -> str:
    """Return JSON text of a structure that may hold numpy values; NaN and infinity become null.

    An object gets a key ``remark_keys`` where it holds remarks (`photocore.remarks.with_keys`).
    """
    value = with_keys(value) if isinstance(value, dict) else value
    return json.dumps(plain(value), indent=indent, ensure_ascii=False, allow_nan=False)


def plain(value: Any) -> Any:
    """Return value with numpy types made plain and non-finite numbers made None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return value.as_posix()
    return value
