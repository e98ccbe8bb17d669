"""What bifocal and multimedia share; private plumbing that users never import by name."""
