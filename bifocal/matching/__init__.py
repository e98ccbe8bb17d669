"""Points of one photo found in the other: features, patches, targets, suggestions, corners."""
