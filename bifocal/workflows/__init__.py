"""Path in, path out: where files meet solvers."""
