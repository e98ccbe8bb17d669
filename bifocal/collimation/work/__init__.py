"""Long jobs of the page: what each is told, and how its own process carries it out.

`tasks` says what a job of each kind is told and what it answers. `orienting` sets photos up,
`matching` finds what both photos show, `making` makes relief, orthophoto and drawings.
"""
