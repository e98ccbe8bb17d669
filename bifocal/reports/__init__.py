"""Reports: what was measured, with which geometry, and how good it is."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
