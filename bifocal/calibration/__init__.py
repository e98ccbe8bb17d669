"""Lenses: boards, straight lines, the lens database, undistorted photos."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
