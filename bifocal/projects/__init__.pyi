from .colmap_workflow import export_photos as export_photos
from .photos_workflow import ProjectOptions as ProjectOptions
from .photos_workflow import ProjectPhotos as ProjectPhotos
from .photos_workflow import photos_from_project as photos_from_project
from .photos_workflow import project_walls as project_walls
