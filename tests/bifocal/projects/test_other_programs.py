"""Finished projects of other programs, read as their documents say, and made sets of photos."""

from __future__ import annotations
