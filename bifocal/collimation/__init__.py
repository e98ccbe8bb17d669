"""The page `bifocal pick`: two photos on a table, from the first pick to the drawing."""
