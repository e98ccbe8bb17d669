"""Workbooks: cells read and changed in place, everything else byte for byte as it was."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
