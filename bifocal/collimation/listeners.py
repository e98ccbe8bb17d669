"""Who is told what happens in a survey."""

from __future__ import annotations

import queue
from collections.abc import Callable


class Listeners:
    """Queues of events, one for each listener."""

    def __init__(self) -> None:
        self._queues: set[queue.SimpleQueue[dict[str, object] | None]] = set()

    def tell(self, event: dict[str, object] | None) -> None:
        """Tell all listeners something; None ends them."""
        for events in list(self._queues):
            events.put(event)

    def listen(self) -> tuple[queue.SimpleQueue[dict[str, object] | None], Callable[[], None]]:
        """Return a queue of events, and how to leave it."""
        events: queue.SimpleQueue[dict[str, object] | None] = queue.SimpleQueue()
        self._queues.add(events)
        return events, lambda: self._queues.discard(events)
