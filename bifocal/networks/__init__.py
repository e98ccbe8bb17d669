"""Pairs of one wall in one frame: ties between pairs, their control, one adjustment, its files."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
