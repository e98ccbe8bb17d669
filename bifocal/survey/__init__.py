"""The point survey: measured points to relief, coordinates, precision, world coordinates."""
