"""Bundle adjustment through the media."""
