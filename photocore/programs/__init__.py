"""Finished projects of other programs: cameras, lenses and sparse points, one reader a format."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
