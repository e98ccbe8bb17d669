"""Finished projects of other programs become sets of photos, and sets go on in other programs."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
