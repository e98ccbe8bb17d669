"""Where to stand, with which lenses, and what precision to expect."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
