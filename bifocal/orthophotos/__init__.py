"""Orthophotos: rectification, visibility, composition, mosaics, drawings and print sheets."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
