"""Every comparison with other programs, in one run: ``python -m benchmarks.peers``."""
