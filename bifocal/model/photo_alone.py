"""One photo where a pair is taken: an orthophoto on a plane needs no more."""

from __future__ import annotations

from dataclasses import replace

from bifocal.model.pair import Pair


class PhotoAlone(Pair):
    """A single photo before a plane; both images are it, so nothing can be intersected.

    Examples
    --------
    >>> from bifocal.model.photo import Photo
    >>> photo = Photo(plane_from_pixel=[[0.01, 0, 0], [0, -0.01, 0], [0, 0, 1]],
    ...               nadir=(0, 0), distance=12.0)
    >>> PhotoAlone(image1=photo, image2=photo).d1
    12.0
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        """Check nothing between its photos; there is one."""
        for name in ("image1", "image2"):
            object.__setattr__(self, name, replace(getattr(self, name), folder=self.folder))
