"""Finished projects of other programs become sets of photos, and sets go on in other programs."""
