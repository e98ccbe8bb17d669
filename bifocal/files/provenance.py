"""The public name by which programs tell what makes the outputs they write."""

from photocore.provenance import recording

__all__ = ["recording"]
