"""Rasters, photos and point files that several rooms read and write; no mathematics."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
