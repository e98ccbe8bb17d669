"""Where to stand, with which lenses, and what precision to expect."""
