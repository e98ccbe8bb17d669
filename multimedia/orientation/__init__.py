"""Project, intersect, resect, epipolar curves: cameras and points through the media."""
