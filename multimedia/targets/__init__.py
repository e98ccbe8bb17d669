"""Particles' images: where they are, how precisely, how large; files that trackers read.

In the order one reads them: `background` (light and noise), `target_images` (places, by least
squares over all of them), `workflow` (images in, files out).
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
