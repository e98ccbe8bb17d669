"""Reports of both packages: blocks in, HTML or PDF out, words in three languages."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
