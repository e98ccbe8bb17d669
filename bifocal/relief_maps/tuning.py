"""The tuned numbers of dense relief by stage; `tuning.toml` says what each is and what fixed it."""

from typing import Any

from photocore.tuning import read_tuning

TUNING = read_tuning("bifocal.relief_maps")


def __getattr__(stage: str) -> Any:
    """Return the numbers of a stage, asked for in capitals."""
    return getattr(TUNING, stage.lower())
