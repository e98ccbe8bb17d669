"""Campaigns: whole surveys of many pairs, step by step, resumable, on any number of machines.

`survey_file` reads what is wanted, `photo_pairing` writes such a file from a folder, `inputs`
looks at all of it before any work. A pair is a `surveyed_pair` with its known points,
`pair_points`; `pair_steps` says which steps it needs, `step_store` keeps their results, `pair_job`
runs them, `leftovers` clears what no longer belongs. `worker_pool` shares pairs among processes,
`dask_cluster` and `shipping` among machines, `folder_locks` keeps them apart. `whole_wall` makes
what needs all pairs, `rectification` what needs one photo only; `verification` holds a
delivery against its records. `workflow` ties the commands to them.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
