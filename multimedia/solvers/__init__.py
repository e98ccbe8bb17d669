"""Domain objects and arrays in, results out; no files."""
