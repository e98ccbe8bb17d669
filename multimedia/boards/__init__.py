"""Photos of boards as points of a project."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
