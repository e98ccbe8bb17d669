from .studies import Design as Design
from .studies import best_placement as best_placement
