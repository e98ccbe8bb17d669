"""Finished projects of other programs: cameras, lenses and sparse points, one reader a format."""
