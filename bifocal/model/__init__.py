"""Frozen objects every room speaks of: pair, photo, lens, grid, relief map, surface, points."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
