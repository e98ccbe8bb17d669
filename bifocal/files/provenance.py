"""The public names by which programs tell what makes their outputs, and what they take."""

from photocore.provenance import changed_photos, recording

__all__ = ["changed_photos", "recording"]
