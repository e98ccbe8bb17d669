"""What is drawn for the relief on the page, and the file beside the pair that every run finds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from bifocal.collimation.records import SurveyState
from bifocal.collimation.shapes import commands_for, keep_faces
from bifocal.faces import Faces, beside
from bifocal.model import Pair


class DrawnFaces:
    """Faces, break lines and occluders of a survey, the same on the page and beside its pair.

    Parameters
    ----------
    state : callable
        Gives the survey's state.
    carry_out : callable
        Carries out a command and writes it into the journal.
    """

    def __init__(
        self, state: Callable[[], SurveyState], carry_out: Callable[[dict[str, object]], object]
    ) -> None:
        self._state = state
        self._carry_out = carry_out
        self._kept: tuple[dict[str, object], Pair] | None = None

    def keep(self, pair: Pair | None, file: Path | None) -> None:
        """Write what was drawn beside the file of a pair, where it is another now."""
        state = self._state()
        if pair is None or file is None:
            return
        if self._kept is None or self._kept[0] != state.shapes or self._kept[1] is not pair:
            if state.shapes or self._kept is not None:
                keep_faces(state, pair, file)
            self._kept = dict(state.shapes), pair

    def take(self, pair: Pair | None, file: Path | None) -> None:
        """Take over what stands beside the file of a pair, where it was drawn by others."""
        path = None if file is None else beside(file)
        if pair is None or path is None or not path.is_file():
            return
        for command in commands_for(Faces.read(path), self._state(), pair):
            self._carry_out(command)
        self._kept = dict(self._state().shapes), pair
