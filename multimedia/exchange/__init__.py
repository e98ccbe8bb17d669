"""Projects of other programs: COLMAP, Metashape, OpenCV, AquaCal."""
