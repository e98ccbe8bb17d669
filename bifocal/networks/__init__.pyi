from .joint_workflow import JointTask as JointTask
from .joint_workflow import adjust_pairs as adjust_pairs
from .set_workflow import align_photo_set as align_photo_set
from .set_workflow import set_as_dict as set_as_dict
from .set_workflow import way_of_set as way_of_set
