from .self_calibration import FIGURES as FIGURES
from .self_calibration import SelfCalibration as SelfCalibration
from .workflow import find_tracks as find_tracks
