"""The solver of a point survey: measured points to relief, coordinates, precision, world."""
