"""The tuned numbers of faces by stage; `tuning.toml` says what fixed each."""

from typing import Any

from photocore.tuning import read_tuning

TUNING = read_tuning("bifocal.faces")


def __getattr__(stage: str) -> Any:
    """Return the numbers of a stage, asked for in capitals."""
    return getattr(TUNING, stage.lower())
