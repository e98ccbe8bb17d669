from .index_workflow import find_from_index as find_from_index
from .index_workflow import find_index as find_index
from .workflow import shift_file as shift_file
from .workflow import write_template as write_template
