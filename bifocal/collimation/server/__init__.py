"""The page's server: who may talk to it, its routes, the state it shows."""
