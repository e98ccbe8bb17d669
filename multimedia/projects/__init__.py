"""A photogrammetric project and its files: cameras, media, object points, image points."""
