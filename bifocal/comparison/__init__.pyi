from .workflow import compare_files as compare_files
