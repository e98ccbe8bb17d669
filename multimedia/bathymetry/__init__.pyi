from .corrected_points import Precision as Precision
from .correction_job import Job as Job
from .soundings_workflow import check_soundings as check_soundings
from .waterlevel_workflow import fit_water_level as fit_water_level
from .wave_statistics import WaveCase as WaveCase
from .wave_statistics import waves_over as waves_over
from .workflow import correct_file as correct_file
