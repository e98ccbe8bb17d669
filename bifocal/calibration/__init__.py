"""Lenses: boards, straight lines, the lens database, undistorted photos."""
