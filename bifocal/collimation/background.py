"""Threads of the page: none ends without a word."""

from __future__ import annotations

import threading
from collections.abc import Callable

from photocore import cli


def in_background(
    task: str, work: Callable[[], None], report: Callable[[str], None]
) -> threading.Thread:
    """Return a thread, not yet started, that reports an end that nobody foresaw.

    Parameters
    ----------
    task : str
        What it does, and its name.
    work : callable
    report : callable
        Takes the message; the page waits for ever for a thread that just ends.
    """

    def run() -> None:
        try:
            work()
        except Exception as error:  # the last resort; the tests let nobody get here
            report(cli.unforeseen_message(task, error))

    return threading.Thread(target=run, name=task, daemon=True)
