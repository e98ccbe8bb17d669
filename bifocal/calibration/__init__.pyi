from .board_calibration import Calibration as Calibration
from .workflow import undistort_images as undistort_images
