"""The orientation without a click: begun in the background as soon as two photos lie there.

Further photos of the wall join it as soon as it is accepted.
"""

from __future__ import annotations

import logging
import queue
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from bifocal.collimation.background import in_background
from bifocal.collimation.job_tasks import start_job
from bifocal.collimation.live_orientation import control_of, lenses_of
from bifocal.collimation.live_results import observations
from bifocal.collimation.session import Session
from bifocal.collimation.stated_media import lacking, media_of
from bifocal.model import Pair
from bifocal.workbook import verdict_of_picks
from photocore.errors import PhotogrammetryError

#: Fewer new points than this come from clicks on the photos themselves, which cannot be others.
FEWEST_AT_ONCE = 3
#: What is typed in one go is waited for. [s]
PAUSE = 0.6


class FirstOrientation:
    """Watches a survey, and orients its photos by themselves where nobody did.

    Parameters
    ----------
    session : Session
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._tried: Any = None
        self._held: tuple[Pair | None, frozenset[Any]] = None, frozenset()
        self._leave: Callable[[], None] | None = None

    def start(self) -> None:
        """Watch from now on, until the session ends."""
        events, self._leave = self._session.listen()
        watch = partial(self._watch, events)
        in_background("the first orientation", watch, logging.getLogger(__name__).error).start()

    def _watch(self, events: queue.SimpleQueue[dict[str, object] | None]) -> None:
        while True:
            self.look()
            self.hold_picks()
            event: dict[str, object] | None = events.get()
            while event is not None:
                try:
                    event = events.get(timeout=PAUSE)
                except queue.Empty:
                    break
            if event is None:
                if self._leave is not None:
                    self._leave()
                return

    def look(self) -> None:
        """Begin to orient the photos, unless that is done, runs, or was tried with all this."""
        session = self._session
        with session.lock:
            joined = self._to_join()
            facts = joined or self._facts()
            if facts is None or facts == self._tried:
                return
            if any(job.state == "running" for job in session.jobs.jobs.values()):
                return
            self._tried = facts
            with suppress(PhotogrammetryError):  # what is lacking is asked by the page
                if joined:
                    start_job(session, "join", {})
                else:
                    start_job(session, "align", {"way": "auto"}, quiet=True)

    def hold_picks(self) -> None:
        """Hold picks against the photos that did not come one by one: typed, pasted, read."""
        session = self._session
        with session.lock:
            pair, points = session.accepted_pair, session.state.sorted_points()
        held = frozenset((p.name, p.picks) for p in points if p.use and p.is_complete)
        before = self._held[1] if self._held[0] is pair else frozenset()
        if pair is None or pair.layers or session.files.pair_is_workbook or held == before:
            return
        self._held = pair, held
        if len(held - before) < FEWEST_AT_ONCE and not session.pick_doubt:
            return
        picks = observations(point for point in points if point.use)
        words = verdict_of_picks(pair, picks.pixels1, picks.pixels2).words
        with session.lock:
            if words != session.pick_doubt:
                session.pick_doubt = words
                session.changed()

    def _to_join(self) -> Any:
        """Return what further photos would join; None where there are none, or they did."""
        session = self._session
        pair, others = session.accepted_pair, session.pictures.others
        if pair is None or not others or session.files.pair_is_workbook or pair.layers:
            return None
        if session.photo_set is not None:
            return None
        return session.all_photos, pair.image1.plane_from_pixel.tobytes()

    def _facts(self) -> Any:
        """Return what a first orientation would rest on; None where it is not for the program."""
        session, state = self._session, self._session.state
        if len(session.pictures.infos) != 2 or session.files.pair is not None:
            return None
        proposal, setup = session.proposal, state.setup
        if proposal is not None and not proposal["report"].get("free_scale"):
            return None
        if len(control_of(state).ids) or lacking(setup) or media_of(setup, session.pictures.pair):
            return None
        photos = tuple(sorted(info.path.name for info in session.pictures.infos))
        facts = photos, lenses_of(state), state.wall.get("spot"), state.ordered
        if proposal is not None and self._tried is None:  # taken up again: it stands
            self._tried = facts
        return facts
