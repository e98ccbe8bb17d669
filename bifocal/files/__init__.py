"""Files to domain objects and back; no mathematics."""
