"""What a person knows of a wall's relief: faces, break lines, occluders, and relief that obeys."""
