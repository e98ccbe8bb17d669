"""What tests of orientation take from inside the package, in one place for when it moves."""

from bifocal.orientation.absolute_orientation import orient_pair
from bifocal.orientation.orientation_stages import PhotoInput

__all__ = ["PhotoInput", "orient_pair"]
