from .workflow import targets_of_images as targets_of_images
