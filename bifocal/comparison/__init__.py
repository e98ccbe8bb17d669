"""The same wall at two dates: what has changed, and what only seems to have."""
