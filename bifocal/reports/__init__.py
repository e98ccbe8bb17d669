"""Reports: what was measured, with which geometry, and how good it is."""
