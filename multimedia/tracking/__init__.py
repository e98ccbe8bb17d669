"""Particles over time: which are one, where they go, and how fast.

`linking` joins the particles of consecutive frames, `neighbours` says where those around lead,
`chance` counts the links that would come about by chance, `tracks` makes tracks of many frames,
`velocities` says how fast and how surely; `self_calibration` puts cameras right that have moved,
`track_files` writes tracks, `workflow` is the command.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
