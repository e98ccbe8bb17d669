from .bundle import bundle_adjust as bundle_adjust
from .extensions import Extension as Extension
from .unknowns import Adjustment as Adjustment
from .unknowns import Unknowns as Unknowns
from .unknowns import decimals as decimals
from .unknowns import is_angle as is_angle
