"""Photos of boards as points of a project."""
