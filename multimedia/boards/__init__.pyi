from .workflow import DetectedBoards as DetectedBoards
from .workflow import find_boards as find_boards
