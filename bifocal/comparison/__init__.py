"""The same wall at two dates: what has changed, and what only seems to have."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
