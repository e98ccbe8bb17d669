from .camera_plan import CameraSensor as CameraSensor
from .camera_plan import Plan as Plan
from .workflow import make_plan as make_plan
from .workflow import plan_as_dict as plan_as_dict
