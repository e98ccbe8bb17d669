"""The reference plane: which faces there are, which is the wall, how it bends."""
