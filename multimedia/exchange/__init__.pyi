from .workflow import convert as convert
